"""Shaping of an adversary's reward between its decisions: nearness of a collision, 0 to 1.

As a potential of the state it changes no optimum (A. Ng, D. Harada, S. Russell, ICML 1999); it
decides how soon one is found.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from runner.judging.measures.risk_field import risk_field
from schemas.common.array_types import FloatArray
from schemas.common.errors import UsageError
from studies.generation.adversary import OBJECTIVES
from studies.generation.adversary.course import Course

Shape = Callable[[Course], FloatArray]
_NEAR = 5.0
"""Distance (m) at which nearness counts 1/e"""
_HEADWAY = (0.0, 1.0, 3.0)
"""Peaks (s) of the fuzzy sets of the time headway: beside the ego (or behind its front), short,
long"""
_CLOSING = (-4.0, 0.0, 4.0)
"""Peaks (m/s) of those of the closing speed: opening, even, closing"""
_WEIGHT = np.array([[1.0, 1.0, 1.0], [0.5, 0.75, 1.0], [0.5, 0.75, 1.0]])
"""A rule for each two of these: the weight of the risk field's probability; the rest is that of
nearness.

Beside the ego nearness leads nowhere, as recorded drivers have no contact; where one is far ahead
and opening, the risk field is flat. Of three tables tried on development seeds this one finds
most."""
_SLOWEST = 1.0
"""Speed (m/s) that headways are worked out with at least"""


def probability(course: Course) -> FloatArray:
    """Probability of a collision within seconds by the risk field (n,)."""
    return risk_field(*course.motions()).probability


def nearness(course: Course) -> FloatArray:
    """1 in contact, less the further the boxes are (n,)."""
    return np.exp(-course.near / _NEAR)


def fuzzy(course: Course) -> FloatArray:
    """Both, weighted by what fuzzy rules say of the time headway and the closing speed (n,)."""
    headway = course.gap / np.maximum(course.ego.speed, _SLOWEST)
    weight = rule_weight(headway, course.ego.speed - course.actor.speed)
    return weight * probability(course) + (1.0 - weight) * nearness(course)


def rule_weight(headway: FloatArray, closing: FloatArray) -> FloatArray:
    """The weight of the probability (n,), 0 to 1, by the rules.

    Inference of order zero with products (T. Takagi, M. Sugeno, IEEE Transactions on Systems, Man,
    and Cybernetics 15, 1985); as the memberships of each quantity add up to 1, there is nothing to
    normalise.

    Args:
        headway: s (n,). closing: m/s (n,).
    """
    found: FloatArray = np.einsum(
        "ni,nj,ij->n", _memberships(headway, _HEADWAY), _memberships(closing, _CLOSING), _WEIGHT
    )
    return found


def _memberships(values: FloatArray, peaks: tuple[float, ...]) -> FloatArray:
    """Memberships (n, k) of triangular sets that reach to the next peaks; the outer ones go on."""
    return np.stack([np.interp(values, peaks, each) for each in np.eye(len(peaks))], axis=1)


_SHAPES: Mapping[str, Shape] = dict(zip(OBJECTIVES, (probability, nearness, fuzzy), strict=True))


def shape(objective: str) -> Shape:
    """The shape of a name.

    Raises:
        UsageError: there is none.
    """
    if objective not in _SHAPES:
        raise UsageError(
            f"there is no objective {objective!r}; objectives: {', '.join(OBJECTIVES)}"
        )
    return _SHAPES[objective]
