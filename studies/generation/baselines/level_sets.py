"""Level sets of a Gaussian process: runs are chosen where the border of failure is least known.

B. Bryan et al., Active learning for identifying function threshold boundaries, 2005 (the straddle
heuristic).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from generation.search.methods.models import BORDER, Frame, GaussianProcess
from generation.search.problem import Calls, History, SearchProblem
from generation.space.space import diverse
from schemas.common.array_types import FloatArray
from schemas.common.errors import UsageError

METHODS = {
    "level-sets": {
        "title": "GP level sets",
        "meaning": "Gaussian process, straddle heuristic on draws",
        "realistic": True,
    }
}


@dataclass(frozen=True)
class LevelSettings:
    """Settings of the search.

    Attributes:
        first: draws of the density before the first choice.
        batch: runs of a round.
        candidates: draws of the density, and steps from known failures, among which a round
            chooses.
        step: standard deviation of steps, in whitened coordinates.
        least: distance of two choices of a round in whitened coordinates, root mean square.
    """

    first: int = 60
    batch: int = 50
    candidates: tuple[int, int] = (500, 150)
    step: float = 0.4
    least: float = 0.2


_MOST = 3000
"""Runs that the process holds at most"""


def level_sets(
    problem: SearchProblem, budget: int, seed: int, settings: LevelSettings = LevelSettings()
) -> History:
    """Spend the budget.

    Raises:
        UsageError: the problem has no prior. MissingExtra: scikit-learn is not installed.
    """
    if problem.prior is None:
        raise UsageError("this search needs a prior of what is foreseeable")
    prior, calls, generator = problem.prior, Calls(problem, budget), np.random.default_rng(seed)
    frame, process = Frame.of(problem.space, prior, generator), GaussianProcess(_MOST)
    failures = np.empty((0, frame.dimension))
    theta = prior.sample(settings.first, generator)
    while calls.left:
        found = calls(theta)
        rows = frame.coordinates(found.theta)
        process.learn(rows, found.outcomes)
        failures = np.concatenate(
            [failures, rows[found.outcomes.executed & found.outcomes.collision]]
        )
        if calls.left:
            theta = _candidates(frame, failures, settings, generator)
            theta = theta[prior.foreseeable(theta)]
            rows = frame.coordinates(theta)
            order = np.argsort(-_straddle(*process.predicted(rows)), kind="stable")
            theta = theta[order[diverse(rows[order], settings.least, settings.batch)]]
    return calls.history


def _straddle(mean: FloatArray, deviation: FloatArray) -> FloatArray:
    """Half of the 95 % interval (m,) of a score less its distance from the border of failure."""
    return np.asarray(1.96 * deviation - np.abs(mean - BORDER))


def _candidates(
    frame: Frame, failures: FloatArray, settings: LevelSettings, generator: np.random.Generator
) -> FloatArray:
    drawn, stepped = settings.candidates
    theta = frame.prior.sample(drawn, generator)
    if not len(failures):
        return theta
    start = failures[generator.integers(len(failures), size=stepped)]
    return np.concatenate(
        [theta, frame.points(start + generator.normal(0.0, settings.step, start.shape))]
    )
