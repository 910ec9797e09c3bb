"""Scenarios that play in arrays: which do, whether they play there as one by one, and how fast.

    python -m benchmarks.arrays FOLDER... [--sets N] [--seed S] [--sut NAME] [--road-path DIR]

For each scenario or variation file of the folders a line: the first element that does not play in
arrays; or how many of N parameter sets, drawn from those of the variation file or from the limits
that the scenario's parameters declare, have another verdict, end, contact, place (by 1 mm) or
measure (by 1e-6 of it) there than in the interpreter, how many the interpreter has to play in any
case, and processor times. The exit code is 1 where there is a difference.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

import runner
import xosc
from generation.search.outcomes import RISK_WINDOW
from generation.space.space import Space
from runner.batch.arrays import obstacle, play, structures
from runner.batch.batch import runnable
from runner.batch.jobs import Job, jobs_of
from runner.engine.motion.rss import parameter_set
from runner.judging.evidence.array_judge import OPEN, ArrayOutcomes
from runner.judging.measures.criticality import Criticality
from runner.judging.measures.runs import Measuring
from runner.judging.result import RunResult
from runner.judging.settings import RunSettings
from schemas.common.errors import ToolchainError

FAR, RELATIVE = 1e-3, 1e-6
"""Greatest difference of places (m), and of measures as a part of them"""
_MOST_LISTED = 100_000
"""Sets of a variation file from which those that are played are drawn"""


def drawn(path: Path, count: int, seed: int) -> list[dict[str, str]]:
    """Parameter sets within the limits that a scenario declares; its defaults alone where it
    declares none."""
    try:
        space = Space.of(path)
    except ToolchainError:
        return [{}]
    theta = space.draw(count, np.random.default_rng(seed))
    return [
        {name: str(value) for name, value in {**space.pinned, **space.values(row)}.items()}
        for row in theta
    ]


def scenario_of(path: Path, count: int, seed: int) -> tuple[Path, list[dict[str, str]]]:
    """Scenario of a file, and parameter sets for it: one at least."""
    if xosc.load(path).kind == "scenario":
        return path, drawn(path, count, seed) if count else [{}]
    listed = [
        job for job in islice(jobs_of([path], {}, True), _MOST_LISTED) if isinstance(job, Job)
    ]
    chosen = np.random.default_rng(seed).permutation(len(listed))[: max(count, 1)]
    return listed[0].scenario, [dict(listed[each].parameters) for each in chosen]


def played(
    path: Path, sets: Sequence[Mapping[str, str]], settings: RunSettings
) -> dict[int, tuple[ArrayOutcomes, int]]:
    """Outcomes in arrays of the sets that have one, and their places there, by the numbers of the
    sets."""
    found = {}
    measuring = Measuring(parameter_set("ad-rss"), RISK_WINDOW)
    for structure in structures(path, sets, settings):
        for block in play(structure, settings, measuring, keeps=True):
            for place, number in enumerate(block.members.tolist()):
                if block.outcomes.outcome[place] != OPEN:
                    found[number] = (block.outcomes, place)
    return found


def differences(outcomes: ArrayOutcomes, place: int, result: RunResult) -> Iterator[str]:
    """Differences of a run in arrays from that of the interpreter."""
    told = (outcomes.outcome[place], outcomes.status[place], float(outcomes.end_time[place]))
    truth = (result.verdict.outcome, result.status, result.end_time)
    if told != truth:
        yield f"{told} instead of {truth}"
        return
    for name, track in result.recording.tracks.items():
        motion, columns = outcomes.motion(name, place), track.columns
        apart = np.hypot(motion.x - columns["x"], motion.y - columns["y"]).max()
        if apart > FAR:
            yield f"{name} is {apart:.6f} m apart"
    seen = result.criticality
    if seen is None:
        return
    measured = outcomes.measures
    for name, value in _at_once(seen).items():
        told_at_once = float(getattr(measured, name)[place])
        if not _alike(told_at_once, value):
            yield f"{name} is {told_at_once} instead of {value}"
    side = str(measured.side[place])
    if side != (seen.impact.side if seen.impact is not None else ""):
        yield f"the side that is touched is {side!r}"
    own = outcomes.criticality(place).summary
    for name, value in seen.summary.items():
        if not _alike(_number(own[name]), _number(value)):
            yield f"{name} is {_number(own[name])} instead of {_number(value)}"


def _at_once(seen: Criticality) -> dict[str, float]:
    """Measures of a run that arrays work out for all runs at once (`RunMeasures`)."""
    ttc, drac, distance = seen.ttc, seen.drac, seen.distance
    conflict = seen.conflict
    before = seen.risk_before("ad-rss", conflict, RISK_WINDOW) if conflict is not None else 0.0
    return {
        "min_ttc": float(ttc.value[ttc.valid].min(initial=math.inf)),
        "max_drac": float(drac.value[drac.valid].max(initial=0.0)),
        "min_distance": float(distance.value[distance.valid].min(initial=math.inf)),
        "risk": seen.risk("ad-rss") or 0.0,
        "risk_before": before,
        "impact_speed": seen.impact.speed if seen.impact is not None else 0.0,
        "striking": float(seen.impact is not None and seen.impact.striking),
    }


def _number(value: Any) -> float | None:
    return value["value"] if isinstance(value, dict) else value


def _alike(one: float | None, other: float | None) -> bool:
    if one is None or other is None:
        return one is other
    return math.isclose(one, other, rel_tol=RELATIVE, abs_tol=RELATIVE)


def compare(path: Path, settings: RunSettings, count: int, seed: int) -> tuple[int, list[str], str]:
    """Compare runs of a scenario or variation file in arrays with those of the interpreter.

    Returns:
        Number of compared runs, differences, and a line about the rest.
    """
    path, sets = scenario_of(path, count, seed)
    start = process_time()
    together = played(path, sets, settings)
    middle = process_time()
    found = []
    for number, (outcomes, place) in sorted(together.items()):
        result = runner.run(path, settings, parameters=sets[number])
        found += [f"{sets[number]}: {text}" for text in differences(outcomes, place, result)]
    times = f"{middle - start:.2f} s in arrays, {process_time() - middle:.2f} s one by one"
    return len(together), found, f"{len(sets) - len(together)} left to the interpreter; {times}"


def main() -> None:
    """Print a line for each scenario, and the sums."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    arguments.add_argument("folders", nargs="+")
    arguments.add_argument("--sets", type=int, default=0)
    arguments.add_argument("--seed", type=int, default=0)
    arguments.add_argument("--sut", default="none")
    arguments.add_argument("--road-path", action="append", default=[])
    options = arguments.parse_args()
    settings = RunSettings(
        world="kinematic", sut=options.sut, road_path=tuple(options.road_path), max_time=60.0
    )
    files = plays = compared = wrong = 0
    for path in runnable(options.folders):
        files += 1
        try:
            scenario, sets = scenario_of(path, 0, 0)
            reason = obstacle(scenario, settings, sets)
        except ToolchainError as error:
            reason = str(error)
        plays += not reason
        line = reason or "plays"
        if options.sets and not reason:
            runs, found, rest = compare(path, settings, options.sets, options.seed)
            compared, wrong = compared + runs, wrong + len(found)
            line = f"{runs} runs, {len(found)} differences, {rest}"
            line += "".join(f"\n    {each}" for each in found[:3])
        print(f"{path.stem:56} {line}", flush=True)
    print(f"{plays} of {files} files play in arrays; {compared} runs, {wrong} differences")
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
