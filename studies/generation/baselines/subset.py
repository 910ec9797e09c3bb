"""Subset simulation: chains of draws of the density that are held to ever nearer misses until they
fail, then anew.

S. K. Au and J. L. Beck, Estimation of small failure probabilities in high dimensions by subset
simulation, 2001.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from generation.search.methods.models import Frame, scores
from generation.search.problem import Calls, History, SearchProblem
from schemas.common.array_types import FloatArray
from schemas.common.errors import UsageError

METHODS = {
    "subset": {
        "title": "subset simulation",
        "meaning": "chains of draws held to ever nearer misses",
        "realistic": True,
    }
}


@dataclass(frozen=True)
class SubsetSettings:
    """Settings of the search.

    Attributes:
        level: points of a level.
        kept: share of them that starts the chains of the next level.
        step: first standard deviation of a chain's steps, in whitened coordinates.
        accepted: share of steps that is aimed at.
        levels: of one simulation at most.
    """

    level: int = 150
    kept: float = 0.2
    step: float = 0.6
    accepted: float = 0.4
    levels: int = 6


def subset(
    problem: SearchProblem, budget: int, seed: int, settings: SubsetSettings = SubsetSettings()
) -> History:
    """Spend the budget: a simulation that reached the failures, or its last level, is followed by
    another.

    Raises:
        UsageError: the problem has no prior.
    """
    if problem.prior is None:
        raise UsageError("this search needs a prior of what is foreseeable")
    calls, generator = Calls(problem, budget), np.random.default_rng(seed)
    frame = Frame.of(problem.space, problem.prior, generator)
    while calls.left:
        _simulation(calls, frame, settings, generator)
    return calls.history


def _simulation(
    calls: Calls, frame: Frame, settings: SubsetSettings, generator: np.random.Generator
) -> None:
    found = calls(frame.prior.sample(settings.level, generator))
    theta, values, step = found.theta, scores(found.outcomes), settings.step
    for _ in range(settings.levels):
        if not calls.left:
            return
        limit = float(np.quantile(values, 1.0 - settings.kept))
        failing = limit >= 1.0
        chosen = np.argsort(-values, kind="stable")[: round(settings.kept * len(values))]
        theta, values, step = _chains(
            calls, frame, (theta[chosen], values[chosen]), limit, step, settings, generator
        )
        if failing:
            return


def _chains(
    calls: Calls,
    frame: Frame,
    start: tuple[FloatArray, FloatArray],
    limit: float,
    step: float,
    settings: SubsetSettings,
    generator: np.random.Generator,
) -> tuple[FloatArray, FloatArray, float]:
    """All states of chains by Metropolis among points with a score of the limit or more, their
    scores, and the next step size."""
    theta, values = start
    thetas, every = [theta], [values]
    for _ in range(max(round(1.0 / settings.kept) - 1, 1)):
        here = frame.coordinates(theta)
        proposed = frame.points(here + generator.normal(0.0, step, here.shape))
        ratio = frame.prior.log_density(proposed) - frame.prior.log_density(theta)
        tried = np.flatnonzero(np.log(generator.random(len(theta))) < ratio)
        found = calls(proposed[tried])
        tried = tried[: len(found.theta)]
        reached = scores(found.outcomes)
        moved = reached >= limit
        theta, values = theta.copy(), values.copy()
        theta[tried[moved]], values[tried[moved]] = found.theta[moved], reached[moved]
        step *= float(np.exp(moved.sum() / len(theta) - settings.accepted))
        thetas.append(theta)
        every.append(values)
        if not calls.left:
            break
    return np.concatenate(thetas), np.concatenate(every), step
