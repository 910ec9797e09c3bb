"""Plane geometry of bounding boxes in arrays, row by row: `runner.engine.participants.boxes` for
many cases.

Arrays are of any shapes that broadcast; sizes of boxes are numbers or arrays.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from runner.engine.participants.declaration import BoundingBox
from schemas.common.array_types import BoolArray, FloatArray, IntArray


class OutlineRows(Protocol):
    """Boxes in the plane: reference points, m, and cosine and sine of their headings."""

    @property
    def box(self) -> BoundingBox: ...
    @property
    def x(self) -> FloatArray: ...
    @property
    def y(self) -> FloatArray: ...
    @property
    def facing(self) -> tuple[FloatArray, FloatArray]: ...


class HeadedRows(Protocol):
    """Boxes in the plane: reference points, m, and headings, rad."""

    @property
    def box(self) -> BoundingBox: ...
    @property
    def x(self) -> FloatArray: ...
    @property
    def y(self) -> FloatArray: ...
    @property
    def h(self) -> FloatArray: ...


class BoxRows(OutlineRows, Protocol):
    """Upright boxes, with the heights of their reference points, m."""

    @property
    def z(self) -> FloatArray: ...


class OutlinesAt(NamedTuple):
    """Boxes in the plane of some rows: what their distances need."""

    box: BoundingBox
    x: FloatArray
    y: FloatArray
    facing: tuple[FloatArray, FloatArray]

    @classmethod
    def of(cls, motion: HeadedRows, rows: IntArray) -> OutlinesAt:
        """Boxes of one size at some rows."""
        h = motion.h[rows]
        return cls(motion.box, motion.x[rows], motion.y[rows], (np.cos(h), np.sin(h)))


class Sight(NamedTuple):
    """Centre and relative heading (cosine, sine) of another box, seen from the centre of the own
    one."""

    x: FloatArray
    y: FloatArray
    cos: FloatArray
    sin: FloatArray


def seen_by(a: OutlineRows, b: OutlineRows) -> Sight:
    """Return the relation of b to a, row by row."""
    (ca, sa), (cb, sb) = a.facing, b.facing
    dx = b.x - a.x + cb * b.box.x - sb * b.box.y
    dy = b.y - a.y + sb * b.box.x + cb * b.box.y
    return Sight(
        dx * ca + dy * sa - a.box.x,
        dy * ca - dx * sa - a.box.y,
        cb * ca + sb * sa,
        sb * ca - cb * sa,
    )


def boxes_overlap(a: BoxRows, b: BoxRows) -> BoolArray:
    """Return a mask of rows in which two upright boxes overlap or touch."""
    return _outlines_overlap(a.box, b.box, seen_by(a, b)) & (vertical_gap(a, b) == 0.0)


def _outlines_overlap(own: BoundingBox, other: BoundingBox, seen: Sight) -> BoolArray:
    """The same in the plane, by the separating-axis theorem."""
    x, y, c, s = seen
    al, aw, bl, bw = own.length / 2, own.width / 2, other.length / 2, other.width / 2
    cos, sin = np.abs(c), np.abs(s)
    apart = (np.abs(x) > al + bl * cos + bw * sin) | (np.abs(y) > aw + bl * sin + bw * cos)
    apart |= np.abs(x * c + y * s) > bl + al * cos + aw * sin
    apart |= np.abs(y * c - x * s) > bw + al * sin + aw * cos
    return np.logical_not(apart)


def vertical_gap(a: BoxRows, b: BoxRows) -> FloatArray:
    """Height between the vertical spans of two upright boxes, row by row; 0 where they overlap."""
    middle = np.abs(b.z + b.box.z - a.z - a.box.z)
    return np.maximum(middle - (a.box.height + b.box.height) / 2, 0.0)


def box_distance(a: OutlineRows, b: OutlineRows, seen: Sight | None = None) -> FloatArray:
    """Shortest distance of two boxes in the plane, row by row; 0 where they overlap.

    Args:
        seen: how a sees b, where that is known.
    """
    seen = seen or seen_by(a, b)
    squares = np.minimum(
        _corner_squares(seen, b.box, a.box), _corner_squares(seen_by(b, a), a.box, b.box)
    )
    return np.where(_outlines_overlap(a.box, b.box, seen), 0.0, np.sqrt(squares))


def _corner_squares(seen: Sight, other: BoundingBox, box: BoundingBox) -> FloatArray:
    """Squared distance of the nearest corner of a box seen from another's centre to that box."""
    nearest = np.full(seen.x.shape, np.inf)
    length, width = other.length / 2, other.width / 2
    sideways = width * seen.sin, width * seen.cos
    for end in (-length, length):
        x, y = seen.x + end * seen.cos, seen.y + end * seen.sin
        for aside in (np.subtract, np.add):  # to the right and to the left
            dx = np.abs((x - sideways[0]) if aside is np.add else (x + sideways[0]))
            dy = np.abs(aside(y, sideways[1]))
            dx -= box.length / 2
            dy -= box.width / 2
            np.maximum(dx, 0.0, out=dx)
            np.maximum(dy, 0.0, out=dy)
            dx *= dx
            dy *= dy
            dx += dy
            np.minimum(nearest, dx, out=nearest)
    return nearest


def extents(seen: Sight, box: BoundingBox) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Least and greatest x, least and greatest y of boxes that are seen at `seen`, m."""
    cos, sin = np.abs(seen.cos), np.abs(seen.sin)
    ahead = (box.length * cos + box.width * sin) / 2
    aside = (box.length * sin + box.width * cos) / 2
    return seen.x - ahead, seen.x + ahead, seen.y - aside, seen.y + aside


def interval_gaps(
    low_a: FloatArray | float, high_a: FloatArray | float, low_b: FloatArray, high_b: FloatArray
) -> FloatArray:
    """Signed gaps from intervals a to intervals b: positive where b lies above, negative where
    below, 0 where they overlap."""
    return np.maximum(low_b - high_a, 0.0) + np.minimum(high_b - low_a, 0.0)
