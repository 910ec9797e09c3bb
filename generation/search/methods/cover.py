"""Coverage search: a quarter of the runs are draws of the density, the others cover the probability that is expected to fail.

A guided run is chosen by what it is expected to reveal: its own predicted failure, times the
predicted failures among draws of the density around it that are near no known failure. What is
covered counts no more, so that no finding starves another one, and what traffic does more often
counts more. Without plays two models predict, each for half of the guided runs, so that what one
cannot see does not starve the other: a forest, in which near misses have a small share, and a
Gaussian process, which also expects failures where no run was. With plays in arrays it is their verdict, less
where no careful driver prevents the failure.

G. L. Nemhauser, L. A. Wolsey, M. L. Fisher, An analysis of approximations for maximizing submodular
set functions, 1978 (the greedy choice of what covers most).
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from scipy.linalg import cho_solve, solve_triangular
from scipy.spatial.distance import cdist
from scipy.special import ndtr

from generation.search.outcomes import Outcomes, joined, survivors
from generation.search.problem import BATCH, Calls, History, Plays, SearchProblem
from generation.space.density.base import Whitening
from generation.space.density.prior import Prior
from generation.space.space import Space, apart, distinctive
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from schemas.common.errors import UsageError
from schemas.common.packages import optional

METHODS = {
    "cover": {
        "title": "**coverage**",
        "meaning": "draws of the density, and runs that cover what is expected to fail and ask where failures begin",
        "realistic": True,
    },
    "draws": {
        "title": "draws of the density",
        "meaning": "draws of the density alone",
        "realistic": True,
    },
}


@dataclass(frozen=True)
class CoverSettings:
    """Parameters of the search.

    Attributes:
        batch: runs of a round, and the share of the budget that they are where that is more.
        first: runs that explore before the first guided one, without plays.
        explored: share of the runs that explores.
        radius: distance in the unit cube, root mean square over the parameters that tell cases
            apart, up to which a failure covers others.
        least: distance from all runs that a guided run keeps.
        drawn: draws of the density that are guided runs' candidates in a round, and as many that
            stand for traffic.
        stepped: further candidates: steps from known failures.
        step: standard deviation of steps, in whitened coordinates.
        played: draws in the place of `drawn` that stand for traffic, with plays: so many for each run of the
            budget, and no more than the second number.
        unpreventable: weight of a failure that no careful driver prevents, with plays.
    """

    batch: tuple[int, float] = 40, 0.02
    first: int = 60
    explored: float = 0.25
    radius: float = 0.08
    least: float = 0.03
    drawn: int = 1200
    stepped: int = 400
    step: float = 0.4
    played: tuple[int, int] = 33, 16_384
    unpreventable: float = 0.2


def draws(problem: SearchProblem, budget: int, seed: int) -> History:
    """Draws of the density.

    Raises:
        UsageError: the problem has no prior.
    """
    prior, calls, generator = (
        _prior_of(problem),
        Calls(problem, budget),
        np.random.default_rng(seed),
    )
    while calls.left:
        calls(prior.sample(min(BATCH, calls.left), generator))
    return calls.history


def cover(
    problem: SearchProblem, budget: int, seed: int, settings: CoverSettings = CoverSettings()
) -> History:
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

    def __init__(
        self, problem: SearchProblem, prior: Prior, budget: int, seed: int, settings: CoverSettings
    ) -> None:
        self._calls, self._prior, self._space, self._settings = (
            Calls(problem, budget),
            prior,
            problem.space,
            settings,
        )
        self._generator = np.random.default_rng(seed)
        self._frame, self._told = (
            Frame.of(problem.space, prior, self._generator),
            distinctive(problem.space),
        )
        # Distances of the settings are root mean squares over parameters: times √k they are
        # Euclidean ones.
        self._reach = float(np.sqrt(self._told.sum()))
        least, share = settings.batch
        self._batch = max(least, round(share * budget))
        self._theta = np.empty((0, len(problem.space.parameters)))
        self._failures = self._theta if problem.found is None else problem.found
        self._forest, self._process = Forest(), GaussianProcess(_HELD)
        self._plays = problem.plays
        share, most = settings.played
        # Plays cost little, so traffic is stood for by more draws; the greatest number bounds the
        # matrix of distances in `_most`.
        played = max(settings.drawn, min(share * budget, most))
        self._traffic = prior.sample(
            settings.drawn if self._plays is None else played, self._generator
        )
        self._chance: FloatArray | None = None
        self._emitters: list[Predict] = [
            # The forest splits by single values, so it reads the unit cube; the process has round
            # kernels, so it reads whitened coordinates.
            lambda theta: self._forest.failing(self._unit(theta)),
            lambda theta: self._process.failing(self._frame.coordinates(theta)),
        ]
        if self._plays is not None:
            verdicts = partial(self._verdicts, self._plays)
            chance = verdicts(self._traffic)
            # Verdicts do not change: draws of traffic that pass have nothing to reveal, ever.
            self._traffic, self._chance, self._emitters = (
                self._traffic[chance > 0.0],
                chance[chance > 0.0],
                [verdicts],
            )

    def run(self) -> History:
        """Search."""
        # Models learn from runs, so some have to come first; plays need none.
        if self._plays is None:
            self._spend(self._prior.sample(self._settings.first, self._generator))
        while self._calls.left:
            runs = min(self._batch, self._calls.left)
            # Draws of the density fill up what the guided runs leave: early on the models predict
            # nothing.
            guided = self._guided(runs - round(self._settings.explored * runs))
            explored = self._prior.sample(runs - len(guided), self._generator)
            self._spend(np.concatenate([explored, guided]))
        return self._calls.history

    def _spend(self, theta: FloatArray) -> None:
        """Run points (n, d)."""
        found = self._calls(theta)
        self._theta = np.concatenate([self._theta, found.theta])
        self._failures = np.concatenate(
            [self._failures, found.theta[found.outcomes.collision & found.outcomes.executed]]
        )
        if self._plays is None:
            self._forest.learn(self._unit(found.theta), found.outcomes)
            self._process.learn(self._frame.coordinates(found.theta), found.outcomes)

    def _guided(self, n: int) -> FloatArray:
        """Points (n, d), or fewer: each emitter chooses its part of them among what those before it have left."""
        theta, parts = self._candidates(), list[FloatArray]()
        # Before any run: what is not foreseeable can be no edge case, whatever comes of it.
        theta = theta[self._prior.foreseeable(theta)]
        theta = self._unlike(theta, self._theta)
        # An equal part of what is left: runs that one emitter has no candidates for are the next
        # one's.
        for left, emitter in zip(range(len(self._emitters), 0, -1), self._emitters, strict=True):
            parts.append(self._covering(theta, emitter, (n - sum(map(len, parts))) // left))
            theta = self._unlike(theta, parts[-1])
        return np.concatenate(parts)

    def _covering(self, theta: FloatArray, emitter: Predict, n: int) -> FloatArray:
        """The points (n, d), or fewer, among candidates that together are expected to reveal most."""
        worth, traffic = emitter(theta), self._unit(self._traffic)
        theta, worth = theta[worth > 0.0], worth[worth > 0.0]
        chance = emitter(self._traffic) if self._chance is None else self._chance
        # Draws near a known failure are covered already and count nothing.
        left = np.where(
            apart(traffic, self._unit(self._failures), self._settings.radius), chance, 0.0
        )
        return theta[self._most(self._unit(theta), worth, traffic, left, n)]

    def _candidates(self) -> FloatArray:
        """Draws of the density, and steps from failures that are known or that plays have (m, d)."""
        drawn = self._prior.sample(self._settings.drawn, self._generator)
        parents = (
            self._failures
            if self._chance is None
            else np.concatenate([self._failures, self._traffic])
        )
        if not len(parents):
            return drawn
        start = self._frame.coordinates(
            parents[self._generator.integers(len(parents), size=self._settings.stepped)]
        )
        steps = self._frame.points(
            start + self._generator.normal(0.0, self._settings.step, start.shape)
        )
        return np.concatenate([drawn, steps])

    def _most(
        self, unit: FloatArray, worth: FloatArray, traffic: FloatArray, left: FloatArray, n: int
    ) -> IntArray:
        """Indices of candidates (m, k), n or fewer, each the one that is expected to reveal most beside those before it.

        Args:
            worth: predicted failure (m,) of each.
            traffic: draws (t, k) that stand for traffic. left: predicted failure (t,) of those that
                are not covered.
        """
        # Greedy choice of a submodular function, at least 1 - 1/e of the best one (Nemhauser et al.
        # 1978): near @ left is the probability mass that a candidate would cover now.
        near = (cdist(unit, traffic) < self._settings.radius * self._reach).astype(np.float64)
        free, chosen = np.ones(len(unit), bool), list[int]()
        while len(chosen) < n and free.any():
            best = int(np.argmax(np.where(free, worth * (near @ left + _ALONE), -1.0)))
            chosen.append(best)
            free &= (
                np.square(unit - unit[best]).sum(axis=1)
                >= (self._settings.least * self._reach) ** 2
            )
            # A run that is sure to fail covers its surroundings, an uncertain one a part of them.
            left = left * (1.0 - near[best] * min(worth[best], _SURE))
        return np.array(chosen, np.int64)

    def _verdicts(self, plays: Plays, theta: FloatArray) -> FloatArray:
        """Failures (n,) of plays at points (n, d): 1 where a careful driver prevents them, less where none does."""
        outcomes = plays(theta)
        failing = outcomes.collision & outcomes.executed
        worth = np.where(failing, self._settings.unpreventable, 0.0)
        # Only failures are played with careful drivers: these are few of the draws.
        worth[failing] += (1.0 - self._settings.unpreventable) * survivors(theta[failing], plays)
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


@dataclass(frozen=True, eq=False)
class Frame:
    """Coordinates of points θ (n, d) of a space.

    Attributes:
        varied: the parameters that are searched (d,); nuisances are drawn with them.
        whitening: of recorded points in the unit cube: steps are as long as traffic varies, in the
            directions in which it does.
    """

    space: Space
    prior: Prior
    varied: BoolArray
    whitening: Whitening

    @classmethod
    def of(cls, space: Space, prior: Prior, generator: np.random.Generator) -> Frame:
        """Build from a prior's recorded points, or from draws if there are too few."""
        varied = np.array([name not in prior.nuisances for name in space.names])
        # A covariance of k columns needs more than k rows; twice as many keep it from being
        # singular.
        rows = prior.theta if len(prior.theta) > 2 * len(varied) else prior.sample(1000, generator)
        return cls(space, prior, varied, Whitening.of(space.unit(rows)[:, varied]))

    @property
    def dimension(self) -> int:
        """Number of coordinates k."""
        return int(self.varied.sum())

    def coordinates(self, theta: FloatArray) -> FloatArray:
        """Whitened coordinates (n, k)."""
        return self.whitening.forward(self.space.unit(theta)[:, self.varied])

    def points(self, coordinates: FloatArray) -> FloatArray:
        """Points of coordinates (n, k), with nuisances as recorded; some may lie outside the box."""
        # Nuisances get their values from the prior; the middle of the box stands in until then.
        unit = np.full((len(coordinates), len(self.varied)), 0.5)
        unit[:, self.varied] = self.whitening.mean + coordinates @ self.whitening.factor.T
        return self.prior.with_nuisances(self.space.scaled(unit))


_FAR, _HARD = 5.0, 8.0
"""Clearance (m) at which its margin counts 1/e, and DRAC (m/s²) at which nothing is left of its own"""
_CLEAR, _BRAKED = 0.1, 0.8
"""Weights of the margins: vehicles that pass each other in two lanes are close, and far from a collision"""


def nearness(outcomes: Outcomes) -> FloatArray:
    """By both margins, least clearance and greatest DRAC (n,), 0 to below 1; 0 where no run took place."""
    near = _CLEAR * np.exp(-np.minimum(outcomes.clearance, 1e3) / _FAR) + _BRAKED * np.minimum(
        outcomes.max_drac / _HARD, 1.0
    )
    return np.where(outcomes.executed, near, 0.0)


def scores(outcomes: Outcomes) -> FloatArray:
    """1 for a failure, otherwise nearness (n,)."""
    return np.where(outcomes.executed & outcomes.collision, 1.0, nearness(outcomes))


_TREES = 100
_FEW = 60
"""Runs from which failures are predicted"""
_ROUND = 20
"""Runs after which the forest is grown anew"""
_NEAR = 0.1
"""Weight of the nearest miss relative to a failure: it leads to the first failures, and matters little afterwards"""


class Forest:
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

    def failing(self, x: FloatArray) -> FloatArray:
        """Predicted failure (n,) at points (n, k), from 0 to 1; 0 while there are few runs."""
        if len(self) < _FEW or not len(x):
            return np.zeros(len(x))
        # Growing takes far longer than predicting, and twenty runs more hardly change the forest.
        if self._forest is None or len(self) >= self._grown + _ROUND:
            self._grow()
        found: FloatArray = self._forest.predict(differences(x))
        return found

    def _grow(self) -> None:
        outcomes = joined(self._outcomes)
        failing = outcomes.collision & outcomes.executed
        # Failures count 1, near misses at most `_NEAR`: a region of near misses must not outweigh
        # failures.
        values, x = np.where(failing, 1.0, _NEAR * nearness(outcomes)), np.concatenate(self._x)
        forest, rows = (
            self._ensemble.ExtraTreesRegressor(_TREES, random_state=0),
            _learnt(failing, _MOST),
        )
        self._forest, self._grown = forest.fit(differences(x[rows]), values[rows]), len(self)


class GaussianProcess:
    """Gaussian process of scores at rows x (n, k) of coordinates: a failure has 1, a near miss less.

    It has one length for each coordinate; they are fitted anew when the runs have doubled.

    C. E. Rasmussen and C. K. I. Williams, Gaussian processes for machine learning, 2006.

    Args:
        most: runs that it holds at most; of more it takes evenly chosen ones of failures and of
            others.

    Raises:
        MissingExtra: scikit-learn is not installed.
    """

    def __init__(self, most: int) -> None:
        self._library: Any = optional("sklearn.gaussian_process")
        self._most, self._x, self._scores = most, list[FloatArray](), list[FloatArray]()
        self._kernel: Any = None
        self._at = 0
        self._known: tuple[FloatArray, FloatArray, FloatArray, float] | None = None

    def learn(self, x: FloatArray, outcomes: Outcomes) -> None:
        """Take outcomes of runs at rows (n, k)."""
        self._x.append(x)
        self._scores.append(scores(outcomes))
        self._known = None

    def failing(self, rows: FloatArray) -> FloatArray:
        """Probability (m,) of a failure at rows (m, k)."""
        mean, deviation = self.predicted(rows)
        # The score is Gaussian at each row; a failure is a score above the border.
        return np.asarray(ndtr((mean - BORDER) / deviation))

    def predicted(self, rows: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Means and standard deviations (m,) of the score at rows (m, k)."""
        x, lower, weights, mean = self._known = self._known or self._conditioned()
        between = self._kernel(x, rows)
        # Variance that the runs explain, k*ᵀ K⁻¹ k* by the Cholesky factor (Rasmussen and Williams,
        # algorithm 2.1).
        explained = np.square(solve_triangular(lower, between, lower=True)).sum(axis=0)
        return mean + between.T @ weights, np.sqrt(
            np.maximum(self._kernel.diag(rows) - explained, _LEAST)
        )

    def _conditioned(self) -> tuple[FloatArray, FloatArray, FloatArray, float]:
        """The runs that it holds, the Cholesky factor of their covariance, their weights, and the mean score."""
        x, values = np.concatenate(self._x), np.concatenate(self._scores)
        # Lengths are fitted O(log n) times in a search, not in each round.
        if len(x) >= 2 * self._at:
            self._fit(x, values)
        held = _learnt(values >= 1.0, self._most)
        x, values, mean = x[held], values[held], float(values[held].mean())
        lower = np.linalg.cholesky(self._kernel(x) + _LEAST * np.eye(len(x)))
        return x, lower, cho_solve((lower, True), values - mean), mean

    def _fit(self, x: FloatArray, values: FloatArray) -> None:
        kernels, held = self._library.kernels, _learnt(values >= 1.0, _FITTED)
        # Lengths are in standard deviations of traffic: at 30 a coordinate has no effect within the
        # data.
        kernel = kernels.ConstantKernel(0.1, (1e-3, 1e1)) * kernels.RBF(
            np.ones(x.shape[1]), (0.1, 30.0)
        )
        process = self._library.GaussianProcessRegressor(
            kernel + kernels.WhiteKernel(1e-2, (1e-4, 1e-1)), random_state=0
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # lengths at their limits are no fault here
            self._kernel, self._at = (
                process.fit(x[held], values[held] - values[held].mean()).kernel_,
                len(x),
            )


_LEAST = 1e-8
"""Least variance"""
BORDER = 0.5
"""Score at the border of failure"""
_FITTED = 250
"""Runs that the lengths of a process are fitted on at most"""


def _learnt(failing: BoolArray, most: int) -> IntArray:
    """Indices of the runs (n,) that a model learns from: all, or evenly chosen ones of failures and of others."""
    if len(failing) <= most:
        return np.arange(len(failing))
    groups = [np.flatnonzero(failing), np.flatnonzero(~failing)]
    # The rarer group is kept whole, up to half of the rows.
    least = min(most // 2, *map(len, groups))
    chosen = [
        group[np.linspace(0, len(group) - 1, min(len(group), most - least)).astype(int)]
        for group in groups
    ]
    return np.sort(np.concatenate(chosen))


_MOST = 10_000
"""Runs that a forest learns from: its memory does not grow with the runs"""


def differences(x: FloatArray) -> FloatArray:
    """Coordinates (n, k) and the differences of each two: a tree splits by one value, a failure depends on relative speeds."""
    one, other = np.triu_indices(x.shape[1], 1)
    return np.hstack([x, x[:, one] - x[:, other]])
