"""The problem of finding failures: a scenario with its prior and its twin, run on SUMO."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from generation.density.models import DEFAULT, JUDGE
from generation.outcomes.outcomes import Evaluator
from generation.recorded import kind_of, of_recordings, of_samples
from generation.search.problem import Problem, Realism, Reward
from generation.search.space import Space
from generation.twin.episodes import Twin
from runner.settings import RunSettings
from schemas.common.errors import Unsupported


class Posed(NamedTuple):
    """A problem, and what runs its scenario on SUMO with any system under test."""

    problem: Problem
    sumo: Evaluator


@contextmanager
def posed(scenario: Path, sut: str, processes: int, recorded: Path | None = None, kind: str | None = None) -> Iterator[Posed]:
    """The problem of a logical scenario: foreseeable is what `JUDGE` says, as in the product; the reward is the published one.

    Args:
        sut: name of the system under test.
        processes: how many runs at a time.
        recorded: recordings, or a table of their units; None for our own.
        kind: of the recorded units; None for that of the scenario's name.

    Raises:
        UsageError: there is no such system, or recordings say nothing of the scenario.
    """
    space, run = Space.of(scenario), RunSettings(sut=sut)
    units = of_samples(of_recordings(recorded, kind or kind_of(scenario)), space)
    real = units.within(space)
    reward = Reward(Realism.fitted(DEFAULT, real.theta, real.recordings))
    try:
        twin = Twin(scenario, space, run)
    except Unsupported:
        twin = None
    with Evaluator(scenario, space, run=run, processes=processes) as sumo:
        yield Posed(Problem(space, sumo, reward, real.theta, None, units.prior(space, JUDGE), twin), sumo)
