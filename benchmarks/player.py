"""Child process of benchmarks/corpora_diff.py: call xosc-run with each of a list of arguments.

    PYTHONPATH=CHECKOUT python -P benchmarks/player.py LIST

LIST is a JSON file with the keys `calls` (lists of arguments) and `seconds` (wall-clock limit for
each). Each call runs in a fork of this process, whose imports it reuses. One JSON line a call: exit
code and printed text.
"""

from __future__ import annotations

import io
import json
import os
import resource
import signal
import sys
import tempfile
import time
import traceback
from contextlib import suppress
from importlib import import_module
from pathlib import Path

ADDRESSES = 6 * 2**30
"""Bytes of address space for a file"""
POLLED = 0.02
"""Seconds between two looks at a child process"""
TIMEOUT = "timeout"


def main() -> None:
    """Entry point."""
    order = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    start = import_module("xosc_toolchain.start")
    command = import_module(start.MODULES["xosc-run"]).main
    for name in ("runner", "runner.batch.batch", "pyarrow.parquet", "libsumo"):
        with suppress(ImportError):  # loaded once, not per file; modules move between versions
            import_module(name)
    for arguments in order["calls"]:
        code, text = _forked(command, ["xosc-run", *arguments], order["seconds"])
        print(json.dumps({"code": code, "text": text}), flush=True)


def _forked(command: object, arguments: list[str], seconds: float) -> tuple[int | str, str]:
    """Return exit code (`timeout` where killed) and printed text of a command in a fork."""
    with tempfile.TemporaryFile() as printed:
        child = os.fork()
        if child == 0:
            _child(command, arguments, printed.fileno())
        end = time.monotonic() + seconds
        while True:
            ended, status = os.waitpid(child, os.WNOHANG)
            if ended or time.monotonic() > end:
                break
            time.sleep(POLLED)
        with suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)  # processes that the command has left, too
        if not ended:
            os.waitpid(child, 0)
        printed.seek(0)
        text = printed.read().decode("utf-8", "replace")
    return (os.waitstatus_to_exitcode(status) if ended else TIMEOUT), text


def _child(command: object, arguments: list[str], printed: int) -> None:
    code = 5
    try:
        os.setpgid(0, 0)
        for stream in (1, 2):
            os.dup2(printed, stream)
        # The parent's stream objects hold its own unwritten text.
        sys.stdout = io.TextIOWrapper(os.fdopen(1, "wb", closefd=False), encoding="utf-8")
        sys.stderr = io.TextIOWrapper(os.fdopen(2, "wb", closefd=False), encoding="utf-8")
        resource.setrlimit(resource.RLIMIT_AS, (ADDRESSES, ADDRESSES))
        sys.argv = arguments
        command()  # type: ignore[operator]
        code = 0
    except SystemExit as ended:
        code = ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    except BaseException:  # whatever ends the command is a difference to show
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


if __name__ == "__main__":
    main()
