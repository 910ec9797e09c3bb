"""Measures of a search."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from generation.search.outcomes import Episodes, Evaluate
from generation.search.problem import History, SearchProblem
from generation.search.settings import Choice
from generation.space.space import diverse
from schemas.common.array_types import BoolArray, FloatArray

JUDGED = 100
"""Collisions that the careful driver is given, at most."""
_PAIRED = 500
"""Points whose distances from each other are measured, at most."""


class Measures(NamedTuple):
    """Of some episodes.

    Attributes:
        r_risk: mean R_risk.
        collisions: share of the executed episodes that end in one (CR).
        log_likelihood: mean log-density of recorded parameters.
        plausible: share of the episodes whose realism term is 0.
        edge_cases: share of the episodes that are plausible and end in a collision.
        distinct: number of these that are no nearer to each other than written edge cases are.
        diversity: mean distance of two episodes in the unit cube, root mean square over the
            parameters.
        reward: mean.
        failed: share of the episodes that did not take place.
    """

    r_risk: float
    collisions: float
    log_likelihood: float
    plausible: float
    edge_cases: float
    distinct: int
    diversity: float
    reward: float
    failed: float


def last_third(history: History) -> Episodes:
    """The last third of a search: what it generates once it has learnt."""
    return taken(history, np.arange(len(history.theta)) >= len(history.theta) * 2 // 3)


def taken(episodes: Episodes, chosen: BoolArray) -> Episodes:
    """Some episodes, by a mask (n,)."""
    return Episodes(
        episodes.theta[chosen], episodes.outcomes.take(chosen), episodes.rewards[chosen]
    )


def measure(episodes: Episodes, problem: SearchProblem) -> Measures:
    """The measures of episodes."""
    outcomes, unit = episodes.outcomes, problem.space.unit(episodes.theta)
    log_likelihood, plausible = problem.reward.realism.judged(episodes.theta)
    edge = plausible & outcomes.collision
    return Measures(
        r_risk=float(outcomes.r_risk.mean()),
        collisions=float(outcomes.collision.sum() / max(outcomes.executed.sum(), 1)),
        log_likelihood=float(log_likelihood.mean()),
        plausible=float(plausible.mean()),
        edge_cases=float(edge.mean()),
        distinct=len(diverse(unit[edge], Choice().apart)),
        diversity=_distance(unit),
        reward=float(episodes.rewards.mean()),
        failed=float(1.0 - outcomes.executed.mean()),
    )


def avoided(history: History, careful: Evaluate) -> float | None:
    """Share of the last third's collisions, or of evenly chosen ones among them, where the careful
    driver has none.

    Runs of the careful driver that did not take place do not count; None where nothing is left to
    judge.
    """
    last = last_third(history)
    theta = last.theta[last.outcomes.collision]
    if not len(theta):
        return None
    chosen = np.unique(np.linspace(0, len(theta) - 1, min(len(theta), JUDGED)).astype(int))
    judged = careful(theta[chosen])
    return float(judged.survived.sum() / judged.executed.sum()) if judged.executed.any() else None


def curves(history: History, window: int = 150) -> dict[str, FloatArray]:
    """Means (n,) of R_risk, collisions and rewards over the last `window`
    episodes at each episode.
    """
    columns = {
        "r_risk": history.outcomes.r_risk,
        "collisions": history.outcomes.collision,
        "reward": history.rewards,
    }
    total = {name: np.concatenate([[0.0], np.cumsum(values)]) for name, values in columns.items()}
    ends = np.arange(1, len(history.theta) + 1)
    starts = np.maximum(ends - window, 0)
    return {name: (sums[ends] - sums[starts]) / (ends - starts) for name, sums in total.items()}


def _distance(unit: FloatArray) -> float:
    """Mean distance of two rows, of evenly chosen ones where there are many."""
    from scipy.spatial.distance import pdist

    chosen = unit[np.unique(np.linspace(0, len(unit) - 1, min(len(unit), _PAIRED)).astype(int))]
    return float(pdist(chosen).mean() / np.sqrt(unit.shape[1])) if len(chosen) > 1 else 0.0
