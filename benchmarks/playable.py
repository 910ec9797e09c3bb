"""Number of scenario files that play, and reasons of the others.

    python benchmarks/playable.py FOLDER... [--road-path DIR] [--catalog-path DIR] [--sut NAME]
    [--jobs N]

Scenarios and variation files below the folders count, equal ones once, catalogues and what is no
XML do not; of a variation file three parameter sets are drawn. Runs are those of the kinematic
world, for 25 s at 0.1 s. A file plays when its runs end, passed or failed; it is incomplete where a
road network, a catalogue or a scenario that it names is not there; all others are refused.
"""

from __future__ import annotations

import hashlib
import re
from argparse import ArgumentParser
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import xosc
from runner.batch.batch import run_batch
from runner.batch.jobs import Outcome, jobs_of
from runner.judging.settings import RunSettings
from schemas.common.errors import ToolchainError
from xosc.distributions import Selection

SETS = 3
"""Parameter sets that are drawn of a variation file."""
INCOMPLETE = re.compile(
    r"LogicFile: the road network .* does not exist|there is no catalogue "
    r"|ScenarioFile: .* does not exist"
)


def files(folders: list[Path]) -> Iterator[Path]:
    """Scenarios and variation files below folders, those of equal content once."""
    seen = set()
    for path in (
        file
        for folder in folders
        for file in ([folder] if folder.is_file() else sorted(folder.rglob("*.xosc")))
    ):
        content = hashlib.sha256(path.read_bytes()).digest()
        if content not in seen and _kind(path) != "catalog":
            yield path
        seen.add(content)


def _kind(path: Path) -> str:
    try:
        return xosc.load(path).kind
    except ToolchainError as error:
        return "catalog" if "is not well-formed" in str(error) else "refused"


def verdict(outcomes: list[Outcome]) -> str:
    """`plays`, `incomplete`, or the first reason for which a file is refused, without names and
    numbers."""
    errors = [each.message for each in outcomes if each.state == "error"]
    if not errors:
        return "plays"
    if any(INCOMPLETE.search(error) for error in errors):
        return "incomplete"
    return re.sub(r"'[^']*'|-?\d+(\.\d+)?", "…", re.sub(r"^.*?:\d+: ", "", errors[0]))[:110]


def main() -> None:
    """Entry point."""
    parser = ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--road-path", action="append", default=[])
    parser.add_argument("--catalog-path", action="append", default=[])
    parser.add_argument("--road", choices=["auto"])
    parser.add_argument("--sut", default="none")
    parser.add_argument("--jobs", type=int, default=1)
    arguments = parser.parse_args()
    settings = RunSettings(
        timestep=0.1,
        sut=arguments.sut,
        world="kinematic",
        max_time=25.0,
        road=arguments.road,
        road_path=tuple(arguments.road_path),
        catalog_path=tuple(arguments.catalog_path),
    )
    chosen = list(files(arguments.folders))
    ended: dict[Path, list[Outcome]] = {path: [] for path in chosen}
    jobs = jobs_of(chosen, {}, enforce_constraints=True, selection=Selection(sample=SETS))
    for outcome in run_batch(jobs, settings, processes=arguments.jobs):
        ended[outcome.job.source].append(outcome)
    verdicts = {path: verdict(outcomes) for path, outcomes in ended.items()}
    count = Counter(verdicts.values())
    complete = len(chosen) - count["incomplete"]
    print(
        f"{len(chosen)} files, {complete} complete, {count['plays']} play "
        f"({count['plays'] / max(complete, 1):.0%} of those)"
    )
    for reason, number in count.most_common():
        if reason not in ("plays", "incomplete"):
            print(
                f"    {number:4}  {reason}  "
                f"({next(path for path, each in verdicts.items() if each == reason).name})"
            )


if __name__ == "__main__":
    main()
