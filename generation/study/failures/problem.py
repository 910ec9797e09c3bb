"""The problem of finding failures: a scenario with its prior and its twin, run on SUMO."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from generation.density.model import DEFAULT, JUDGE
from generation.outcomes.evaluator import Evaluator
from generation.outcomes.outcomes import Outcomes
from generation.recorded import kind_of, of_recordings, of_samples
from generation.search.problem import Plays, Problem
from generation.search.reward import Realism, Reward
from generation.search.space import Space
from generation.twin.episodes import Twin
from runner.settings import RunSettings
from schemas.errors import Unsupported, UsageError
from xodr.array_types import FloatArray


class Posed(NamedTuple):
    """A problem, and what runs its scenario on SUMO with any system under test."""

    problem: Problem
    sumo: Evaluator

    def on_twin(self) -> Posed:
        """The same with runs on the twin; SUMO judges what is found.

        Raises:
            UsageError: the scenario has no twin.
        """
        if self.problem.twin is None:
            raise UsageError("this scenario has no twin to search on")
        return self._replace(problem=replace(self.problem, evaluate=self.problem.twin))

    def without_twin(self) -> Posed:
        """The same with nothing to screen proposals but the prior: every trial is a run on SUMO."""
        return self._replace(problem=replace(self.problem, twin=None))


class Counting:
    """A twin that counts what it plays with the system under test."""

    def __init__(self, twin: Plays) -> None:
        self._twin, self.played = twin, 0

    def __call__(self, theta: FloatArray, sut: str | None = None) -> Outcomes:
        """The outcomes at points (n, d)."""
        self.played += len(theta) if sut is None else 0
        return self._twin(theta, sut)


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
