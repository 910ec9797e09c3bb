"""Number of inconclusive runs, and their causes.

    python benchmarks/inconclusive.py FOLDER... [--sut NAME] [--world NAME] [--sets N] [--road-path
    DIR] [--passed N] [--jobs N]

Files are those of benchmarks/playable.py; of a variation file so many parameter sets are drawn.
Runs last 60 s at most. Each cause is followed by its files, with the reason of the first run of
each, then errors and some passed runs: to be looked at, whether a person would call them tested.
"""

from __future__ import annotations

from argparse import ArgumentParser
from collections import Counter, defaultdict
from pathlib import Path
from random import Random

from playable import files

from runner.batch.batch import run_batch
from runner.batch.jobs import Outcome, jobs_of
from runner.judging.evidence.least import CAUSES
from runner.judging.settings import DEFAULT_SYSTEM, WORLDS, RunSettings
from xosc.distributions import Selection


def main() -> None:
    """Entry point."""
    parser = ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--sut", default=DEFAULT_SYSTEM)
    parser.add_argument("--world", choices=WORLDS, default="sumo")
    parser.add_argument("--sets", type=int, default=4)
    parser.add_argument("--road-path", action="append", default=[])
    parser.add_argument("--passed", type=int, default=40, help="passed runs to draw and print")
    parser.add_argument("--seed", type=int, default=0, help="of the draw")
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args()
    settings = RunSettings(
        timestep=0.1,
        sut=given.sut,
        world=given.world,
        max_time=60.0,
        road_path=tuple(given.road_path),
    )  # limits that no shipped scenario reaches before its events
    jobs = jobs_of(
        list(files(given.folders)),
        {},
        enforce_constraints=True,
        selection=Selection(sample=given.sets),
    )
    states: Counter[str] = Counter()
    by_cause: defaultdict[str, list[Outcome]] = defaultdict(list)
    passed: list[Outcome] = []
    for outcome in run_batch(jobs, settings, processes=given.jobs):
        states[outcome.state] += 1
        for cause in outcome.causes if outcome.state == "inconclusive" else ():
            by_cause[cause].append(outcome)
        if outcome.state == "error":
            by_cause["error"].append(outcome)
        if outcome.state == "passed":
            passed.append(outcome)
    print(
        f"{states.total()} runs, sut {given.sut}: "
        + ", ".join(f"{number} {state}" for state, number in states.most_common())
    )
    for cause in (*CAUSES, "error"):
        runs = by_cause.get(cause, [])
        firsts = {outcome.job.source: outcome for outcome in reversed(runs)}
        print(f"{cause}: {len(runs)} runs of {len(firsts)} files")
        for path, outcome in sorted(firsts.items()):
            print(f"    {path}: {outcome.message[:300]}")
    drawn = Random(given.seed).sample(passed, min(given.passed, len(passed)))
    for outcome in sorted(drawn, key=lambda each: each.job.source):
        said = "; ".join(outcome.remarks)[:300]
        print(f"passed: {outcome.job.source}: {outcome.status} at {outcome.end_time:.2f} s; {said}")


if __name__ == "__main__":
    main()
