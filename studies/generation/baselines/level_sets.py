"""Level sets of a Gaussian process: runs are chosen where the border of failure is least known.

B. Bryan et al., Active learning for identifying function threshold boundaries, 2005 (the straddle heuristic).
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import cho_solve, solve_triangular

from generation.search.emitters import Frame
from generation.search.problem import Calls, History, Problem
from generation.search.screen import nearness
from generation.search.space import diverse
from schemas.common.array_types import BoolArray, FloatArray
from schemas.common.errors import UsageError
from schemas.common.packages import optional

METHODS = {
    "level-sets": {"title": "GP level sets", "meaning": "Gaussian process, straddle heuristic on draws", "realistic": True}
}


@dataclass(frozen=True)
class LevelSettings:
    """Settings of the search.

    Attributes:
        first: draws of the density before the first choice.
        batch: runs of a round.
        candidates: draws of the density, and steps from known failures, among which a round chooses.
        step: standard deviation of steps, in whitened coordinates.
        level: score at the border: failures have 1, near misses less.
        least: distance of two choices of a round in whitened coordinates, root mean square.
        fitted: points at most that the kernel's lengths are fitted on.
    """

    first: int = 60
    batch: int = 50
    candidates: tuple[int, int] = (500, 150)
    step: float = 0.4
    level: float = 0.5
    least: float = 0.2
    fitted: int = 250


def level_sets(problem: Problem, budget: int, seed: int, settings: LevelSettings = LevelSettings()) -> History:
    """Spend the budget.

    Raises:
        UsageError: the problem has no prior. MissingExtra: scikit-learn is not installed.
    """
    if problem.prior is None:
        raise UsageError("this search needs a prior of what is foreseeable")
    prior, calls, generator = problem.prior, Calls(problem, budget), np.random.default_rng(seed)
    frame, process = Frame.of(problem.space, prior, generator), _Process(settings)
    x, scores, failing = np.empty((0, frame.dimension)), np.empty(0), np.empty(0, bool)
    theta = prior.sample(settings.first, generator)
    while calls.left:
        found = calls(theta)
        fails = found.outcomes.executed & found.outcomes.collision
        x = np.concatenate([x, frame.coordinates(found.theta)])
        scores = np.concatenate([scores, np.where(fails, 1.0, nearness(found.outcomes))])
        failing = np.concatenate([failing, fails])
        if calls.left:
            theta = _candidates(frame, x[failing], settings, generator)
            theta = theta[prior.foreseeable(theta)]
            rows = frame.coordinates(theta)
            order = np.argsort(-process.unsure(x, scores, rows), kind="stable")
            theta = theta[order[diverse(rows[order], settings.least, settings.batch)]]
    return calls.history


def _candidates(frame: Frame, failures: FloatArray, settings: LevelSettings, generator: np.random.Generator) -> FloatArray:
    drawn, stepped = settings.candidates
    theta = frame.prior.sample(drawn, generator)
    if not len(failures):
        return theta
    start = failures[generator.integers(len(failures), size=stepped)]
    return np.concatenate([theta, frame.points(start + generator.normal(0.0, settings.step, start.shape))])


class _Process:
    """Gaussian process with one length for each coordinate; the lengths are fitted anew when the runs have doubled."""

    def __init__(self, settings: LevelSettings) -> None:
        self._library: Any = optional("sklearn.gaussian_process")
        self._settings, self._kernel, self._at = settings, None, 0

    def unsure(self, x: FloatArray, scores: FloatArray, rows: FloatArray) -> FloatArray:
        """Straddle (m,) of rows (m, k): 1.96 standard deviations less the distance of the mean from the level."""
        if len(x) >= 2 * self._at:
            self._fit(x, scores)
        kernel: Any = self._kernel
        mean = float(scores.mean())
        lower = np.linalg.cholesky(kernel(x) + 1e-8 * np.eye(len(x)))
        between = kernel(x, rows)
        found = mean + between.T @ cho_solve((lower, True), scores - mean)
        explained = np.square(solve_triangular(lower, between, lower=True)).sum(axis=0)
        deviation = np.sqrt(np.maximum(kernel.diag(rows) - explained, 0.0))
        return np.asarray(1.96 * deviation - np.abs(found - self._settings.level))

    def _fit(self, x: FloatArray, scores: FloatArray) -> None:
        kernels, k = self._library.kernels, x.shape[1]
        kernel = kernels.ConstantKernel(0.1, (1e-3, 1e1)) * kernels.RBF(np.ones(k), (0.1, 30.0))
        kernel += kernels.WhiteKernel(1e-2, (1e-4, 1e-1))
        rows = self._chosen(scores >= 1.0)
        process = self._library.GaussianProcessRegressor(kernel, normalize_y=False, random_state=0)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # lengths at their limits are no fault here
            fitted = process.fit(x[rows], scores[rows] - scores.mean())
        self._kernel, self._at = fitted.kernel_, len(x)

    def _chosen(self, failing: BoolArray) -> BoolArray:
        """Mask of the runs that lengths are fitted on: the first ones, and failures."""
        some = np.zeros(len(failing), bool)
        some[np.flatnonzero(failing)[: self._settings.fitted // 2]] = True
        some[np.flatnonzero(~some)[: self._settings.fitted - int(some.sum())]] = True
        return some
