"""Points that differ: how far they are from each other in the unit cube, as root mean square over its sides."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.distance import cdist

from generation.density.roles import NUISANCES, roles_of
from generation.search.space import Space
from xodr.array_types import BoolArray, FloatArray, IntArray

_ROUNDING = 1e-9
"""By how much the tree looks further than it has to: the distances themselves decide"""


def distinctive(space: Space) -> BoolArray:
    """The parameters (d,) that tell cases apart: all but the nuisances."""
    roles = roles_of(space.names)
    return np.array([name not in roles or roles[name].role not in NUISANCES for name in space.names], bool)


def apart(unit: FloatArray, others: FloatArray, least: float) -> BoolArray:
    """Rows (n, d) of the unit cube that are no nearer than `least` to any of others (m, d)."""
    return (cdist(unit, others) >= least * np.sqrt(unit.shape[1])).all(axis=1)


def diverse(unit: FloatArray, least: float, most: int | None = None) -> IntArray:
    """Indices of rows (n, d) of the unit cube, each the first one that is no nearer than `least` to those before.

    Args:
        most: how many indices at most; None for any number.
    """
    kept, left, tree = list[int](), np.ones(len(unit), bool), KDTree(unit)
    reach = least * np.sqrt(unit.shape[1]) * (1.0 + _ROUNDING)
    for index in range(len(unit)):
        if len(kept) == most:
            break
        if left[index]:
            kept.append(index)
            near = np.array(tree.query_ball_point(unit[index], reach), np.int64)
            left[near] &= np.sqrt(np.square(unit[near] - unit[index]).mean(axis=1)) >= least
    return np.array(kept, np.int64)
