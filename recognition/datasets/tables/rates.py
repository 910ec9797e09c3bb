"""What data sets leave out: rates of change, headings, and velocities where the given ones can't be right."""

from __future__ import annotations

import numpy as np

from recognition.datasets.tables.rows import Rows
from xodr.array_types import FloatArray

REACH = 0.5
"""Rates are differences over this time to either side, s: positions that are 0.1 m off then spoil a speed by 0.1 m/s."""
STANDING = 0.5
"""Below this speed (m/s) the direction of motion is noise: the heading stays."""
_CREDIBLE = (0.8, 1.25)
"""Given velocities over those of the positions, as a whole: outside of this the given ones have another unit or sign."""
_FACING = 0.9
"""Share of the way that vehicles go forwards at least: none goes backwards for long, and none sidewards."""


def rate(values: FloatArray, rows: Rows) -> FloatArray:
    """Rate of change, per s: a central difference, shorter at the ends of a piece; 0 where there is nothing to compare."""
    reach = max(1, round(REACH / rows.step))
    here = np.arange(len(rows))
    before, after = np.maximum(here - reach, rows.first), np.minimum(here + reach, rows.last)
    apart = rows.time[after] - rows.time[before]
    return np.divide(values[after] - values[before], apart, out=np.zeros(len(rows)), where=apart > 0.0)


def heading_of_motion(vx: FloatArray, vy: FloatArray, rows: Rows) -> FloatArray:
    """Direction of the velocity, rad. While standing that of the last motion, before the first motion that of the first.

    Tracks that never move have the heading 0.
    """
    moving = np.hypot(vx, vy) >= STANDING
    here = np.arange(len(rows))
    latest = np.maximum.accumulate(np.where(moving, here, -1))
    following = np.minimum.accumulate(np.where(moving, here, len(rows))[::-1])[::-1]
    start, end = rows.each(rows.starts[:-1]), rows.each(rows.starts[1:])
    known = np.where(latest >= start, latest, np.where(following < end, following, -1))
    return np.where(known >= 0, np.arctan2(vy, vx)[known], 0.0)


def believable(x: FloatArray, y: FloatArray, vx: FloatArray, vy: FloatArray, rows: Rows) -> bool:
    """Whether given velocities agree with how the positions change, in sum over all rows that move.

    Real recordings have failed here: with all velocities backwards, or at half the speed of the positions.
    """
    dx, dy = rate(x, rows), rate(y, rows)
    travelled = float((dx * dx + dy * dy).sum())
    least, greatest = _CREDIBLE
    if travelled < STANDING**2 * len(rows) / 10:
        return True  # too little motion to compare
    return least <= float((vx * dx + vy * dy).sum()) / travelled <= greatest


def facing(heading: FloatArray, vx: FloatArray, vy: FloatArray) -> bool:
    """Whether nearly all of the way is gone in the direction of the headings.

    A real recording has failed here: its headings are arctan(vy/vx), so that all lie in one half of the circle.
    """
    speed = np.hypot(vx, vy)
    return bool((np.cos(heading) * vx + np.sin(heading) * vy).sum() >= _FACING * speed.sum())


def crowded(time: FloatArray, x: FloatArray, y: FloatArray) -> int:
    """How many rows have another one of the same time within the same square of 2 m.

    Next to none in a recording; many where a table holds vehicles that were not there together.
    """
    places = np.stack([np.round(time * 1000.0), np.round(0.5 * x), np.round(0.5 * y)])
    counts = np.unique(places, axis=1, return_counts=True)[1]
    return int(counts[counts > 1].sum())
