"""Kill a batch at random, again and again, resume it each time, and compare what it leaves with an
undisturbed batch.

    python benchmarks/interrupt.py [PATH...] [--kills 200] [--seed 0]

PATHs are as for `xosc-run`, the shipped library by default. A batch is one `xosc-run --jobs 2` with
an output folder. All its processes are killed (SIGKILL) after a random time, and it is resumed,
until it completes; then the next batch begins, until there were as many kills as asked for. Each
completed batch must have the files of the plain one, byte by byte. The exit code is 1 where one has
not.

    python benchmarks/interrupt.py --signals 10 [--only NAME] [--seed 0]

sends SIGINT or SIGTERM to each command as often, to its process or to all of its processes, at a
random time. The command must end by it (128 plus the number), or as it does undisturbed, in 10 s,
without a traceback, and leave no process.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

_LIBRARY = Path(__file__).resolve().parent.parent / "xosc" / "library"
_OWN = {".lock"}
"""Files that are not compared"""
_LONGEST = 10.0
"""Time (s) that a command has to end"""
_FAULTS = ("Traceback", "Exception ignored", "internal error", "Fatal", "leaked")


def main() -> int:
    """Print a line for each batch and the sum of all; the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("paths", nargs="*", default=[str(_LIBRARY)])
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--signals", type=int, default=0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="part of the names of commands that get signals")
    options = parser.parse_args()
    draw = random.Random(options.seed)
    if options.signals:
        return _signalled(options.signals, draw, options.only)
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
                f"batch {batches}: killed {killed} times, {len(found)} files, {len(wrong)} differ "
                f"{wrong[:3] or ''}",
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
    """Return the files of a batch folder by name."""
    return {
        str(path.relative_to(out)): path.read_bytes()
        for path in out.rglob("*")
        if path.is_file() and path.name not in _OWN
    }


def _calls(results: Path) -> dict[str, list[str]]:
    """Command lines by name; all but the first two write into a folder that is added."""
    some = [str(path) for path in sorted(_LIBRARY.glob("*cut_in*.xosc"))[:4]]
    cut_in, found = str(_LIBRARY / "cut_in_highway.xosc"), str(results)
    search = ["xosc-generate", cut_in, "--budget", "15", "--pin", "Ego_Speed_mps=36", "--out"]
    recognize = ["xosc-recognize", found, "--labels", "rules", "--out"]
    kinematic, two = ["xosc-run", "--world", "kinematic", *some], ["--jobs", "2", "--out"]
    return {
        "check": ["xosc-check", *some],
        "replay": ["xosc-replay", found],
        "run": [*kinematic, "--out"],
        "run --jobs 2": [*kinematic, *two],
        "run on SUMO --jobs 2": ["xosc-run", *some[:2], "--replay", *two],
        "recognize": recognize,
        "recognize --jobs 2": [*recognize[:-1], *two],
        "generate": search,
        "generate --jobs 2": [*search[:-1], *two],
        "export": ["xosc-export", *some, "--to", "esmini", "--out"],
        "loop": ["xosc-loop", found, "--budget", "8", "--rounds", "1", "--most", "1", "--out"],
    }


def _signalled(times: int, draw: random.Random, only: str) -> int:
    """Interrupt each command at random times, and print what is wrong; the exit code."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        results = folder / "results"
        _run([str(path) for path in sorted(_LIBRARY.glob("*cut_in*.xosc"))], results).communicate()
        total = 0
        for name, call in _calls(results).items():
            if only not in name:
                continue
            begin = time.monotonic()
            plain = _started(call, folder / f"{name} plain")
            plain.communicate()
            longest, wrong = time.monotonic() - begin, 0
            for number in range(times):
                signalled = draw.choice([signal.SIGINT, signal.SIGTERM])
                whole, after = draw.random() < 0.5, draw.uniform(0.0, longest)
                out = folder / f"{name} {number}"
                fault = _fault(_started(call, out), signalled, whole, after, plain.returncode)
                wrong += bool(fault)
                if fault:
                    who = "to all" if whole else "to it"
                    print(
                        f"{name}: {signalled.name} {who} after {after:.2f} s: {fault}", flush=True
                    )
            print(f"{name}: {longest:.1f} s, {times} signals, {wrong} ended badly", flush=True)
            total += wrong
    return min(total, 1)


def _started(call: list[str], out: Path) -> subprocess.Popen[str]:
    command = [str(Path(sys.executable).with_name(call[0])), *call[1:]]
    command += [str(out)] if call[-1] == "--out" else []
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.Popen(command, text=True, start_new_session=True, **streams)


def _fault(
    process: subprocess.Popen[str], number: signal.Signals, whole: bool, after: float, plain: int
) -> str:
    """Send a signal after some seconds; what is wrong with the end, empty for nothing."""
    time.sleep(after)
    if process.poll() is not None:
        process.communicate()
        return ""
    (os.killpg if whole else os.kill)(process.pid, number)
    begin = time.monotonic()
    try:
        _, error = process.communicate(timeout=60.0)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        return "it goes on for a minute"
    took = time.monotonic() - begin
    ends = 128 + number, -number, plain  # a shell says 128 + number of what Python's end ends, too
    if process.returncode not in ends:
        return f"exit code {process.returncode}: {error[-500:]}"
    if any(fault in error for fault in _FAULTS):
        return error[-2000:]
    if process.returncode == 128 + number and error.count("interrupted") != 1:
        return f"it says {error[-500:]!r}"
    if took > _LONGEST:
        return f"it ends after {took:.1f} s with {process.returncode}"
    time.sleep(0.5)
    try:
        os.killpg(process.pid, 0)
    except ProcessLookupError:
        return ""
    time.sleep(2.0)
    try:
        os.killpg(process.pid, signal.SIGKILL)
    except ProcessLookupError:
        return ""
    return "processes are left"


if __name__ == "__main__":
    sys.exit(main())
