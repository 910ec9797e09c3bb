"""Screen before the simulator: points that are foreseeable, unlike known failures, and fail preventably on the twin.

The screen costs no simulation. Without a twin, a forest grown on the runs so far ranks points by nearness to a failure.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.distance import cdist

from generation.outcomes.judges import survivors
from generation.outcomes.outcomes import Outcomes, joined
from generation.search.problem import Calls, History, Plays, Problem
from generation.search.space import apart, distinctive, diverse
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from schemas.common.errors import UsageError
from schemas.common.packages import optional

_FAR, _HARD = 5.0, 8.0
"""Clearance (m) at which its margin counts 1/e, and DRAC (m/s²) at which nothing is left of its own"""
_CLEAR, _BRAKED = 0.1, 0.8
"""Weights of the margins: vehicles that pass each other in two lanes are close, and far from a collision"""


def nearness(outcomes: Outcomes) -> FloatArray:
    """By both margins, least clearance and greatest DRAC (n,), 0 to below 1; 0 where no run took place."""
    near = _CLEAR * np.exp(-np.minimum(outcomes.clearance, 1e3) / _FAR) + _BRAKED * np.minimum(outcomes.max_drac / _HARD, 1.0)
    return np.where(outcomes.executed, near, 0.0)


_TREES = 100
FEW = 60
"""Runs from which points are ranked"""
ROUND = 20
"""Runs after which the forest is grown anew"""
_NEAR = 0.1
"""Weight of the nearest miss relative to a failure: it leads to the first failures, and matters little afterwards"""


class Surrogate:
    """Predictions at points x (n, k) of the unit cube, from what runs gave.

    Raises:
        MissingExtra: scikit-learn is not installed.
    """

    def __init__(self) -> None:
        self._ensemble = optional("sklearn.ensemble")
        self._x, self._outcomes = list[FloatArray](), list[Outcomes]()
        self._forest: Any = None
        self._grown = 0

    def __len__(self) -> int:
        """Number of runs that it has learnt from."""
        return sum(map(len, self._outcomes))

    def learn(self, x: FloatArray, outcomes: Outcomes) -> None:
        """Take what runs at points (n, k) gave."""
        self._x.append(x)
        self._outcomes.append(outcomes)

    def ranked(self, x: FloatArray) -> IntArray:
        """Indices of points (n, k), those that come nearest to a failure first; in their order while there are few runs."""
        return np.argsort(-self.predicted(x), kind="stable")

    def predicted(self, x: FloatArray) -> FloatArray:
        """Predicted failure (n,) at points (n, k), from 0 to 1; 0 while there are few runs."""
        if len(self) < FEW or not len(x):
            return np.zeros(len(x))
        if self._forest is None or len(self) >= self._grown + ROUND:
            self._grow()
        found: FloatArray = self._forest.predict(differences(x))
        return found

    def _grow(self) -> None:
        outcomes = joined(self._outcomes)
        failing = outcomes.collision & outcomes.executed
        scores, x = np.where(failing, 1.0, _NEAR * nearness(outcomes)), np.concatenate(self._x)
        forest, rows = self._ensemble.ExtraTreesRegressor(_TREES, random_state=0), _learnt(failing)
        self._forest, self._grown = forest.fit(differences(x[rows]), scores[rows]), len(self)

    def alike(self, x: FloatArray) -> Outcomes:
        """Return the outcomes of the most similar runs to points (n, k); uneventful while there are no runs."""
        if not len(self):
            return Outcomes.of(len(x))
        return joined(self._outcomes).take(np.argmin(cdist(x, np.concatenate(self._x)), axis=1))


def _learnt(failing: BoolArray) -> IntArray:
    """Indices of the runs (n,) that a forest learns from: all, or evenly chosen ones of failures and of others."""
    if len(failing) <= _MOST:
        return np.arange(len(failing))
    groups = [np.flatnonzero(failing), np.flatnonzero(~failing)]
    least = min(_MOST // 2, *map(len, groups))
    chosen = [each[np.linspace(0, len(each) - 1, min(len(each), _MOST - least)).astype(int)] for each in groups]
    return np.sort(np.concatenate(chosen))


_MOST = 10_000
"""Runs that a forest learns from: its memory does not grow with the runs"""


def differences(x: FloatArray) -> FloatArray:
    """Coordinates (n, k) and the differences of each two: a tree splits by one value, a failure depends on relative speeds."""
    one, other = np.triu_indices(x.shape[1], 1)
    return np.hstack([x, x[:, one] - x[:, other]])


PACE = 96.0
"""Points asked about for each run, without a twin"""


class Tried(NamedTuple):
    """Outcomes of points.

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
