"""Stays: runs of rows in which a value (a lane, a role) stays the same."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from xodr.array_types import IntArray


class Stays(NamedTuple):
    """First row and number of rows of each stay."""

    start: IntArray
    size: IntArray

    @property
    def end(self) -> IntArray:
        """The row after the last one of each."""
        return self.start + self.size


def stays(values: IntArray, group: IntArray) -> Stays:
    """Runs of equal values within runs of equal groups."""
    begins = np.ones(len(values), bool)
    begins[1:] = (values[1:] != values[:-1]) | (group[1:] != group[:-1])
    start = np.flatnonzero(begins)
    return Stays(start, np.diff(np.append(start, len(values))))


def held(values: IntArray, group: IntArray, least: int | IntArray) -> IntArray:
    """Values in which stays of fewer than `least` rows (of all, or of each) count to the last longer one in the same group."""
    start, size = stays(values, group)
    number = np.arange(len(start))
    last_long = np.maximum.accumulate(np.where(size >= least, number, -1))
    same = (last_long >= 0) & (group[start[last_long]] == group[start])
    return np.repeat(values[start[np.where(same, last_long, number)]], size)
