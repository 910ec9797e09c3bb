"""Where tracks jump: places that their own motion does not explain.

A detector that confuses two vehicles, or loses half of one, moves a track by metres from one row to the next. Where it comes back
at once, the rows in between are not trusted; where it stays, what follows is a track of its own. So it is after a long gap.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from recognition.datasets.tables.rows import Rows
from xodr.array_types import FloatArray, IntArray

JUMP = 2.0
"""Distance (m) from where a row is expected: half a car's length."""
GAP = 1.0
"""Time without rows (s) after which a track is a new one."""
_SUSPECT = 1.0
"""Change of the way from row to row (m) from which it is looked at: 100 m/s² at 10 Hz."""
_REACH = 1.0
"""Time (s) around a jump that says how the track moves, and within which it may come back."""


class Breaks(NamedTuple):
    """What is broken in tracks.

    heads: rows that begin a new track, ascending. off: how far each is from where it was expected, m; 0 after a gap.
    astray: whether a row is not trusted (n,).
    """

    heads: IntArray
    off: FloatArray
    astray: NDArray[np.bool_]


def breaks(rows: Rows, x: FloatArray, y: FloatArray) -> Breaks:
    """Jumps and long gaps in tracks.

    Args:
        x, y: centres of the boxes, m.
    """
    place = np.stack([x, y], axis=1)
    astray = np.zeros(len(rows), bool)
    heads: dict[int, float] = {}
    pending: tuple[int, FloatArray] | None = None
    for row, off in _jumps(rows, place):
        if pending is not None and _comes_back(rows, pending, row, off):
            astray[pending[0] : row] = True
            del heads[pending[0]]
            pending = None
            continue
        heads[row] = float(np.hypot(*off))
        pending = row, off
    late = np.flatnonzero(np.diff(rows.time) > GAP) + 1
    for row in late[~np.isin(late, rows.starts)].tolist():
        heads.setdefault(row, 0.0)
    ordered = sorted(heads)
    return Breaks(np.array(ordered, np.int64), np.array([heads[row] for row in ordered]), astray)


def _comes_back(rows: Rows, before: tuple[int, FloatArray], row: int, off: FloatArray) -> bool:
    """Whether a jump undoes the one before it."""
    there, away = before
    near = rows.time[row] - rows.time[there] <= _REACH and rows.first[row] == rows.first[there]
    return bool(near and np.hypot(*(off + away)) < JUMP)


def _jumps(rows: Rows, place: FloatArray) -> Iterator[tuple[int, FloatArray]]:
    """Rows that are too far from where they were expected, and by which vector (m)."""
    way = np.diff(place, axis=0)
    bend = np.hypot(*np.diff(way, axis=0).T)
    sharp = np.zeros(len(way), bool)
    sharp[1:] = bend > _SUSPECT
    sharp[:-1] |= bend > _SUSPECT
    apart = rows.first[1:] != rows.first[:-1]  # another piece, or another track
    velocity = way / np.maximum(np.diff(rows.time), 1e-9)[:, None]
    reach = max(1, round(_REACH / rows.step))
    for step in np.flatnonzero(sharp & ~apart).tolist():
        first, last = int(rows.first[step]), int(rows.last[step])
        around = np.arange(max(first, step - reach), min(last, step + reach + 1))
        usual = np.median(velocity[around[around != step]], axis=0) if len(around) > 2 else velocity[step]
        off = way[step] - usual * (rows.time[step + 1] - rows.time[step])
        if np.hypot(*off) > JUMP:
            yield step + 1, off
