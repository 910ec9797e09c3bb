"""Exports of scenario documents: exported or refused with the reason, and equality of motion
afterwards.

    python benchmarks/exports.py FOLDER... [--to 1.0 --to carla] [--jobs 2] [--no-runs]

Scenarios and distributions below the folders count, catalogues do not. A file moves as before when
every participant of the exported file (of its first set of parameters) is within 20 cm of where the
original has it, at every step until the original ends, in the kinematic world and without a system
under test. One whose original can't be run is counted apart.
"""

from __future__ import annotations

import re
from argparse import ArgumentParser
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

import runner
import xosc
from runner.exchange.exports import TARGETS
from runner.exchange.exports.exporting import export_documents
from runner.judging.settings import RunSettings
from schemas.common.errors import ToolchainError
from xosc.exports.draft import Folder

DOCUMENTS = [target.name for target in TARGETS.values() if not target.of_run]
SETTINGS = RunSettings(timestep=0.05, sut="none", world="kinematic", max_time=20.0)
TOLERANCE = 0.2
"""m"""

Motion = dict[str, np.ndarray]
"""Time, x and y of every step by the name of the participant."""


class Answer(NamedTuple):
    """Outcome of one file. distance: greatest distance (m) between the two runs; NaN without a
    comparison."""

    path: Path
    target: str
    reason: str
    distance: float


def scenarios(folders: list[Path]) -> list[Path]:
    """All scenarios and distributions that can be read."""
    found = [
        file
        for folder in folders
        for file in ([folder] if folder.is_file() else sorted(folder.rglob("*.xosc")))
    ]
    return [path for path in found if _kind(path) != "catalog"]


def _kind(path: Path) -> str:
    try:
        return xosc.load(path).kind
    except ToolchainError:
        return "unreadable"


def answer(path: Path, target: str, runs: bool) -> Answer:
    """Export a file, and compare."""
    with TemporaryDirectory() as scratch:
        folder = Folder(scratch)
        (done,) = export_documents([path], TARGETS[target], folder)
        if done.exit_code:
            return Answer(path, target, _reason(done.remarks[0]), np.nan)
        if not runs:
            return Answer(path, target, "", np.nan)
        try:
            expected = motion(path)
        except ToolchainError:
            return Answer(path, target, "", np.nan)
        whole = Path(scratch) / path.name
        try:
            got = motion(
                whole if whole.exists() else sorted(Path(scratch).glob(f"{path.stem}~*.xosc"))[0]
            )
        except ToolchainError as error:
            return Answer(path, target, f"exported, and then: {_reason(str(error))}", np.inf)
        return Answer(path, target, "", greatest_distance(expected, got))


@cache
def motion(path: Path) -> Motion:
    """Return the motion of all entities, in the first parameter set of a distribution."""
    parameters: dict[str, str] = {}
    if xosc.load(path).kind == "distribution":
        path, parameters = next(iter(xosc.variations(path)))
    tracks = runner.run(path, SETTINGS, parameters=parameters).recording.tracks
    return {
        name: np.column_stack([track.columns[c] for c in ("time", "x", "y")])
        for name, track in tracks.items()
    }


def greatest_distance(expected: Motion, got: Motion) -> float:
    """Between the places of the same participants (CARLA's ego is called hero) at the same times,
    m."""
    names = {name: name if name in got else "hero" for name in expected}
    if set(names.values()) != set(got):
        return np.inf
    distances = [0.0]
    for name, rows in expected.items():
        others = got[names[name]]
        _, here, there = np.intersect1d(
            rows[:, 0].round(6), others[:, 0].round(6), return_indices=True
        )
        if len(here) < len(rows):
            return np.inf
        distances.append(float(np.hypot(*(rows[here, 1:] - others[there, 1:]).T).max()))
    return max(distances)


def _reason(message: str) -> str:
    """A refusal without its place and the names in it."""
    return re.sub(r"'[^']*'", "…", re.sub(r"^\S+\.\w+:(\d+:)? ", "", message))[:120]


def show(target: str, answers: list[Answer]) -> None:
    """Print a target's line of the table, refusals by reason and files that move otherwise."""
    exported = [each for each in answers if not each.reason or each.reason.startswith("exported")]
    compared = [each for each in exported if not np.isnan(each.distance)]
    same = [each for each in compared if each.distance <= TOLERANCE]
    share = len(exported) / max(len(answers), 1)
    moving = f"{len(same):4} of {len(compared):4} move as before"
    print(f"{target:8}{len(answers):5} files, {len(exported):4} exported ({share:.0%}), {moving}")
    for reason, count in Counter(each.reason for each in answers if each.reason).most_common():
        example = next(each.path for each in answers if each.reason == reason)
        print(f"    {count:4}  {reason}  ({example.name})")
    for each in compared:
        if each.distance > TOLERANCE:
            print(f"          {each.distance:.3g} m: {each.path}")


def main() -> None:
    """Entry point."""
    parser = ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument(
        "--to",
        action="append",
        choices=DOCUMENTS,
        help="repeatable; all targets of documents without it",
    )
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--no-runs", action="store_true", help="export only")
    parser.add_argument("--first", type=int, help="that many files only")
    arguments = parser.parse_args()
    targets = arguments.to or DOCUMENTS
    work = [
        (path, target, not arguments.no_runs)
        for path in islice(scenarios(arguments.folders), arguments.first)
        for target in targets
    ]
    with ProcessPoolExecutor(arguments.jobs) as pool:
        answers = list(pool.map(answer, *zip(*work, strict=True), chunksize=len(targets)))
    for target in targets:
        show(target, [each for each in answers if each.target == target])


if __name__ == "__main__":
    main()
