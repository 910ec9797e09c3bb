"""What tracks are at the edge of the view: a box that grows or shrinks as it comes into view or leaves it seems to turn back.

No vehicle or pedestrian goes from forwards to backwards, or the reverse, while braking hard: they stand in between. Where a track
does so within seconds of its end, what it is said to do beyond that is left out.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from recognition.datasets.participants import Participant
from recognition.datasets.tables.rows import Rows
from xodr.array_types import BoolArray, FloatArray

EDGE = 3.0
"""Time (s) from the ends of a track in which it may be at the edge of the view."""
TURN = 2.0
"""Acceleration (m/s²) with which nothing turns from forwards to backwards: twice that of usual starting."""
_MOVING = ("vehicle", "pedestrian")
_LEAST = 0.5
"""Shortest rest (s) of a track."""


class Edge(NamedTuple):
    """Rows at one end of a track that are wrong.

    track: its index. rows: which. time: when it seems to turn back, s. acceleration: then, m/s².
    """

    track: int
    rows: slice
    time: float
    acceleration: float


def edges(rows: Rows, who: Sequence[Participant], speed: FloatArray, acceleration: FloatArray) -> list[Edge]:
    """The ends of tracks of vehicles and pedestrians at which they turn back hard.

    Args:
        speed, acceleration: smoothed, of each row (n,).
    """
    turns = np.flatnonzero(speed[1:] * speed[:-1] < 0.0)
    turns = turns[~np.isin(turns + 1, rows.starts)]
    track = np.searchsorted(rows.starts, turns, side="right") - 1
    found: list[Edge] = []
    for index in np.unique(track).tolist():
        if who[index].kind in _MOVING:
            own = turns[track == index]
            found += _of(rows, index, int(own[0]), int(own[-1]), speed, acceleration)
    return found


def _of(rows: Rows, index: int, first: int, last: int, speed: FloatArray, acceleration: FloatArray) -> Iterator[Edge]:
    """The wrong ends of one track, which turns for the first and for the last time after these rows."""
    start, end, time = int(rows.starts[index]), int(rows.starts[index + 1]), rows.time
    hard = [float(acceleration[row : row + 2][np.abs(acceleration[row : row + 2]).argmax()]) for row in (first, last)]
    begins = abs(hard[0]) >= TURN and speed[first] < 0.0 and time[first] - time[start] <= EDGE
    ends = abs(hard[1]) >= TURN and speed[last] > 0.0 and time[end - 1] - time[last] <= EDGE
    rest = time[last if ends else end - 1] - time[first + 1 if begins else start]
    if rest < _LEAST:
        return
    if begins:
        yield Edge(index, slice(start, first + 1), float(time[first]), hard[0])
    if ends:
        yield Edge(index, slice(last + 1, end), float(time[last]), hard[1])


def without(rows: Rows, found: Sequence[Edge]) -> BoolArray:
    """Which rows are not at such an end (n,)."""
    kept = np.ones(len(rows), bool)
    for edge in found:
        kept[edge.rows] = False
    return kept
