"""The reference drivers on the cut-in grids that they were published with, against the published
implementation's collisions.

    python benchmarks/jrc_grids.py [--drivers NAME...] [--every N] [--processes N] [--world
    sumo|kinematic]

Every run is one of `xosc/library/r157_cut_in.xosc`, in steps of 0.1 s as there
(github.com/ec-jrc/JRC-FSM). A collision is a rear-end one where the middle of the ego is behind
that of the other. `--every` takes each N-th run only and scales the counts; N should be no multiple
of 2 or 3, as 18 lateral speeds vary fastest.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from functools import partial
from itertools import islice
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

import numpy as np

from runner.batch.jobs import Job, Outcome, failure
from runner.batch.pool import Pool
from runner.judging.execution import run
from runner.judging.settings import RunSettings

SCENARIO = Path(__file__).parents[1] / "xosc" / "library" / "r157_cut_in.xosc"
TIMESTEP = 0.1


class Grid(NamedTuple):
    """Speeds in km/h; the cut-in's go from 10 km/h up to the ego's in steps. Gaps in m."""

    ego_speeds: tuple[int, ...]
    step: int
    gaps: range


class Count(NamedTuple):
    """Collisions, and how many of them are rear-end ones."""

    all: float
    rear_end: float


GRIDS = {
    "high": Grid((70, 90, 110, 130), 30, range(1, 120, 2)),
    "low": Grid((10, 20, 30, 40, 50, 60), 10, range(1, 60)),
}
RAMPS = {
    round(speed, 1): len(np.arange(0.0, speed, 0.15)) for speed in np.arange(0.0, 1.8, 0.1).tolist()
}
"""Steps in which each lateral speed (m/s) is reached. The published grid lies a rounding error
above 0.3, 0.6 and 1.2 m/s, and its implementation takes a step more for these."""
PUBLISHED = {
    "r157-cc": {"high": Count(3552, 3146), "low": Count(3728, 3001)},
    "r157-reg": {"high": Count(2869, 2487), "low": Count(2252, 1606)},
    "rss": {"high": Count(1491, 1219), "low": Count(880, 628)},
    "fsm": {"high": Count(1649, 1437), "low": Count(901, 672)},
}
ACCOUNTABLE = {"r157-cc": "2"}
"""TTC (s) above which, when its lane is reached, the run is not the driver's to answer for: the
models' own criterion."""


def jobs(grid: Grid, driver: str) -> Iterator[Job]:
    """All runs of a grid."""
    accountable = {"Ego_AccountableTTC_s": ACCOUNTABLE[driver]} if driver in ACCOUNTABLE else {}
    for ego in grid.ego_speeds:
        for other in range(10, ego, grid.step):
            for gap in grid.gaps:
                for lateral, steps in RAMPS.items():
                    values = {
                        "Ego_Speed_kmh": ego,
                        "CutIn_Speed_kmh": other,
                        "CutIn_Gap_m": gap,
                        "CutIn_LateralSpeed_mps": lateral,
                    }
                    given = values | {"CutIn_Ramp_steps": steps} | accountable
                    parameters = {name: str(value) for name, value in given.items()}
                    yield Job("_".join(map(str, values.values())), SCENARIO, SCENARIO, parameters)


def drive(job: Job, options: RunSettings) -> Outcome:
    """One run; whether a collision is a rear-end one is its measure."""
    try:
        result = run(
            job.scenario,
            parameters=job.parameters,
            sut=options.sut,
            timestep=options.timestep,
            world=options.world,
        )
    except Exception as error:
        return failure(job, error)
    ego, other = (result.recording.tracks[name].columns["x"] for name in ("Ego", "CutIn"))
    collided = bool(result.verdict.failures)
    return Outcome(
        job,
        "failed" if collided else "passed",
        0,
        measures={"rear_end": collided and bool(ego[-1] <= other[-1])},
    )


def died(job: Job) -> Outcome:
    """The outcome of a run that took its process down."""
    return Outcome(job, "error", 5, "the process that ran it died")


def compare(pool: Pool, name: str, driver: str, every: int) -> None:
    """Run a grid and print its line."""
    start = perf_counter()
    outcomes = list(pool.execute(islice(jobs(GRIDS[name], driver), 0, None, every)))
    seconds = perf_counter() - start
    errors = [outcome for outcome in outcomes if outcome.state == "error"]
    if errors:
        raise SystemExit(
            f"{len(errors)} runs failed, the first: {errors[0].job.name}: {errors[0].message}"
        )
    total = sum(1 for _ in jobs(GRIDS[name], driver))
    scale = total / len(outcomes)
    found = Count(
        scale * sum(outcome.state == "failed" for outcome in outcomes),
        scale * sum(outcome.measures["rear_end"] for outcome in outcomes),
    )
    known = PUBLISHED[driver][name]
    off = f"{found.all / known.all - 1:+.1%} ({found.rear_end / known.rear_end - 1:+.1%})"
    print(
        f"{driver:<9}{name:<5}{len(outcomes):>6} of {total} runs: {found.all:6.0f} collisions "
        f"({found.rear_end:.0f} rear-end), "
        f"published {known.all} ({known.rear_end}): {off}, "
        f"{seconds:.0f} s, {len(outcomes) / seconds:.0f} runs a second",
        flush=True,
    )


def main() -> None:
    """Print collisions of each driver on each grid."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    arguments.add_argument("--drivers", nargs="+", choices=PUBLISHED, default=list(PUBLISHED))
    arguments.add_argument("--every", type=int, default=1, metavar="N")
    arguments.add_argument("--processes", type=int, default=2)
    arguments.add_argument("--world", default="sumo")
    options = arguments.parse_args()
    for driver in options.drivers:
        with Pool(
            options.processes,
            partial(drive, options=RunSettings(TIMESTEP, driver, world=options.world)),
            died,
        ) as pool:
            for name in GRIDS:
                compare(pool, name, driver, options.every)


if __name__ == "__main__":
    main()
