"""Plane geometry of bounding boxes: overlap and gaps of oriented rectangles, in plain scalars.

A box stands upright: its outline is the rectangle of `BoundingBox` turned by the entity's heading,
its height the vertical span at the reference point. Pitch and roll tilt it by centimetres and are
left out.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from runner.engine.participants.declaration import BoundingBox

if TYPE_CHECKING:
    from schemas.common.array_types import BoolArray, FloatArray, IntArray

_TOUCHING = 1e-9
"""Distance (m) that is rounding: boxes so near to each other touch, whichever of them looks."""


class Boxed(Protocol):
    """Protocol of an entity's shape: reference point (x, y, z in m), heading h (rad), bounding box
    about them."""

    @property
    def x(self) -> float: ...
    @property
    def y(self) -> float: ...
    @property
    def z(self) -> float: ...
    @property
    def h(self) -> float: ...
    @property
    def box(self) -> BoundingBox: ...


class BoxedRows(Protocol):
    """The same in many runs, arrays (n,): an entity's rows."""

    @property
    def x(self) -> FloatArray: ...
    @property
    def y(self) -> FloatArray: ...
    @property
    def z(self) -> FloatArray: ...
    @property
    def h(self) -> FloatArray: ...
    @property
    def box(self) -> BoundingBox: ...


class MovedRows(BoxedRows, Protocol):
    """The same with pitch (rad), velocities over ground (m/s) and turns (rad) in the last step."""

    @property
    def pitch(self) -> FloatArray: ...
    @property
    def vx(self) -> FloatArray: ...
    @property
    def vy(self) -> FloatArray: ...
    @property
    def turn(self) -> FloatArray: ...


class Spot(NamedTuple):
    """A position as a box without extent, so that distances to positions and to entities are one
    thing."""

    x: float
    y: float
    z: float
    h: float
    box: BoundingBox = BoundingBox(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Outlook(NamedTuple):
    """Another box as seen from the centre of the own box: its centre (m) and the cosine and sine of
    its relative heading."""

    x: float
    y: float
    cos: float
    sin: float


def outlook(a: Boxed, b: Boxed) -> Outlook:
    """Return the relation of b to a: axes along and to the left of a, origin in the centre of a's
    box."""
    ca, sa, cb, sb = math.cos(a.h), math.sin(a.h), math.cos(b.h), math.sin(b.h)
    dx = b.x - a.x + cb * b.box.x - sb * b.box.y
    dy = b.y - a.y + sb * b.box.x + cb * b.box.y
    return Outlook(
        dx * ca + dy * sa - a.box.x,
        dy * ca - dx * sa - a.box.y,
        cb * ca + sb * sa,
        sb * ca - cb * sa,
    )


def reach(box: BoundingBox) -> float:
    """Radius about the reference point that holds the whole outline, m."""
    return math.hypot(abs(box.x) + box.length / 2, abs(box.y) + box.width / 2)


def vertical_gap(a: Boxed, b: Boxed) -> float:
    """Height between the vertical spans of two boxes, m; 0 where the spans overlap or touch."""
    middle = abs(b.z + b.box.z - a.z - a.box.z)
    return max(middle - (a.box.height + b.box.height) / 2, 0.0)


def overlap(a: Boxed, b: Boxed) -> bool:
    """Whether two boxes overlap or touch, by the separating-axis theorem in the plane and their
    vertical spans."""
    return vertical_gap(a, b) == 0.0 and not _separated(outlook(a, b), a.box, b.box)


def overlap_arrays(a: BoxedRows, b: BoxedRows, rows: IntArray) -> BoolArray:
    """`overlap` of two participants in some of many runs, given by their indices (k,)."""
    x, y, c, s = _outlooks(a, b, rows)
    al, aw = a.box.length / 2 + _TOUCHING, a.box.width / 2 + _TOUCHING
    bl, bw = b.box.length / 2, b.box.width / 2
    cos, sin = np.abs(c), np.abs(s)
    apart = (np.abs(x) > al + bl * cos + bw * sin) | (np.abs(y) > aw + bl * sin + bw * cos)
    apart |= np.abs(x * c + y * s) > bl + al * cos + aw * sin
    apart |= np.abs(y * c - x * s) > bw + al * sin + aw * cos
    middle = np.abs(b.z[rows] + b.box.z - a.z[rows] - a.box.z)
    found: BoolArray = ~apart & (middle <= (a.box.height + b.box.height) / 2)
    return found


def may_have_touched(a: MovedRows, b: MovedRows, dt: float, rows: IntArray) -> BoolArray:
    """Whether two participants that are apart may have touched within the last step, dt (s), in
    some of many runs (k,).

    They are nearer to each other, on an axis of one of them, than their way towards each other.
    """
    x, y, c, s = _outlooks(a, b, rows)
    al, aw, bl, bw = a.box.length / 2, a.box.width / 2, b.box.length / 2, b.box.width / 2
    cos, sin = np.abs(c), np.abs(s)
    way = np.hypot(b.vx[rows] - a.vx[rows], b.vy[rows] - a.vy[rows]) * dt + _TOUCHING
    gap = np.maximum(np.abs(x) - al - bl * cos - bw * sin, np.abs(y) - aw - bl * sin - bw * cos)
    gap = np.maximum(gap, np.abs(x * c + y * s) - bl - al * cos - aw * sin)
    gap = np.maximum(gap, np.abs(y * c - x * s) - bw - al * sin - aw * cos)
    near: BoolArray = gap <= way
    return near


def _outlooks(a: BoxedRows, b: BoxedRows, rows: IntArray) -> tuple[FloatArray, ...]:
    """`outlook` in some of many runs (k,)."""
    ah, bh = a.h[rows], b.h[rows]
    ca, sa, cb, sb = np.cos(ah), np.sin(ah), np.cos(bh), np.sin(bh)
    dx = b.x[rows] - a.x[rows] + cb * b.box.x - sb * b.box.y
    dy = b.y[rows] - a.y[rows] + sb * b.box.x + cb * b.box.y
    x, y = dx * ca + dy * sa - a.box.x, dy * ca - dx * sa - a.box.y
    return x, y, cb * ca + sb * sa, sb * ca - cb * sa


def _separated(seen: Outlook, a: BoundingBox, b: BoundingBox) -> bool:
    """Whether one of the four axes of two rectangles separates them; touching rectangles are not
    separated."""
    x, y, c, s = seen
    al, aw, bl, bw = a.length / 2 + _TOUCHING, a.width / 2 + _TOUCHING, b.length / 2, b.width / 2
    cos, sin = abs(c), abs(s)
    return (
        abs(x) > al + bl * cos + bw * sin
        or abs(y) > aw + bl * sin + bw * cos
        or abs(x * c + y * s) > bl + al * cos + aw * sin
        or abs(y * c - x * s) > bw + al * sin + aw * cos
    )


def entry(seen: Outlook, a: BoundingBox, b: BoundingBox, vx: float, vy: float) -> float:
    """Return the time (s) after which box b, moving relative to a at (vx, vy) m/s in a's axes,
    first touches it.

    Both keep their headings. 0 where they touch now, infinite where they never do. On each of the
    four axes of the separating-axis theorem the shadows overlap during one interval; the boxes
    touch while all four do.
    """
    x, y, c, s = seen
    al, aw, bl, bw = a.length / 2 + _TOUCHING, a.width / 2 + _TOUCHING, b.length / 2, b.width / 2
    cos, sin = abs(c), abs(s)
    begin, end = 0.0, math.inf
    for place, speed, size in (
        (x, vx, al + bl * cos + bw * sin),
        (y, vy, aw + bl * sin + bw * cos),
        (x * c + y * s, vx * c + vy * s, bl + al * cos + aw * sin),
        (y * c - x * s, vy * c - vx * s, bw + al * sin + aw * cos),
    ):
        if speed == 0.0:
            if abs(place) > size:
                return math.inf
            continue
        first, last = (-size - place) / speed, (size - place) / speed
        begin, end = max(begin, min(first, last)), min(end, max(first, last))
        if begin > end:
            return math.inf
    return begin


class Moved(Boxed, Protocol):
    """Protocol of a moving box: pitch (rad, downwards positive), velocity over ground (m/s) and
    turn (rad) in the last step."""

    @property
    def pitch(self) -> float: ...
    @property
    def vx(self) -> float: ...
    @property
    def vy(self) -> float: ...
    @property
    def turn(self) -> float: ...


_STRAIGHT = 0.06
"""Turn (rad) in a part of a step in which entities move straight on"""


def first_touch(a: Moved, b: Moved, dt: float) -> float | None:
    """Return the share (0 to 1) of the last step, dt (s), after which two boxes first touched; None
    if they did not.

    Reference points move along arcs, which end at the present poses, by the turns of the step. It
    has equal parts in which both move straight on.
    """
    turns = math.remainder(a.turn, math.tau), math.remainder(b.turn, math.tau)
    parts = max(math.ceil(max(map(abs, turns)) / _STRAIGHT), 1)
    own, its = _way(a, dt, turns[0], parts), _way(b, dt, turns[1], parts)
    for part in range(parts):
        one, other, mine, theirs = own[part], its[part], own[part + 1], its[part + 1]
        first = one._replace(h=(one.h + mine.h) / 2)
        second = other._replace(h=(other.h + theirs.h) / 2)
        if vertical_gap(first, second) > 0.0:
            continue
        vx, vy = theirs.x - other.x - mine.x + one.x, theirs.y - other.y - mine.y + one.y
        cos, sin = math.cos(first.h), math.sin(first.h)
        seen = outlook(first, second)
        after = entry(seen, a.box, b.box, vx * cos + vy * sin, vy * cos - vx * sin)
        if after <= 1.0:
            return (part + after) / parts
    return None


def first_touch_arrays(a: MovedRows, b: MovedRows, dt: float, rows: IntArray) -> FloatArray:
    """`first_touch` in some of many runs (k,): infinite for none; NaN where a participant turns
    much, which takes parts."""
    (x, y, z, h, dx, dy, rise, turn), (bx, by, bz, bh, bdx, bdy, brise, bturn) = (
        _step(each, dt, rows) for each in (a, b)
    )
    ca, sa, cb, sb = (
        f(heading - 0.5 * by_turn)
        for heading, by_turn in ((h, turn), (bh, bturn))
        for f in (np.cos, np.sin)
    )
    px, py = x - dx, y - dy
    vx, vy = bdx - dx, bdy - dy
    gx = bx - bdx - px + cb * b.box.x - sb * b.box.y
    gy = by - bdy - py + sb * b.box.x + cb * b.box.y
    place = gx * ca + gy * sa - a.box.x, gy * ca - gx * sa - a.box.y
    share = _entry_arrays(
        place, (cb * ca + sb * sa, sb * ca - cb * sa), a.box, b.box,
        (vx * ca + vy * sa, vy * ca - vx * sa),
    )  # fmt: skip
    middle = np.abs(bz - brise + b.box.z - z + rise - a.box.z)
    share[(middle > (a.box.height + b.box.height) / 2) | (share > 1.0)] = math.inf
    share[np.maximum(np.abs(turn), np.abs(bturn)) > _STRAIGHT] = math.nan
    return share


def _step(moved: MovedRows, dt: float, rows: IntArray) -> tuple[FloatArray, ...]:
    """Poses x, y, z, h at the end of the last step, and its way dx, dy, rise (m) and turn (rad), in
    some runs (k,)."""
    x, y, z, h, vx, vy, turn = (
        getattr(moved, name)[rows] for name in ("x", "y", "z", "h", "vx", "vy", "turn")
    )
    dx, dy = vx * dt, vy * dt
    ahead = np.where(vx * np.cos(h) + vy * np.sin(h) >= 0.0, 1.0, -1.0)
    rise = -np.tan(moved.pitch[rows]) * ahead * np.hypot(dx, dy)
    return x, y, z, h, dx, dy, rise, turn - math.tau * np.round(turn / math.tau)


def _entry_arrays(
    place: tuple[FloatArray, FloatArray],
    heading: tuple[FloatArray, FloatArray],
    a: BoundingBox,
    b: BoundingBox,
    velocity: tuple[FloatArray, FloatArray],
) -> FloatArray:
    """`entry` in many cases (k,): centres of b seen from a, cosines and sines of headings,
    velocities."""
    (x, y), (c, s), (vx, vy) = place, heading, velocity
    al, aw, bl, bw = a.length / 2 + _TOUCHING, a.width / 2 + _TOUCHING, b.length / 2, b.width / 2
    cos, sin = np.abs(c), np.abs(s)
    begin, end = np.zeros_like(x), np.full_like(x, math.inf)
    for at, speed, size in (
        (x, vx, al + bl * cos + bw * sin),
        (y, vy, aw + bl * sin + bw * cos),
        (x * c + y * s, vx * c + vy * s, bl + al * cos + aw * sin),
        (y * c - x * s, vy * c - vx * s, bw + al * sin + aw * cos),
    ):
        stands = speed == 0.0
        rate = np.where(stands, 1.0, speed)
        first, last = (-size - at) / rate, (size - at) / rate
        apart = np.abs(at) > size
        begin = np.maximum(begin, np.where(stands, -math.inf, np.minimum(first, last)))
        end = np.minimum(end, np.where(stands, math.inf, np.maximum(first, last)))
        end[stands & apart] = -math.inf
    return np.where(begin > end, math.inf, begin)


def _forward(moved: Moved) -> float:
    """1 for an entity that moves ahead or stands, -1 for one in reverse."""
    return 1.0 if moved.vx * math.cos(moved.h) + moved.vy * math.sin(moved.h) >= 0.0 else -1.0


def _way(moved: Moved, dt: float, turn: float, parts: int) -> list[Spot]:
    """Poses of an entity from the start of the last step to its end, in equal parts of its time."""
    dx, dy = moved.vx * dt, moved.vy * dt
    rise = -math.tan(moved.pitch) * _forward(moved) * math.hypot(dx, dy)
    poses = []
    for part in range(parts + 1):
        left = 1.0 - part / parts
        # The chord of the arc that is left, as a share of the whole chord
        chord = math.sin(turn * left / 2) / math.sin(turn / 2) if abs(turn) > _TOUCHING else left
        bend = turn * (1.0 - left) / 2
        c, s = chord * math.cos(bend), chord * math.sin(bend)
        x, y = moved.x - dx * c + dy * s, moved.y - dy * c - dx * s
        poses.append(Spot(x, y, moved.z - rise * left, moved.h - turn * left, moved.box))
    return poses


def gap(a: Boxed, b: Boxed) -> float:
    """Shortest distance between two boxes, m; 0 where they overlap or touch.

    In the plane it is exact: the nearest points of two rectangles that do not overlap include a
    corner of one of them.
    """
    return math.hypot(plane_gap(a, b), vertical_gap(a, b))


def plane_gap(a: Boxed, b: Boxed) -> float:
    """Shortest distance between the outlines of two boxes as seen from above, m; 0 where they
    overlap or touch."""
    seen = outlook(a, b)
    return _outline_gap(seen, a.box, b.box) if _separated(seen, a.box, b.box) else 0.0


def _outline_gap(seen: Outlook, a: BoundingBox, b: BoundingBox) -> float:
    x, y, c, s = seen
    back_x, back_y = -(x * c + y * s), x * s - y * c  # the centre of a as b sees it
    return math.sqrt(min(_corner_gap(x, y, c, s, b, a), _corner_gap(back_x, back_y, c, -s, a, b)))


def _corner_gap(
    x: float, y: float, c: float, s: float, other: BoundingBox, box: BoundingBox
) -> float:
    """Squared distance of the nearest corner of `other` (centre and relative heading given) from
    `box`'s rectangle."""
    length, width = other.length / 2, other.width / 2
    half_length, half_width = box.length / 2, box.width / 2
    ahead_x, ahead_y, aside_x, aside_y = c * length, s * length, -s * width, c * width
    front_x, front_y, rear_x, rear_y = x + ahead_x, y + ahead_y, x - ahead_x, y - ahead_y
    nearest = math.inf
    for corner_x, corner_y in (
        (front_x + aside_x, front_y + aside_y),
        (rear_x + aside_x, rear_y + aside_y),
        (rear_x - aside_x, rear_y - aside_y),
        (front_x - aside_x, front_y - aside_y),
    ):
        dx = (corner_x if corner_x > 0.0 else -corner_x) - half_length
        dy = (corner_y if corner_y > 0.0 else -corner_y) - half_width
        squared = (dx * dx if dx > 0.0 else 0.0) + (dy * dy if dy > 0.0 else 0.0)
        if squared < nearest:
            nearest = squared
    return nearest


def spans(seen: Outlook, box: BoundingBox) -> tuple[float, float, float, float]:
    """Least and greatest x, least and greatest y of a box that is seen at `seen`, m."""
    cos, sin = abs(seen.cos), abs(seen.sin)
    ahead = (box.length * cos + box.width * sin) / 2
    aside = (box.length * sin + box.width * cos) / 2
    return seen.x - ahead, seen.x + ahead, seen.y - aside, seen.y + aside


def interval_gap(low_a: float, high_a: float, low_b: float, high_b: float) -> float:
    """Signed gap from interval a to interval b: positive where b lies above, negative where below,
    0 where they overlap."""
    if low_b > high_a:
        return low_b - high_a
    return high_b - low_a if high_b < low_a else 0.0


def box_corners(x: float, y: float, h: float, box: BoundingBox) -> tuple[tuple[float, float], ...]:
    """World corners of a box whose reference point is at x, y (m) with heading h (rad),
    counter-clockwise from front left."""
    c, s = math.cos(h), math.sin(h)
    front, rear = box.x + box.length / 2, box.x - box.length / 2
    left, right = box.y + box.width / 2, box.y - box.width / 2
    return (
        (x + c * front - s * left, y + s * front + c * left),
        (x + c * rear - s * left, y + s * rear + c * left),
        (x + c * rear - s * right, y + s * rear + c * right),
        (x + c * front - s * right, y + s * front + c * right),
    )
