"""Models that predict failures from runs, and the coordinates in which a search moves."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import cho_solve, solve_triangular
from scipy.special import ndtr

from generation.search.outcomes import Outcomes, joined
from generation.space.density.base import Whitening
from generation.space.density.prior import Prior
from generation.space.space import Space
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from schemas.common.packages import optional


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
        """Points of coordinates (n, k), with nuisances as recorded; some may lie
        outside the box.
        """
        # Nuisances get their values from the prior; the middle of the box stands in until then.
        unit = np.full((len(coordinates), len(self.varied)), 0.5)
        unit[:, self.varied] = self.whitening.mean + coordinates @ self.whitening.factor.T
        return self.prior.with_nuisances(self.space.scaled(unit))


_FAR, _HARD = 5.0, 8.0
"""Clearance (m) at which its margin counts 1/e, and DRAC (m/s²) at which nothing is left of its own
"""
_CLEAR, _BRAKED = 0.1, 0.8
"""Weights of the margins: vehicles that pass each other in two lanes are close, and far from a
collision"""


_LIMITED, _TYPICAL = 0.45, 8.0
"""Nearness of a run that only just keeps its limits, and how often that is as much as of a run with
the typical margin, about. It is below `BORDER`: many runs that pass each other at a distance are
near a limit all along, and a process would take them for failures"""


def typical_margin(outcomes: Outcomes) -> float:
    """Median margin of runs that keep their limits, about `_TYPICAL` where none has one.

    Margins have the units of their limits: what is far is known from runs alone.
    """
    kept = outcomes.margin[outcomes.executed & np.isfinite(outcomes.margin)]
    kept = kept[kept > 0.0]
    return float(np.median(kept)) if len(kept) else _TYPICAL


def nearness(outcomes: Outcomes, typical: float = _TYPICAL) -> FloatArray:
    """Nearness to a failure (n,), 0 to below 1: by least clearance and greatest DRAC to a
    collision, and by the margin to limits; 0 where no run took place.

    Args:
        typical: margin that counts as far.
    """
    near = _CLEAR * np.exp(-np.minimum(outcomes.clearance, 1e3) / _FAR) + _BRAKED * np.minimum(
        outcomes.max_drac / _HARD, 1.0
    )
    # Slower than an exponential: far from a limit there is still a way to it.
    limited = _LIMITED / (1.0 + _TYPICAL * np.maximum(outcomes.margin, 0.0) / typical)
    # Either may lead: a margin that is the same everywhere must not hide collisions.
    return np.where(outcomes.executed, near + limited * (1.0 - near), 0.0)


def scores(outcomes: Outcomes, typical: float = _TYPICAL) -> FloatArray:
    """1 for a failure, otherwise nearness (n,)."""
    return np.where(outcomes.executed & outcomes.collision, 1.0, nearness(outcomes, typical))


_TREES = 100
_FEW = 60
"""Runs from which failures are predicted"""
_ROUND = 20, 0.02
"""Runs after which the forest is grown anew, and the share of all that they are where that is more
"""
_NEAR = 0.1
"""Weight of the nearest miss relative to a failure"""


def likely(outcomes: Outcomes, typical: float = _TYPICAL) -> FloatArray:
    """1 for a failure, otherwise a small share of nearness (n,): it leads to the first failures,
    and matters little afterwards."""
    # Near misses count at most `_NEAR`: a region of near misses must not outweigh failures.
    failing = outcomes.collision & outcomes.executed
    return np.where(failing, 1.0, _NEAR * nearness(outcomes, typical))


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
        # Growing takes far longer than predicting, and a few runs more hardly change the forest.
        least, share = _ROUND
        if self._forest is None or len(self) >= self._grown + max(least, share * self._grown):
            self._grow()
        predicted: FloatArray = self._forest.predict(differences(x))
        return predicted

    def _grow(self) -> None:
        outcomes = joined(self._outcomes)
        failing = outcomes.collision & outcomes.executed
        typical = typical_margin(self._outcomes[0])
        values, x = likely(outcomes, typical), np.concatenate(self._x)
        forest, rows = (
            self._ensemble.ExtraTreesRegressor(_TREES, random_state=0),
            evenly(failing, _MOST),
        )
        self._forest, self._grown = forest.fit(differences(x[rows]), values[rows]), len(self)


class GaussianProcess:
    """Gaussian process of scores at rows x (n, k) of coordinates: a failure has 1, a near miss
    less.

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
        self._typical: float | None = None
        self._known: tuple[FloatArray, FloatArray, FloatArray, float] | None = None

    def learn(self, x: FloatArray, outcomes: Outcomes) -> None:
        """Take outcomes of runs at rows (n, k)."""
        if self._typical is None:  # the first runs are draws: later ones are nearer to failures
            self._typical = typical_margin(outcomes)
        self.learn_scores(x, scores(outcomes, self._typical))

    def learn_scores(self, x: FloatArray, values: FloatArray) -> None:
        """Take scores (n,) of runs at rows (n, k), of another kind than those of outcomes."""
        self._x.append(x)
        self._scores.append(values)
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
        """The runs that it holds, the Cholesky factor of their covariance, their weights, and the
        mean score."""
        x, values = np.concatenate(self._x), np.concatenate(self._scores)
        # Lengths are fitted O(log n) times in a search, not in each round.
        if len(x) >= 2 * self._at:
            self._fit(x, values)
        held = evenly(values >= 1.0, self._most)
        x, values, mean = x[held], values[held], float(values[held].mean())
        lower = np.linalg.cholesky(self._kernel(x) + _LEAST * np.eye(len(x)))
        return x, lower, cho_solve((lower, True), values - mean), mean

    def _fit(self, x: FloatArray, values: FloatArray) -> None:
        kernels, held = self._library.kernels, evenly(values >= 1.0, _FITTED)
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


def evenly(failing: BoolArray, most: int) -> IntArray:
    """Indices of the runs (n,) that a model learns from: all, or evenly chosen ones of failures and
    of others."""
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
    """Coordinates (n, k) and the differences of each two: a tree splits by one value, a failure
    depends on relative speeds."""
    one, other = np.triu_indices(x.shape[1], 1)
    return np.hstack([x, x[:, one] - x[:, other]])
