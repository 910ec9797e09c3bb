"""Points of a study for pictures: recorded ones, those that MCSG generates, and one case to look
at."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from generation.search.outcomes import Episodes
from schemas.common.array_types import FloatArray
from studies.generation.comparison.measures import last_third, taken
from studies.generation.comparison.study import Study
from studies.generation.methods import TRAJECTORIES

NAME = "points"
"""Of the table"""
RECORDED, GENERATED, COLLISION = "recorded", "generated", "collision"
FOUND, NEAREST = "likeliest collision", "least clearance"
"""Kinds of rows: points; then the case, which is one of the last two"""
_SHOWN = 150
"""Points of each kind at most"""
_DIGITS = 5


class _Case(NamedTuple):
    """A point (d,) with its kind, the method that found it, and its log-density."""

    kind: str
    method: str
    theta: FloatArray
    log_likelihood: float


def rows(study: Study) -> list[tuple[str, ...]]:
    """Header, then rows of kind, method, and values of the parameters; none without searches."""
    keys = [key for key in study.searches() if key.method not in TRAJECTORIES]
    if not keys:
        return []
    found = [
        (RECORDED, "", *_values(row))
        for row in _some(study.recorded.theta)  # a drawn order, the same each time
    ]
    own = next((key for key in keys if key.method == "mcsg"), None)
    if own is not None:
        generated = last_third(study.history(own))
        for kind, chosen in (
            (GENERATED, ~generated.outcomes.collision),
            (COLLISION, generated.outcomes.collision),
        ):
            points = _some(taken(generated, chosen).theta)
            found += [(kind, own.method, *_values(row)) for row in points]
    case = max(
        (_case(study, key.method, study.history(key)) for key in keys),
        key=lambda one: (one.kind == FOUND, one.log_likelihood),
    )
    # In full: the run is repeated.
    found.append((case.kind, case.method, *map(repr, case.theta.tolist())))
    return [("kind", "method", *study.space.names), *found]


def _case(study: Study, method: str, history: Episodes) -> _Case:
    """The likeliest collision of a search, or the episode that came nearest to one."""
    outcomes = history.outcomes
    hit = outcomes.collision & outcomes.executed
    if hit.any():
        likelihood, _ = study.problem.reward.realism.judged(history.theta[hit])
        best = int(np.argmax(likelihood))
        return _Case(FOUND, method, history.theta[hit][best], float(likelihood[best]))
    clearance = np.where(outcomes.executed, outcomes.clearance, np.inf)
    best = int(np.argmin(clearance))
    return _Case(NEAREST, method, history.theta[best], -float(clearance[best]))


def _some(points: FloatArray) -> FloatArray:
    """Points drawn without replacement, at most `_SHOWN`."""
    return points[np.random.default_rng(0).permutation(len(points))[:_SHOWN]]


def _values(row: FloatArray) -> list[str]:
    return [f"{value:.{_DIGITS}g}" for value in row]
