"""How far recorded positions are off, from what they do about their own smooth course."""

from __future__ import annotations

import numpy as np

from recognition.datasets.tables.rows import Rows
from xodr.array_types import FloatArray

LEAST = 0.05
"""Least deviation of positions, m."""
_REACH = 1.0
"""Time to either side (s) over which a course is a parabola, but for noise."""


def deviation(rows: Rows, x: FloatArray, y: FloatArray) -> FloatArray:
    """Standard deviation of the position of each row, m: root mean square, within a second, of the distance from local parabolas.

    It counts errors that last for some rows, unlike differences from row to row, and is large where a track is bad for a while.
    Parts shorter than two seconds have the median of all rows.
    """
    from scipy.signal import savgol_coeffs

    reach = max(2, round(_REACH / rows.step))
    window = 2 * reach + 1
    if len(rows) < window:
        return np.full(len(rows), LEAST)
    fit = savgol_coeffs(window, 2)
    off = [np.convolve(values, fit, mode="same") - values for values in (x, y)]
    here = np.arange(len(rows))
    whole = (here - rows.first >= reach) & (rows.last - here >= reach)
    squares = np.where(whole, 0.5 * (off[0] ** 2 + off[1] ** 2), 0.0)
    first, last = np.maximum(here - reach, rows.first), np.minimum(here + reach, rows.last) + 1
    total, count = (np.append(0.0, np.cumsum(values)) for values in (squares, whole))
    among = count[last] - count[first]
    usual = float(np.median(squares[whole])) if whole.any() else 0.0
    mean = np.divide(total[last] - total[first], among, out=np.full(len(rows), usual), where=among > 0.0)
    return np.sqrt(LEAST**2 + mean)
