"""Points that differ: how far they are from each other in the unit cube, as root mean square over its sides."""

from __future__ import annotations

import numpy as np
from scipy.spatial.distance import cdist

from generation.density.roles import NUISANCES, roles_of
from generation.search.space import Space
from xodr.array_types import BoolArray, FloatArray, IntArray


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
    kept: list[int] = []
    for index in range(len(unit)):
        if len(kept) == most:
            break
        distances = np.sqrt(np.square(unit[kept] - unit[index]).mean(axis=1))
        if (distances >= least).all():
            kept.append(index)
    return np.array(kept, np.int64)
