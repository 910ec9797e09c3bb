"""Result of CARLA's scenario_runner's parser on exports for CARLA: files read, and first errors.

    python benchmarks/scenario_runner.py FOLDER... --checkout DIR --python PYTHON

Scenarios and distributions below the folders count, of which the first three sets of parameters are
read. DIR is the folder of a checkout of scenario_runner that has its `srunner`, PYTHON one that has
CARLA's wheel (docs/exports.md); by default they are what XOSC_SCENARIO_RUNNER and XOSC_CARLA_PYTHON
name. Where there are none, nothing is read, and that is said.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
from argparse import ArgumentParser
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.exports import scenarios
from runner.exchange.exports import TARGETS
from runner.exchange.exports.exporting import export_documents
from xosc.exports.draft import Folder

READER = Path(__file__).parents[1] / "tests" / "xosc" / "scenario_runner_reader.py"
AT_ONCE, SETS = 20, 3
"""Files that one process reads; sets of parameters of a distribution that count."""


def exported(sources: list[Path], folder: Path) -> list[Path]:
    """Export each source that is not refused, into a folder of its own."""
    files: list[Path] = []
    for number, source in enumerate(sources):
        (done,) = export_documents([source], TARGETS["carla"], Folder(folder / str(number)))
        if done.exit_code == 0:
            files += sorted((folder / str(number)).glob("*.xosc"))[:SETS]
    return files


def stops(files: list[Path], checkout: str, python: str) -> Iterator[tuple[Path, str]]:
    """The files that the parser does not read, with what it says."""
    for some in (files[first : first + AT_ONCE] for first in range(0, len(files), AT_ONCE)):
        answer = subprocess.run(
            [python, str(READER), checkout, *map(str, some)],
            capture_output=True,
            text=True,
            check=False,
        )
        lines = [json.loads(line) for line in answer.stdout.splitlines() if line.startswith("{")]
        yield from (
            (path, told["error"])
            for path, told in zip(some, lines, strict=False)
            if "error" in told
        )
        yield from ((path, f"no answer: {answer.stderr[-200:]}") for path in some[len(lines) :])


def main() -> None:
    """Entry point."""
    parser = ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument(
        "--checkout",
        default=os.environ.get("XOSC_SCENARIO_RUNNER", ""),
        help="the folder that has srunner",
    )
    parser.add_argument(
        "--python",
        default=os.environ.get("XOSC_CARLA_PYTHON", ""),
        help="a Python with CARLA's wheel",
    )
    arguments = parser.parse_args()
    if not (Path(arguments.checkout) / "srunner").is_dir() or not arguments.python:
        print("no scenario_runner at hand (--checkout and --python): nothing is read")
        return
    with TemporaryDirectory() as scratch:
        sources = scenarios(arguments.folders)
        files = exported(sources, Path(scratch))
        stopped = list(stops(files, arguments.checkout, arguments.python))
    print(
        f"{len(sources)} files, {len(files)} exports for CARLA, {len(files) - len(stopped)} read "
        "by scenario_runner's parser"
    )
    for message, count in Counter(
        re.sub(r"'[^']*'", "…", message)[:120] for _, message in stopped
    ).most_common():
        print(f"    {count:4}  {message}")
    for path, message in stopped[:20]:
        print(f"          {path.name}: {message[:160]}")


if __name__ == "__main__":
    main()
