"""From columns of a whole recording to its tracks."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recognition.datasets.participants import Participant
from recognition.datasets.tables.rows import Rows
from runner.recording import Track
from xodr.array_types import FloatArray

Columns = dict[str, NDArray[Any]]


def columns_of(
    rows: Rows,
    who: Sequence[Participant],
    x: FloatArray,
    y: FloatArray,
    h: FloatArray,
    speed: FloatArray,
    acceleration: FloatArray,
) -> Columns:
    """Columns of a `Recording` from those of box centres; the places on the road are left open.

    Args:
        who: the participant of each track.
        x, y: centres of the boxes, m. h: headings, rad, of any turn.
        speed, acceleration: along the heading, m/s and m/s².
    """
    behind = rows.each([one.box.x for one in who])
    zero, count = np.zeros(len(rows)), len(rows)
    return {
        "time": rows.time,
        "x": x - behind * np.cos(h),
        "y": y - behind * np.sin(h),
        "z": zero,
        "h": np.arctan2(np.sin(h), np.cos(h)),
        "pitch": zero,
        "roll": zero,
        "speed": speed,
        "acceleration": acceleration,
        "road_id": np.full(count, None, dtype=object),
        "lane_id": np.zeros(count, dtype=np.int64),
        "s": zero,
        "t": zero,
        "lane_offset": zero,
    }


def cut(rows: Rows, who: Sequence[Participant], columns: Columns) -> list[Track]:
    """The tracks of a recording, each with its part of the columns."""
    ends = rows.starts.tolist()
    return [
        Track(one.name, one.kind, one.category, one.box, partial(_part, columns, start, end))
        for one, (start, end) in zip(who, pairwise(ends), strict=True)
    ]


def _part(columns: Columns, start: int, end: int) -> Columns:
    """A track's own part; copied, because looking up places writes into it."""
    return {name: values[start:end].copy() for name, values in columns.items()}
