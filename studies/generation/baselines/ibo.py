"""IBO: Bayesian optimisation of criticality with a Gaussian process.

D. R. Jones, M. Schonlau, W. J. Welch, Efficient global optimization of expensive black-box
functions, 1998 (expected improvement).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import norm, qmc

from generation.search.methods.models import GaussianProcess
from generation.search.problem import Calls, History, SearchProblem
from generation.space.space import diverse
from schemas.common.array_types import FloatArray

METHODS = {
    "ibo": {"title": "IBO", "meaning": "Bayesian optimisation of criticality", "realistic": False}
}


@dataclass(frozen=True)
class BayesSettings:
    """Settings of the search, in coordinates from 0 to 1.

    Attributes:
        starts: Sobol points before the process is asked; a power of two.
        batch: runs of a round, which share one process: one of 3000 runs takes a second.
        candidates: uniform points, and steps from the best runs, among which a round chooses.
        step: standard deviation of steps.
        least: distance of two choices of a round, root mean square.
    """

    starts: int = 32
    batch: int = 20
    candidates: tuple[int, int] = (500, 300)
    step: float = 0.05
    least: float = 0.02


_MOST = 3000
"""Runs that the process holds at most"""


def ibo(
    problem: SearchProblem, budget: int, seed: int, settings: BayesSettings = BayesSettings()
) -> History:
    """Spend the budget on expected improvement, from Sobol points.

    Raises:
        MissingExtra: scikit-learn is not installed.
    """
    calls, generator = Calls(problem, budget), np.random.default_rng(seed)
    process, dimension = GaussianProcess(_MOST), len(problem.space.names)
    rows, values = np.empty((0, dimension)), np.empty(0)
    asked = qmc.Sobol(dimension, rng=generator).random(settings.starts)
    while calls.left:
        found = calls(problem.space.scaled(asked))
        asked = asked[: len(found.theta)]
        gained = problem.reward.criticality(found.outcomes)
        process.learn_scores(asked, gained)
        rows, values = np.concatenate([rows, asked]), np.concatenate([values, gained])
        if calls.left:
            best = rows[np.argsort(-values, kind="stable")[: settings.batch]]
            near = _candidates(best, settings, generator)
            order = np.argsort(-_improvement(*process.predicted(near), values.max()), kind="stable")
            asked = near[order[diverse(near[order], settings.least, settings.batch)]]
    return calls.history


def _improvement(mean: FloatArray, deviation: FloatArray, best: float) -> FloatArray:
    """Expected improvement (m,) on the best value so far."""
    above = (mean - best) / deviation
    return np.asarray(deviation * (above * norm.cdf(above) + norm.pdf(above)))


def _candidates(
    best: FloatArray, settings: BayesSettings, generator: np.random.Generator
) -> FloatArray:
    uniform, stepped = settings.candidates
    start = best[generator.integers(len(best), size=stepped)]
    steps = start + generator.normal(0.0, settings.step, start.shape)
    return np.concatenate([generator.random((uniform, best.shape[1])), np.clip(steps, 0.0, 1.0)])
