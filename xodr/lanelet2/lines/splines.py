"""Smooth curves through samples: cubic splines with given values and slopes at both ends.

SciPy evaluates them; the fit is ours, because SciPy's `make_lsq_spline` and `make_smoothing_spline` keep no values and slopes at
the ends, without which neighbouring roads would not meet.
"""

from __future__ import annotations

from math import factorial
from typing import TYPE_CHECKING

import numpy as np

from xodr.array_types import FloatArray

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

_STIFFNESS = 1e-4
"""Weight of the bending against the distance from the samples, so that gaps between samples are bridged smoothly."""


def fit(at: FloatArray, samples: FloatArray, ends: FloatArray, slopes: FloatArray, intervals: int) -> PPoly:
    """The cubic spline nearest to samples in the sense of least squares, of class C2.

    Args:
        at: parameters, ascending (n,). samples: (n, d).
        ends, slopes: values and derivatives at the first and last parameter, (2, d) each, kept exactly.
        intervals: number of pieces, all of the same length.
    """
    from scipy.interpolate import BSpline, PPoly

    first, last = at[0], at[-1]
    grid = np.linspace(first, last, intervals + 1)
    knots = np.concatenate([[first] * 3, grid, [last] * 3])
    count, step = intervals + 3, grid[1] - grid[0]
    control = np.zeros((count, samples.shape[1]))
    control[0], control[-1] = ends
    control[1], control[-2] = ends[0] + slopes[0] * step / 3, ends[1] - slopes[1] * step / 3
    if intervals > 1:
        basis = BSpline.design_matrix(np.clip(at, first, last), knots, 3).toarray()
        bending = np.sqrt(_STIFFNESS) * np.diff(np.eye(count), 2, axis=0)
        rows, goal = np.vstack([basis, bending]), np.vstack([samples, np.zeros((count - 2, samples.shape[1]))])
        fixed = [0, 1, -2, -1]
        free = slice(2, count - 2)
        goal = goal - rows[:, fixed] @ control[fixed]
        control[free] = np.linalg.lstsq(rows[:, free], goal, rcond=None)[0]
    spline = BSpline(knots, control, 3)
    return PPoly(np.stack([spline(grid[:-1], power) / factorial(power) for power in (3, 2, 1, 0)]), grid)
