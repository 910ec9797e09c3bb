"""Cost of an episode of the search: as many as a search has, in several processes, and where the
time of one goes.

    python benchmarks/episodes.py [SCENARIO] [--episodes N] [--processes N] [--timestep S]
    python benchmarks/episodes.py [SCENARIO] --plays N [--sut NAME] [--processes N]

Points are drawn uniformly from the scenario's parameter space. The parts are measured in one
process by a clock of its processor time around each of them; the clock itself costs a little, which
is in the rest.
"""

from __future__ import annotations

import argparse
import os
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np

import xosc
from generation.search.outcomes import Evaluator
from generation.search.plays import ArrayPlays
from generation.space.space import Space
from runner.engine.storyboard.simulation import Simulation
from runner.engine.worlds.sumo import SumoWorld
from runner.judging import execution
from runner.judging.measures import criticality
from runner.judging.settings import RunSettings
from runner.recording import Recorder

SCENARIO = Path(__file__).parents[1] / "xosc" / "library" / "cut_in_highway.xosc"
PARTS: tuple[tuple[Any, str, str], ...] = (
    (xosc, "resolve", "resolve (a copy of the parsed file, its parameters, catalogues)"),
    (execution, "compile_scenario", "compile"),
    (SumoWorld, "open", "SUMO network"),
    (SumoWorld, "begin", "SUMO start, where it drives somebody"),
    (SumoWorld, "close", "SUMO end"),
    (Simulation, "tick", "steps"),
    (Recorder, "record", "recording, each step"),
    (criticality, "of_recording", "criticality"),
)
WITHIN = {"recording, each step": "steps"}
"""Parts of other parts"""


class Clock:
    """Adds up the processor time spent in functions, by name."""

    def __init__(self) -> None:
        self.total: dict[str, float] = defaultdict(float)

    def around(self, owner: Any, function: str, name: str) -> None:
        """Replace a function by one that is timed."""
        original: Callable[..., Any] = getattr(owner, function)

        def timed(*args: Any, **settings: Any) -> Any:
            start = process_time()
            try:
                return original(*args, **settings)
            finally:
                self.total[name] += process_time() - start

        setattr(owner, function, timed)


def whole(scenario: Path, space: Space, theta: np.ndarray, timestep: float, processes: int) -> None:
    """Run all episodes as a search does."""
    start = perf_counter()
    with Evaluator(
        scenario, space, run=RunSettings(timestep=timestep), processes=processes
    ) as evaluator:
        found = evaluator(theta)
    seconds = perf_counter() - start
    rate = len(theta) / seconds
    print(
        f"{len(theta)} episodes, {processes} processes, {timestep} s a step: {seconds:.1f} s, "
        f"{rate:.0f} a second"
    )
    print(
        f"    {found.end_time.mean():.1f} simulated s each, {(~found.executed).sum()} errors, "
        f"{found.collision.sum()} collisions"
    )
    print(f"    mean R_risk {found.r_risk.mean():.3f}")


def parts(scenario: Path, space: Space, theta: np.ndarray, timestep: float) -> None:
    """Print where the time of an episode goes."""
    clock = Clock()
    for owner, function, name in PARTS:
        clock.around(owner, function, name)
    execution.run(
        scenario, parameters={**space.pinned, **space.values(theta[0])}, timestep=timestep
    )  # fills the caches
    clock.total.clear()
    start = process_time()
    for row in theta:
        result = execution.run(
            scenario, parameters={**space.pinned, **space.values(row)}, timestep=timestep
        )
        assert result.criticality is not None
    seconds = (process_time() - start) / len(theta)
    print(f"one episode: {seconds * 1e3:.1f} ms of processor time")
    for name, spent in clock.total.items():
        print(f"    {spent / len(theta) * 1e3:6.2f} ms  {name}")
    outer = sum(spent for name, spent in clock.total.items() if name not in WITHIN)
    print(f"    {(seconds - outer / len(theta)) * 1e3:6.2f} ms  rest")


def played(
    scenario: Path, space: Space, theta: np.ndarray, timestep: float, sut: str, processes: int
) -> None:
    """Play all points in arrays."""
    run = RunSettings(timestep=timestep, sut=sut)
    play = ArrayPlays(scenario, space, run, fast=False, processes=processes)
    start, clock = _processor_time(), perf_counter()
    found = play(theta)
    spent, seconds = _processor_time() - start, perf_counter() - clock
    print(
        f"{len(theta)} plays with {sut}, {processes} processes: "
        f"{len(theta) / spent:.0f} a second of "
        f"processor time, {len(theta) / seconds:.0f} by the clock"
    )
    print(f"    {found.end_time.mean():.1f} simulated s each, {found.collision.sum()} collisions")


def _processor_time() -> float:
    """Processor time of this process and of its ended children, s."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def main() -> None:
    """Print the cost of a search's episodes."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    arguments.add_argument("scenario", type=Path, nargs="?", default=SCENARIO)
    arguments.add_argument("--episodes", type=int, default=3000)
    arguments.add_argument("--processes", type=int, default=2)
    arguments.add_argument("--timestep", type=float, default=0.05, help="s")
    arguments.add_argument("--plays", type=int, default=0)
    arguments.add_argument("--sut", default="cas")
    options = arguments.parse_args()
    space = Space.of(options.scenario)
    if options.plays:
        theta = space.draw(options.plays, np.random.default_rng(0))
        played(options.scenario, space, theta, options.timestep, options.sut, options.processes)
        return
    theta = space.draw(options.episodes, np.random.default_rng(0))
    whole(options.scenario, space, theta, options.timestep, options.processes)
    parts(options.scenario, space, theta[:100], options.timestep)


if __name__ == "__main__":
    main()
