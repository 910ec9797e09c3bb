"""Kill a batch at random, again and again, resume it each time, and compare what it leaves with an undisturbed batch.

    python benchmarks/interrupt.py [PATH...] [--kills 200] [--seed 0]

PATHs are as for `xosc-run`, the shipped library by default. A batch is one `xosc-run --jobs 2` with
an output folder. All its processes are killed (SIGKILL) after a random time, and it is resumed,
until it completes; then the next batch begins, until there were as many kills as asked for. Each
completed batch must have the files of the plain one, byte by byte, and one journal entry a run. The
exit code is 1 where one has not.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

_LIBRARY = Path(__file__).resolve().parent.parent / "xosc" / "library"
_OWN = {"runs.jsonl", ".lock"}
"""Files of which only the content that a user sees is compared: entries are in the order in which runs end."""


def main() -> int:
    """Print a line for each batch and the sum of all; the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("paths", nargs="*", default=[str(_LIBRARY)])
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    draw = random.Random(options.seed)
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        begin = time.monotonic()
        _run(options.paths, folder / "plain").communicate()
        longest = time.monotonic() - begin
        expected = _content(folder / "plain")
        kills = batches = different = 0
        while kills < options.kills:
            out = folder / f"batch{batches}"
            killed = _killed_and_resumed(options.paths, out, longest, draw, options.kills - kills)
            found = _content(out)
            wrong = [
                name
                for name in expected.keys() | found.keys()
                if expected.get(name) != found.get(name)
            ]
            kills, batches, different = kills + killed, batches + 1, different + len(wrong)
            print(
                f"batch {batches}: killed {killed} times, {len(found)} files, {len(wrong)} differ {wrong[:3] or ''}",
                flush=True,
            )
    print(f"{kills} kills in {batches} batches of {longest:.1f} s: {different} files differ")
    return min(different, 1)


def _killed_and_resumed(
    paths: list[str], out: Path, longest: float, draw: random.Random, most: int
) -> int:
    """Kill a batch and resume it until it completes; how often it was killed."""
    kills = 0
    while True:
        batch = _run(paths, out)
        try:
            batch.wait(timeout=draw.uniform(0, longest) if kills < most else None)
            return kills
        except subprocess.TimeoutExpired:
            os.killpg(batch.pid, signal.SIGKILL)
            batch.wait()
            kills += 1


def _run(paths: list[str], out: Path) -> subprocess.Popen[bytes]:
    options = ["--world", "kinematic", "--out", str(out), "--resume", "--jobs", "2"]
    command = [sys.executable, "-m", "runner.xosc_run", *paths, *options]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, start_new_session=True)


def _content(out: Path) -> dict[str, object]:
    """Return the content of a batch folder: its files by name, and the sorted entries of its journal."""
    files: dict[str, object] = {
        str(path.relative_to(out)): path.read_bytes()
        for path in out.rglob("*")
        if path.is_file() and path.name not in _OWN
    }
    entries = [json.loads(line) for line in (out / "runs.jsonl").read_text().splitlines()]
    return files | {"runs.jsonl": sorted(entries, key=lambda entry: str(entry["job"]["name"]))}


if __name__ == "__main__":
    sys.exit(main())
