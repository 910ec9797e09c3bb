"""The problem of finding failures: a scenario with its prior and its twin, run on SUMO."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from generation.density.models import DEFAULT, JUDGE
from generation.outcomes.outcomes import Evaluator, Outcomes, joined
from generation.recorded import kind_of, of_recordings, of_samples
from generation.search.problem import BATCH, History, Problem, Realism, Reward, Search
from generation.search.screen import Screen
from generation.search.space import Space
from generation.twin.episodes import Twin
from runner.settings import RunSettings
from schemas.common.array_types import FloatArray
from schemas.common.errors import Unsupported, UsageError


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


LEAST = 0.05
"""Distance from which failures differ, as that of quality-diversity search"""


def screened(search: Search, proposals: int) -> Search:
    """The method, with a budget of proposals; it ends before, once the runs are spent.

    What is not worth a try is answered as a scenario in which nothing happens, the rest by the twin. Without a twin, the most
    promising proposals are run, as many as the budget has for so many proposals, the rest is answered by the run most like it.

    Args:
        proposals: points that the method may propose at most.
    """

    def searching(problem: Problem, budget: int, seed: int) -> History:
        answers = _Answers(Screen(problem, budget, LEAST, pace=proposals / budget))
        with suppress(_Spent):
            search(replace(problem, evaluate=answers), proposals, seed)
        answers.screen.spend()
        return answers.screen.history

    return searching


class _Spent(Exception):
    """The runs are spent, whatever the method had in mind."""


class _Answers:
    """Answers a method's proposals."""

    def __init__(self, screen: Screen) -> None:
        self.screen = screen

    def __call__(self, theta: FloatArray) -> Outcomes:
        screen = self.screen
        if not screen.left:
            raise _Spent
        tried = np.flatnonzero(screen.worth(theta))
        found = np.arange(len(theta))
        found[tried] = len(theta) + np.arange(len(tried))
        outcomes = screen.attempt(theta[tried]).outcomes if len(tried) else Outcomes.of(0)
        if screen.waiting >= min(BATCH, screen.left):
            screen.spend()
        return joined([Outcomes.of(len(theta)), outcomes]).take(found)
