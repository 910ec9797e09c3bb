"""Problem of finding failures: a scenario with its prior and its plays in arrays, run on SUMO."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from generation.search.outcomes import Evaluator, Outcomes
from generation.search.plays import ArrayPlays
from generation.search.problem import Realism, Reward, SearchProblem
from generation.search.settings import Ask
from generation.search.variations import asked_of
from generation.space.density.models import DEFAULT, JUDGE
from generation.space.space import Space
from runner.judging.settings import RunSettings
from schemas.common.array_types import FloatArray
from schemas.common.errors import Unsupported


class Posed(NamedTuple):
    """Problem, and an evaluator that runs its scenario on SUMO with any system under test."""

    problem: SearchProblem
    sumo: Evaluator

    def plays(self, theta: FloatArray, sut: str | None = None) -> Outcomes:
        """Outcomes of points (n, d): in arrays if scenario and system play so,
        on SUMO otherwise.
        """
        if self.problem.plays is not None:
            try:
                return self.problem.plays(theta, sut)
            except Unsupported:
                pass
        return self.sumo(theta, sut)


@contextmanager
def posed(
    path: Path,
    sut: str,
    processes: int,
    recorded: Path | None = None,
    kind: str | None = None,
    timestep: float = RunSettings.timestep,
    free: Sequence[str] = (),
) -> Iterator[Posed]:
    """Pose the problem of a logical scenario, or of a variation file, as the product does; the
    reward is the published one.

    Args:
        sut: name of the system under test.
        processes: how many runs at a time.
        recorded: recordings, or a table of their units; None for our own.
        kind: of the recorded units; None for that of the scenario's name.
        timestep: s.
        free: parameters, with their ranges, to search besides, as `--free` of the product.

    Raises:
        UsageError: there is no such system, or nothing says which values are likely.
    """
    asked, run = (
        asked_of(Ask(recorded, kind, free=free), path),
        RunSettings(sut=sut, timestep=timestep),
    )
    scenario = asked.scenario
    space = Space.of(scenario, asked.choice)
    units = asked.recorded(space)
    real = units.within(space)
    reward = Reward(Realism.fitted(DEFAULT, real.theta, real.recordings))
    try:
        plays = ArrayPlays(scenario, space, run, fast=False)
    except Unsupported:
        plays = None
    with Evaluator(scenario, space, run=run, processes=processes) as sumo:
        yield Posed(
            SearchProblem(space, sumo, reward, real.theta, None, units.prior(space, JUDGE), plays),
            sumo,
        )
