"""Decisions a second of each system under test: asked for one run, and for many runs at once.

    python -m benchmarks.controls [--runs N] [--others P] [--seconds S] [SYSTEM ...]

Runs are those of an ego behind so many vehicles on three lanes, each at another distance and speed.
Processor time of one process counts. The shares are of decisions with an acceleration.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from time import process_time

import numpy as np

from runner.engine.participants.declaration import BoundingBox
from runner.engine.worlds.surroundings import Environment
from runner.systems import Observation, Participant, load_system
from runner.systems.array_systems import open_arrays
from runner.systems.arrays import stack

SYSTEMS = ("cas", "adas", "aeb", "idm", "rss", "fsm", "r157-cc", "r157-reg")
CAR = BoundingBox(1.4, 0.0, 0.75, 4.5, 1.8, 1.5)
DT = 0.05


def situation(rng: np.random.Generator, others: int) -> Observation:
    """An ego, and others ahead of it."""

    def car(name: str, x: float, y: float, speed: float) -> Participant:
        h = float(rng.normal(0.0, 0.01))
        return Participant(
            name, "vehicle", "car", CAR, x=x, y=y, h=h, speed=speed, vx=speed * math.cos(h),
            vy=speed * math.sin(h)
        )  # fmt: skip

    around = [
        car(
            f"V{number}",
            float(rng.uniform(8.0, 40.0 + 40.0 * number)),
            3.5 * int(rng.integers(-1, 2)),
            float(rng.uniform(15.0, 30.0)),
        )
        for number in range(others)
    ]
    ego = car("Ego", 0.0, 0.0, 27.0)
    return Observation(0.0, ego, around, 27.0, None, Environment())


def rate(once: Callable[[], int], seconds: float) -> float:
    """Decisions a second of a function that returns the number of those it makes."""
    once()
    count, start = 0, process_time()
    while process_time() - start < seconds:
        count += once()
    return count / (process_time() - start)


def main() -> None:
    """Print decisions a second by system."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    arguments.add_argument("systems", nargs="*", default=SYSTEMS)
    arguments.add_argument("--runs", type=int, default=4096)
    arguments.add_argument("--others", type=int, default=2)
    arguments.add_argument("--seconds", type=float, default=1.0)
    options = arguments.parse_args()
    rng = np.random.default_rng(0)
    many = [situation(rng, options.others) for _ in range(options.runs)]
    stacked, seeds = stack(many), np.arange(options.runs)
    for name in options.systems:
        single, arrays = load_system(name), open_arrays(name)
        assert single is not None and arrays is not None

        def one_by_one(system=single) -> int:  # type: ignore[no-untyped-def]
            system.reset(many[0].ego, DT, 0)
            for each in many[:500]:
                system.control(each, DT)
            return 500

        def together(system=arrays) -> int:  # type: ignore[no-untyped-def]
            return len(system.control(stacked, DT).acceleration)

        arrays.reset(stacked.ego, DT, seeds)
        share = float(arrays.control(stacked, DT).accelerates.mean())
        alone, at_once = rate(one_by_one, options.seconds), rate(together, options.seconds)
        print(
            f"{name:<9} {alone:10,.0f} a second one by one, {at_once:11,.0f} at once"
            f" ({at_once / alone:.1f} times), {share:.0%} intervene",
            flush=True,
        )
        arrays.close()


if __name__ == "__main__":
    main()
