"""Smooth curves through samples: cubic splines with given values and slopes at both ends, as coarse as a tolerance allows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from xodr.array_types import FloatArray

_STIFFNESS = 1e-4
"""Weight of the bending against the distance from the samples, so that gaps between samples are bridged smoothly."""


class Spline(NamedTuple):
    """A piecewise cubic of class C2.

    knots: (m + 1,). pieces: (m, 4, d), the coefficients a, b, c, d of each piece, of the parameter from its knot on.
    """

    knots: FloatArray
    pieces: FloatArray

    def __call__(self, at: FloatArray, derivative: int = 0) -> FloatArray:
        """Values (n, d) at parameters (n,), or their first or second derivatives."""
        index = np.clip(np.searchsorted(self.knots, at, side="right") - 1, 0, len(self.pieces) - 1)
        x = (at - self.knots[index])[:, None]
        a, b, c, d = (self.pieces[index, power] for power in range(4))
        if derivative == 0:
            return a + x * (b + x * (c + x * d))
        return b + x * (2 * c + 3 * x * d) if derivative == 1 else 2 * c + 6 * x * d


def fit(at: FloatArray, samples: FloatArray, ends: FloatArray, slopes: FloatArray, intervals: int) -> Spline:
    """The cubic spline nearest to samples in the sense of least squares.

    Args:
        at: parameters, ascending (n,). samples: (n, d).
        ends, slopes: values and derivatives at the first and last parameter, (2, d) each, kept exactly.
        intervals: number of pieces, all of the same length.
    """
    from scipy.interpolate import BSpline

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
    values, rates = spline(grid), spline(grid, 1) * step
    rise = np.diff(values, axis=0)
    before, after = rates[:-1], rates[1:]
    pieces = np.stack(
        [values[:-1], before / step, (3 * rise - 2 * before - after) / step**2, (before + after - 2 * rise) / step**3]
    )
    return Spline(grid, pieces.transpose(1, 0, 2))
