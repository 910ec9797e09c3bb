"""Rows after events, and rows picked from long stretches in which something holds."""

from __future__ import annotations

import numpy as np

from recognition.labels.scene.scene import Scene
from xodr.array_types import BoolArray, IntArray


def ahead_of(scene: Scene, rows: IntArray, seconds: float) -> IntArray:
    """Indices (n, k) of the rows from each given one to `seconds` later; the last one that there is stands for those missing."""
    steps = np.arange(scene.rows(seconds) + 1)
    return np.minimum(rows[:, None] + steps, scene.last[rows][:, None])


def spaced(scene: Scene, flags: BoolArray, seconds: float, most: int) -> IntArray:
    """Rows of each track at which a flag holds, the first and then each at least `seconds` after the one before."""
    candidates = np.flatnonzero(flags)
    ends = np.searchsorted(scene.track[candidates], np.arange(len(scene.names) + 1))
    apart = scene.rows(seconds)
    chosen: list[int] = []
    for start, end in zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True):
        mine = candidates[start:end]
        frames, place = scene.frame[mine], 0
        for _ in range(most):
            if place == len(mine):
                break
            chosen.append(int(mine[place]))
            place = int(np.searchsorted(frames, frames[place] + apart))
    return np.array(chosen, np.int64)


def near(scene: Scene, row: IntArray, others: IntArray, seconds: float) -> BoolArray:
    """Whether another row of the same track is less than so much away from each row."""
    apart = np.abs(scene.time[row][:, None] - scene.time[others]) < seconds
    return (apart & (scene.track[row][:, None] == scene.track[others])).any(axis=1)
