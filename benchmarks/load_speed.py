"""Load time of scenarios and road networks, and its ratio to that of another checkout.

    python benchmarks/load_speed.py PATH... [--against CHECKOUT] [--repeat N]

A process reads every file once: roads with `xodr.load`, scenarios with `xosc.load` and
`xosc.resolve`. Processes of both take turns, the least processor time of each file counts, and only
files that both read are compared. Imports are not counted, nor are runs of the garbage collector,
which fall on one file or another.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path

from schemas.common.terminal.files import expand

HERE = Path(__file__).parents[1]
WARM = (
    HERE / "xosc" / "library" / "simple_cut_in.xosc",
    next((HERE / "xodr" / "library").glob("*.xodr")),
)
"""Read first, as what a first file imports is no load time."""
_READ = """
import gc, json, sys, time
import xodr, xosc
from schemas.common.errors import ToolchainError

def read(path):
    if path.endswith(".xodr"):
        xodr.load(path)
        return
    document = xosc.load(path)
    if document.kind == "scenario":
        xosc.resolve(document, enforce_constraints=False)

times = {}
gc.disable()
for path in json.load(sys.stdin):
    start = time.process_time()
    try:
        read(path)
    except ToolchainError:
        continue
    times[path] = time.process_time() - start
print(json.dumps(times))
"""


def main() -> None:
    """Print the time of all files, and of the slowest."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    arguments.add_argument("paths", nargs="+", help="files, folders and globs")
    arguments.add_argument("--against", type=Path, help="another checkout")
    arguments.add_argument("--repeat", type=int, default=5, help="processes of each checkout")
    options = arguments.parse_args()
    files = [str(path.resolve()) for path in expand(options.paths)]
    checkouts = [HERE, *([options.against.resolve()] if options.against else [])]
    turns = [[_times(checkout, files) for checkout in checkouts] for _ in range(options.repeat)]
    least = [_least(list(turn)) for turn in zip(*turns, strict=True)]
    common = [file for file in files if all(file in times for times in least)]
    if not common:
        raise SystemExit("no file that can be read")
    print(f"{len(common)} of {len(files)} files, least of {options.repeat} processes")
    slowest = max(common, key=least[0].__getitem__)
    for name, chosen in ((f"{len(common)} files", common), (Path(slowest).name, [slowest])):
        print(f"{name:<24}" + _compared([sum(times[file] for file in chosen) for times in least]))


def _times(checkout: Path, files: list[str]) -> dict[str, float]:
    """Processor time (s) by file, of those that a checkout reads."""
    done = subprocess.run(
        [sys.executable, "-c", _READ],
        input=json.dumps([*map(str, WARM), *files]),
        env={**os.environ, "PYTHONPATH": str(checkout)},
        cwd=checkout,
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    return dict(json.loads(done.stdout))


def _least(turns: list[dict[str, float]]) -> dict[str, float]:
    return {file: min(times[file] for times in turns) for file in turns[0]}


def _compared(seconds: list[float]) -> str:
    here, *others = seconds
    return f"{1e3 * here:9.1f} ms" + "".join(
        f"{1e3 * other:9.1f} ms there, ratio {here / other:.2f}" for other in others
    )


if __name__ == "__main__":
    main()
