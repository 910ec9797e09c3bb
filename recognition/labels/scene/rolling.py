"""Sums, means and extremes over a number of rows about each row, within parts without missing frames."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from xodr.array_types import BoolArray, FloatArray, IntArray


def totals(values: NDArray, half: int, first: IntArray, last: IntArray) -> tuple[FloatArray, IntArray]:
    """Sum of the values from `half` rows before each row to `half` rows after it, as far as its part goes, and their number."""
    here = np.arange(len(values))
    before, after = np.maximum(here - half, first), np.minimum(here + half, last)
    sums = np.concatenate([[0.0], np.cumsum(values, dtype=np.float64)])
    return sums[after + 1] - sums[before], after + 1 - before


def smoothed(values: FloatArray, half: int, first: IntArray, last: IntArray) -> FloatArray:
    """Mean over `half` rows to either side."""
    total, number = totals(values, half, first, last)
    return total / number


def deviation(values: FloatArray, half: int, first: IntArray, last: IntArray) -> FloatArray:
    """Standard deviation over `half` rows to either side."""
    centred = values - (values.mean() if len(values) else 0.0)  # small numbers: their squares lose no digits
    mean, square = (smoothed(one, half, first, last) for one in (centred, centred**2))
    return np.sqrt(np.maximum(square - mean**2, 0.0))


def always(flags: BoolArray, half: int, first: IntArray, last: IntArray) -> BoolArray:
    """Where a flag holds in all rows from `half` before to `half` after, and all of them are there."""
    total, _ = totals(flags, half, first, last)
    return total == 2 * half + 1


def constant(values: NDArray, half: int, first: IntArray, last: IntArray) -> BoolArray:
    """Where a value stays the same in all rows from `half` before to `half` after, and all of them are there."""
    changed = np.zeros(len(values), bool)
    changed[1:] = values[1:] != values[:-1]
    here = np.arange(len(values))
    inside = (here - half >= first) & (here + half <= last)
    sums = np.concatenate([[0], np.cumsum(changed)])
    before, after = np.maximum(here - half, first), np.minimum(here + half, last)
    return inside & (sums[after + 1] == sums[before + 1])
