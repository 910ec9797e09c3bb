"""What a search has found, for the next one to start from."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from generation.outcomes.cases import Choice
from generation.outcomes.outcomes import Episodes
from generation.search.diversity import apart, diverse
from generation.search.space import Space
from xodr.array_types import FloatArray

_ALIKE = Choice().apart
"""Failures that are nearer to each other than this are one; as for edge cases"""


class Failures(NamedTuple):
    """Failures of the system under test, one a row, no two alike, those with the greatest rewards first.

    Attributes:
        theta: parameters (n, d).
        collisions: how many of all are collisions; the others are violations of RSS distances.
        new: how many collisions are unlike all failures that were known before.
    """

    theta: FloatArray
    collisions: int
    new: int


def failures(space: Space, episodes: Episodes, before: FloatArray | None = None) -> Failures:
    """The failures among episodes.

    Args:
        before: failures (m, d) that were known already.
    """
    order = np.argsort(-episodes.rewards, kind="stable")
    collided = order[episodes.outcomes.collision[order]]
    distinct = collided[diverse(space.unit(episodes.theta[collided]), _ALIKE)]
    unit = space.unit(episodes.theta[distinct])
    new = len(distinct) if before is None else int(apart(unit, space.unit(before), _ALIKE).sum())
    order = order[episodes.outcomes.critical[order]]
    chosen = order[diverse(space.unit(episodes.theta[order]), _ALIKE)]
    return Failures(episodes.theta[chosen], len(distinct), new)
