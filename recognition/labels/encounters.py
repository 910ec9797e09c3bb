"""Who else was at a place, and how long before or after."""

from __future__ import annotations

import numpy as np

from xodr.array_types import FloatArray, IntArray

REACH = 2.0
"""Places less than this apart (m) are the same place."""


def time_apart(
    x: FloatArray, y: FloatArray, time: FloatArray, track: IntArray, others: tuple[FloatArray, FloatArray, FloatArray, IntArray]
) -> FloatArray:
    """Least time between each of n visits and one of another track at the same place, s; infinite without such a visit.

    Args:
        x, y, time, track: of the visits (n,).
        others: the same of all rows that count.
    """
    from scipy.spatial import cKDTree

    there_x, there_y, then, who = others
    apart = np.full(len(x), np.inf)
    if not len(x) or not len(there_x):
        return apart
    here, there = (cKDTree(np.stack(points, axis=1)) for points in ((x, y), (there_x, there_y)))
    near = here.sparse_distance_matrix(there, REACH, output_type="ndarray")
    visit, other = near["i"], near["j"]
    foreign = who[other] != track[visit]
    visit, other = visit[foreign], other[foreign]
    np.minimum.at(apart, visit, np.abs(time[visit] - then[other]))
    return apart
