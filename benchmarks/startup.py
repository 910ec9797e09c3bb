"""Start-up of `xosc-run`: whole processes, against a process that does nothing but import libsumo.

    python benchmarks/startup.py [--repeat N]

Each command is run once to fill the caches of road networks and bytecode, then N times in turn with
the others; the least processor time counts. Bytecode is kept in a folder of the benchmark, also
where `PYTHONDONTWRITEBYTECODE` is set: compiling all modules each time is no part of a start.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

SCENARIO = Path(__file__).parents[1] / "xosc" / "library" / "simple_cut_in.xosc"
RUN = [
    sys.executable,
    "-c",
    "from xosc_toolchain.start import xosc_run; xosc_run()",
]
"""Same as the command, wherever it is installed"""
COMMANDS = {
    "python -c 'import libsumo'": [sys.executable, "-c", "import libsumo"],
    "xosc-run --help": [*RUN, "--help"],
    "xosc-run --dry-run FILE": [*RUN, "--dry-run", str(SCENARIO)],
    "xosc-run --world kinematic FILE": [*RUN, "--world", "kinematic", str(SCENARIO)],
    "xosc-run FILE": [*RUN, str(SCENARIO)],
}


def main() -> None:
    """Print the processor time of each command in seconds, and its ratio to the first one."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    arguments.add_argument("--repeat", type=int, default=7)
    repeat = arguments.parse_args().repeat
    with TemporaryDirectory() as bytecode:
        given = {**os.environ, "PYTHONPYCACHEPREFIX": bytecode, "PYTHONDONTWRITEBYTECODE": ""}
        turns = [
            [_seconds(command, given) for command in COMMANDS.values()] for _ in range(1 + repeat)
        ]
    times = [min(times) for times in zip(*turns[1:], strict=True)]
    for name, seconds in zip(COMMANDS, times, strict=True):
        print(f"{name:34}{seconds:7.3f} s{seconds / times[0]:7.2f}")


def _seconds(command: list[str], given: dict[str, str]) -> float:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, stdout=subprocess.DEVNULL, check=True, env=given)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


if __name__ == "__main__":
    main()
