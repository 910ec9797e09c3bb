"""Coverage search: a quarter of the runs are draws of the density, the others cover the probability that is expected to fail.

A guided run is chosen by what it is expected to reveal: its own predicted failure, times the predicted failures among draws of
the density around it that are near no known failure. What is covered counts no more, so that no finding starves another one,
and what traffic does more often counts more. Without a twin two models predict, each for half of the guided runs, so that what
one cannot see does not starve the other: a forest, in which near misses have a small share, and a Gaussian process, which also
expects failures where no run was. With a twin it is its verdict, less where no careful driver prevents the failure.

G. L. Nemhauser, L. A. Wolsey, M. L. Fisher, An analysis of approximations for maximizing submodular set functions, 1978 (the
greedy choice of what covers most).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.spatial.distance import cdist

from generation.density.prior import Prior
from generation.outcomes.judges import survivors
from generation.search.problem import BATCH, Calls, History, Plays, SearchProblem
from generation.search.space import apart, distinctive
from generation.search.surrogate import Forest, Frame, GaussianProcess
from schemas.common.array_types import FloatArray, IntArray
from schemas.common.errors import UsageError

METHODS = {
    "cover": {
        "title": "**coverage**",
        "meaning": "draws of the density, and runs that cover what is expected to fail and ask where failures begin",
        "realistic": True,
    },
    "draws": {"title": "draws of the density", "meaning": "draws of the density alone", "realistic": True},
}


@dataclass(frozen=True)
class CoverSettings:
    """Parameters of the search.

    Attributes:
        batch: runs of a round, and the share of the budget that they are where that is more.
        first: runs that explore before the first guided one, without a twin.
        explored: share of the runs that explores.
        radius: distance in the unit cube, root mean square over the parameters that tell cases apart, up to which a failure
            covers others.
        least: distance from all runs that a guided run keeps.
        drawn: draws of the density that are guided runs' candidates in a round, and as many that stand for traffic.
        stepped: further candidates: steps from known failures.
        step: standard deviation of steps, in whitened coordinates.
        played: draws in the place of `drawn` that stand for traffic, with a twin.
        unpreventable: weight of a failure that no careful driver prevents, with a twin.
    """

    batch: tuple[int, float] = 40, 0.02
    first: int = 60
    explored: float = 0.25
    radius: float = 0.08
    least: float = 0.03
    drawn: int = 1200
    stepped: int = 400
    step: float = 0.4
    played: int = 16_384
    unpreventable: float = 0.2


def draws(problem: SearchProblem, budget: int, seed: int) -> History:
    """Draws of the density.

    Raises:
        UsageError: the problem has no prior.
    """
    prior, calls, generator = _prior_of(problem), Calls(problem, budget), np.random.default_rng(seed)
    while calls.left:
        calls(prior.sample(min(BATCH, calls.left), generator))
    return calls.history


def cover(problem: SearchProblem, budget: int, seed: int, settings: CoverSettings = CoverSettings()) -> History:
    """Spend the budget.

    Raises:
        UsageError: the problem has no prior.
    """
    return _Search(problem, _prior_of(problem), budget, seed, settings).run()


def _prior_of(problem: SearchProblem) -> Prior:
    if problem.prior is None:
        raise UsageError("this search needs a prior of what is foreseeable")
    return problem.prior


Predict = Callable[[FloatArray], FloatArray]
"""Predicted failure (n,) of points (n, d), from 0 to 1"""


class _Search:
    """A search under way."""

    def __init__(self, problem: SearchProblem, prior: Prior, budget: int, seed: int, settings: CoverSettings) -> None:
        self._calls, self._prior, self._space, self._settings = Calls(problem, budget), prior, problem.space, settings
        self._generator = np.random.default_rng(seed)
        self._frame, self._told = Frame.of(problem.space, prior, self._generator), distinctive(problem.space)
        self._reach = float(np.sqrt(self._told.sum()))
        least, share = settings.batch
        self._batch = max(least, round(share * budget))
        self._theta = np.empty((0, len(problem.space.parameters)))
        self._failures = self._theta if problem.found is None else problem.found
        self._forest, self._process = Forest(), GaussianProcess(_HELD)
        self._twin = problem.twin
        self._traffic = prior.sample(settings.drawn if self._twin is None else settings.played, self._generator)
        self._chance: FloatArray | None = None
        self._emitters: list[Predict] = [
            lambda theta: self._forest.failing(self._unit(theta)),
            lambda theta: self._process.failing(self._frame.coordinates(theta)),
        ]
        if self._twin is not None:
            verdicts = partial(self._verdicts, self._twin)
            chance = verdicts(self._traffic)
            self._traffic, self._chance, self._emitters = self._traffic[chance > 0.0], chance[chance > 0.0], [verdicts]

    def run(self) -> History:
        """Search."""
        if self._twin is None:
            self._spend(self._prior.sample(self._settings.first, self._generator))
        while self._calls.left:
            runs = min(self._batch, self._calls.left)
            guided = self._guided(runs - round(self._settings.explored * runs))
            explored = self._prior.sample(runs - len(guided), self._generator)
            self._spend(np.concatenate([explored, guided]))
        return self._calls.history

    def _spend(self, theta: FloatArray) -> None:
        """Run points (n, d)."""
        found = self._calls(theta)
        self._theta = np.concatenate([self._theta, found.theta])
        self._failures = np.concatenate([self._failures, found.theta[found.outcomes.collision & found.outcomes.executed]])
        if self._twin is None:
            self._forest.learn(self._unit(found.theta), found.outcomes)
            self._process.learn(self._frame.coordinates(found.theta), found.outcomes)

    def _guided(self, n: int) -> FloatArray:
        """Points (n, d), or fewer: each emitter chooses its part of them among what those before it have left."""
        theta, parts = self._candidates(), list[FloatArray]()
        theta = theta[self._prior.foreseeable(theta)]
        theta = self._unlike(theta, self._theta)
        for left, emitter in zip(range(len(self._emitters), 0, -1), self._emitters, strict=True):
            parts.append(self._covering(theta, emitter, (n - sum(map(len, parts))) // left))
            theta = self._unlike(theta, parts[-1])
        return np.concatenate(parts)

    def _covering(self, theta: FloatArray, emitter: Predict, n: int) -> FloatArray:
        """The points (n, d), or fewer, among candidates that together are expected to reveal most."""
        worth, traffic = emitter(theta), self._unit(self._traffic)
        theta, worth = theta[worth > 0.0], worth[worth > 0.0]
        chance = emitter(self._traffic) if self._chance is None else self._chance
        left = np.where(apart(traffic, self._unit(self._failures), self._settings.radius), chance, 0.0)
        return theta[self._most(self._unit(theta), worth, traffic, left, n)]

    def _candidates(self) -> FloatArray:
        """Draws of the density, and steps from failures that are known or that the twin has (m, d)."""
        drawn = self._prior.sample(self._settings.drawn, self._generator)
        parents = self._failures if self._chance is None else np.concatenate([self._failures, self._traffic])
        if not len(parents):
            return drawn
        start = self._frame.coordinates(parents[self._generator.integers(len(parents), size=self._settings.stepped)])
        steps = self._frame.points(start + self._generator.normal(0.0, self._settings.step, start.shape))
        return np.concatenate([drawn, steps])

    def _most(self, unit: FloatArray, worth: FloatArray, traffic: FloatArray, left: FloatArray, n: int) -> IntArray:
        """Indices of candidates (m, k), n or fewer, each the one that is expected to reveal most beside those before it.

        Args:
            worth: predicted failure (m,) of each.
            traffic: draws (t, k) that stand for traffic. left: predicted failure (t,) of those that are not covered.
        """
        near = (cdist(unit, traffic) < self._settings.radius * self._reach).astype(np.float64)
        free, chosen = np.ones(len(unit), bool), list[int]()
        while len(chosen) < n and free.any():
            best = int(np.argmax(np.where(free, worth * (near @ left + _ALONE), -1.0)))
            chosen.append(best)
            free &= np.square(unit - unit[best]).sum(axis=1) >= (self._settings.least * self._reach) ** 2
            left = left * (1.0 - near[best] * min(worth[best], _SURE))
        return np.array(chosen, np.int64)

    def _verdicts(self, twin: Plays, theta: FloatArray) -> FloatArray:
        """Failures (n,) on the twin at points (n, d): 1 where a careful driver prevents them, less where none does."""
        outcomes = twin(theta)
        failing = outcomes.collision & outcomes.executed
        worth = np.where(failing, self._settings.unpreventable, 0.0)
        worth[failing] += (1.0 - self._settings.unpreventable) * survivors(theta[failing], twin)
        return worth

    def _unlike(self, theta: FloatArray, others: FloatArray) -> FloatArray:
        """Return the points (n, d) that keep the least distance from others."""
        return theta[apart(self._unit(theta), self._unit(others), self._settings.least)]

    def _unit(self, theta: FloatArray) -> FloatArray:
        return self._space.unit(theta)[:, self._told]


_HELD = 600
"""Runs that the Gaussian process holds: a round's cost does not grow with the runs"""
_ALONE = 1e-9
"""Counts for a candidate whose surroundings are covered: the likeliest failure is chosen where nothing is left to cover"""
_SURE = 0.9
"""Share of its surroundings that a guided run is taken to cover at most"""
