"""What is worth a run: points that are foreseeable, unlike all failures that are known, and, where there is a twin, fail there in
a way that a careful driver prevents. It costs no simulation."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from generation.outcomes.outcomes import Outcomes
from generation.outcomes.references import survivors
from generation.search.diversity import apart, distinctive, diverse
from generation.search.problem import Calls, History, Problem
from schemas.errors import UsageError
from xodr.array_types import BoolArray, FloatArray


class Tried(NamedTuple):
    """Of points: what came of them, which of them failed, and how many of these are new."""

    outcomes: Outcomes
    failing: BoolArray
    new: int


class Screen:
    """Spends the runs of a search on what is worth one.

    Args:
        problem: what is searched.
        budget: runs.
        least: distance of two failures in the unit cube, root mean square over the parameters that are no nuisances.
        twin: whether the twin is used where there is one; without it, runs are spent on the points themselves.

    Attributes:
        played: points that the twin has played with the system under test.

    Raises:
        UsageError: the problem has no prior.
    """

    def __init__(self, problem: Problem, budget: int, least: float, twin: bool = True) -> None:
        if problem.prior is None:
            raise UsageError("this search needs a prior of what is foreseeable")
        self._prior, self._space, self._least, self._budget = problem.prior, problem.space, least, budget
        self._calls, self.twin = Calls(problem, budget), problem.twin if twin else None
        self._told = distinctive(problem.space)
        self._known = self._unit(problem.found if problem.found is not None else np.empty((0, len(problem.space.parameters))))
        self._waiting: list[FloatArray] = []
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
        found = self._novel(theta)
        found[found] = self._prior.foreseeable(theta[found])
        return found

    def attempt(self, theta: FloatArray) -> Tried:
        """Play points (n, d), on the twin where there is one; new failures then wait for a run."""
        if self.twin is None:
            theta = theta[: self.left]
            outcomes = self._calls(theta).outcomes
            failing = outcomes.collision & outcomes.executed
        else:
            self.played += len(theta)
            outcomes = self.twin(theta)
            failing = outcomes.collision & outcomes.executed
            failing[failing] = survivors(theta[failing], self.twin)
        fresh = np.flatnonzero(failing)
        fresh = fresh[self._novel(theta[fresh])]
        fresh = fresh[diverse(self._unit(theta[fresh]), self._least)]
        self._known = np.concatenate([self._known, self._unit(theta[fresh])])
        if self.twin is not None and len(fresh):
            self._waiting.append(theta[fresh])
        return Tried(outcomes, failing, len(fresh))

    def spend(self) -> None:
        """Run what waits, as far as the budget goes."""
        if self._waiting and self._calls.left:
            self._calls(np.concatenate(self._waiting))
        self._waiting = []

    def _unit(self, theta: FloatArray) -> FloatArray:
        return self._space.unit(theta)[:, self._told]

    def _novel(self, theta: FloatArray) -> BoolArray:
        return apart(self._unit(theta), self._known, self._least)
