"""What is worth a run: points that are foreseeable, unlike all failures that are known, and, where there is a twin, fail there in
a way that a careful driver prevents. It costs no simulation. Without a twin, what the runs so far make likely to fail is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from generation.outcomes.outcomes import Outcomes
from generation.outcomes.references import survivors
from generation.search.diversity import apart, distinctive, diverse
from generation.search.problem import Calls, History, Plays, Problem
from generation.search.surrogate import FEW, ROUND, Surrogate
from schemas.errors import UsageError
from xodr.array_types import BoolArray, FloatArray, IntArray

PACE = 96.0
"""Points asked about for each run, without a twin"""


class Tried(NamedTuple):
    """What came of points.

    Attributes:
        outcomes: of all of them.
        tried: which the twin has played or, without one, a run; the others have the outcome of the run that is most like them.
        failing: which of these failed.
        runs: how many are run, or wait for a run.
    """

    outcomes: Outcomes
    tried: BoolArray
    failing: BoolArray
    runs: int


class Screen:
    """Spends the runs of a search on what is worth one.

    Args:
        problem: what is searched.
        budget: runs.
        least: distance of two failures in the unit cube, root mean square over the parameters that are no nuisances.
        twin: whether the twin is used where there is one.
        pace: points asked about for each run, without a twin: of so many the one most likely to fail is run.

    Attributes:
        played: points that the twin has played with the system under test.

    Raises:
        UsageError: the problem has no prior.
    """

    def __init__(self, problem: Problem, budget: int, least: float, twin: bool = True, pace: float = PACE) -> None:
        if problem.prior is None:
            raise UsageError("this search needs a prior of what is foreseeable")
        self._prior, self._space, self._least, self._budget = problem.prior, problem.space, least, budget
        self._calls, self.twin = Calls(problem, budget), problem.twin if twin else None
        self._told = distinctive(problem.space)
        self._known = self._unit(problem.found if problem.found is not None else np.empty((0, len(problem.space.parameters))))
        self._waiting: list[FloatArray] = []
        self._surrogate, self._pace, self._asked = Surrogate(), pace, 0
        self.played = 0

    @property
    def left(self) -> int:
        """Runs that are not spent."""
        return self._calls.left

    @property
    def spent(self) -> float:
        """Share of the runs that is spent."""
        return 1.0 - self._calls.left / self._budget

    @property
    def waiting(self) -> int:
        """New failures of the twin that wait for a run."""
        return sum(map(len, self._waiting))

    @property
    def history(self) -> History:
        """All runs so far."""
        return self._calls.history

    def worth(self, theta: FloatArray) -> BoolArray:
        """Points (n, d) that are foreseeable and unlike all known failures: (n,)."""
        self._asked += len(theta)
        found = self._novel(theta)
        found[found] = self._prior.foreseeable(theta[found])
        return found

    def attempt(self, theta: FloatArray) -> Tried:
        """Play points (n, d) on the twin, where new failures then wait for a run; without one, run the most promising."""
        return self._run(theta) if self.twin is None else self._play(theta, self.twin)

    def _play(self, theta: FloatArray, twin: Plays) -> Tried:
        self.played += len(theta)
        outcomes = twin(theta)
        failing = outcomes.collision & outcomes.executed
        failing[failing] = survivors(theta[failing], twin)
        fresh = self._learn(theta, failing)
        if len(fresh):
            self._waiting.append(fresh)
        return Tried(outcomes, np.ones(len(theta), bool), failing, len(fresh))

    def _run(self, theta: FloatArray) -> Tried:
        unit, tried = self._unit(theta), np.zeros(len(theta), bool)
        most = min(max(round(self._asked / self._pace), FEW) - len(self._surrogate), self.left)
        while most > 0 and len(chosen := self._promising(unit, tried, min(most, ROUND))):
            found = self._calls(theta[chosen]).outcomes
            self._surrogate.learn(unit[chosen], found)
            self._learn(theta[chosen], found.collision & found.executed)
            tried[chosen], most = True, most - len(chosen)
        outcomes = self._surrogate.alike(unit)
        return Tried(outcomes, tried, tried & outcomes.collision & outcomes.executed, int(tried.sum()))

    def _promising(self, unit: FloatArray, tried: BoolArray, most: int) -> IntArray:
        """Indices of points (n, k) nearest to a failure, `most` or less, unlike known failures, those tried, and each other."""
        left = np.flatnonzero(apart(unit, np.concatenate([self._known, unit[tried]]), self._least))
        ranked = left[self._surrogate.ranked(unit[left])]
        return ranked[diverse(unit[ranked], self._least, most)]

    def _learn(self, theta: FloatArray, failing: BoolArray) -> FloatArray:
        """The new failures (m, d) among points (n, d), known from now on."""
        fresh = theta[failing]
        fresh = fresh[self._novel(fresh)]
        fresh = fresh[diverse(self._unit(fresh), self._least)]
        self._known = np.concatenate([self._known, self._unit(fresh)])
        return fresh

    def spend(self) -> None:
        """Run what waits, as far as the budget goes."""
        if self._waiting and self._calls.left:
            self._calls(np.concatenate(self._waiting))
        self._waiting = []

    def _unit(self, theta: FloatArray) -> FloatArray:
        return self._space.unit(theta)[:, self._told]

    def _novel(self, theta: FloatArray) -> BoolArray:
        return apart(self._unit(theta), self._known, self._least)
