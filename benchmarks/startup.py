"""Start-up of `xosc-run`: whole processes, against a process that does nothing but import libsumo.

    python benchmarks/startup.py [--repeat N]

Each command is run once to fill the cache of road networks, then N times; the median counts.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import time
from pathlib import Path

SCENARIO = Path(__file__).parents[1] / "xosc" / "library" / "highway_cut_in.xosc"
RUN = [sys.executable, "-m", "runner.cli"]
COMMANDS = {
    "python -c 'import libsumo'": [sys.executable, "-c", "import libsumo"],
    "xosc-run --help": [*RUN, "--help"],
    "xosc-run --dry-run FILE": [*RUN, "--dry-run", str(SCENARIO)],
    "xosc-run --world kinematic FILE": [*RUN, "--world", "kinematic", str(SCENARIO)],
    "xosc-run FILE": [*RUN, str(SCENARIO)],
}


def main() -> None:
    """Print the median of each command in seconds, and its ratio to the first one."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("--repeat", type=int, default=7)
    repeat = arguments.parse_args().repeat
    bare = None
    for name, command in COMMANDS.items():
        _seconds(command)
        median = statistics.median(_seconds(command) for _ in range(repeat))
        bare = bare or median
        print(f"{name:34}{median:7.3f} s{median / bare:7.2f}")


def _seconds(command: list[str]) -> float:
    start = time.perf_counter()
    subprocess.run(command, stdout=subprocess.DEVNULL, check=True)
    return time.perf_counter() - start


if __name__ == "__main__":
    main()
