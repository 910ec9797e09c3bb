"""Relations of entities to one entity over time: gaps of boxes and velocities, as arrays.

All others are looked at together, one row for each of them and each instant: scenes have many
participants and few instants. On the same road gaps are measured in the road's coordinates, so that
curves and lane changes are seen as the driver sees them; otherwise in the participant's own frame.
Distances are in m, times in s, speeds in m/s.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from runner.engine.participants.declaration import BoundingBox
from runner.engine.participants.outlines import (
    Sight,
    box_distance,
    extents,
    interval_gaps,
    seen_by,
    vertical_gap,
)
from schemas.common.array_types import BoolArray, FloatArray, IntArray

if TYPE_CHECKING:
    from runner.recording import Track

STEEPEST = 0.3
"""Rise per distance between two boxes from which they are on different levels (a bridge): steeper
than any road"""
_BLOCK = 1 << 16
"""Rows of others that are looked at together, about: arrays of them fit into caches"""


@dataclass(frozen=True, eq=False)
class MotionRows:
    """One participant over time, or rows of several (`joined`).

    Args:
        name: its name.
        box: its bounding box about the reference point; of rows of several, with arrays of values.
        time: s, ascending.
        x, y, z: reference point in the world, m.
        h: heading, rad.
        speed: along the heading.
        road: id of the road, None where unknown.
        s, t: road coordinates, m.
        kind, category: as those of a `runner.recording.Track`.
        mass: kg; 0 where it is not known.
    """

    name: str
    box: BoundingBox
    time: FloatArray
    x: FloatArray
    y: FloatArray
    z: FloatArray
    h: FloatArray
    speed: FloatArray
    road: NDArray[np.object_]
    s: FloatArray
    t: FloatArray
    kind: str = "vehicle"
    category: str = "car"
    mass: float = 0.0

    @classmethod
    def from_columns(cls, name: str, box: BoundingBox, columns: Mapping[str, Any]) -> MotionRows:
        """Motion from the columns of a trajectory table (`runner.recording.COLUMNS`)."""
        values: dict[str, Any] = {
            key: np.asarray(columns[key], dtype=np.float64)
            for key in ("time", "x", "y", "z", "h", "speed", "s", "t")
        }
        return cls(name, box, road=np.asarray(columns["road_id"], dtype=object), **values)

    @classmethod
    def of(cls, track: Track) -> MotionRows:
        """The motion of a recorded participant."""
        return replace(
            cls.from_columns(track.name, track.box, track.columns),
            kind=track.kind,
            category=track.category,
            mass=track.mass,
        )

    @cached_property
    def facing(self) -> tuple[FloatArray, FloatArray]:
        """Cosine and sine of the heading."""
        return np.cos(self.h), np.sin(self.h)

    def at(self, rows: IntArray | BoolArray) -> MotionRows:
        """Motion at some of the instants."""
        sizes: tuple[Any, ...] = self.box
        box = (
            self.box if np.ndim(sizes[0]) == 0 else BoundingBox(*(values[rows] for values in sizes))
        )
        some = replace(self, box=box, **{name: getattr(self, name)[rows] for name in _ROWS})
        cos, sin = self.facing
        some.__dict__["facing"] = (
            cos[rows],
            sin[rows],
        )  # not worked out again: rows are taken of rows
        return some


_ROWS = ("time", "x", "y", "z", "h", "speed", "road", "s", "t")


@lru_cache(maxsize=1)  # several measures of one scene ask for it
def joined(motions: tuple[MotionRows, ...]) -> tuple[MotionRows, IntArray]:
    """Rows of several participants, one participant after the other, and the index of the
    participant by row."""
    sizes = [len(motion.time) for motion in motions]
    boxes = BoundingBox(
        *np.repeat(np.array([motion.box for motion in motions], np.float64).T, sizes, axis=1)
    )
    columns: dict[str, Any] = {
        name: np.concatenate([getattr(motion, name) for motion in motions]) for name in _ROWS
    }
    return MotionRows("", boxes, **columns), np.repeat(np.arange(len(motions)), sizes)


def blocks(motions: Sequence[MotionRows]) -> Iterator[tuple[MotionRows, ...]]:
    """Participants in their order, in blocks that are processed together."""
    ends = np.cumsum([len(motion.time) for motion in motions]) // _BLOCK
    for block in np.unique(ends):
        first, last = np.searchsorted(ends, [block, block + 1])
        yield tuple(motions[first:last])


class View(NamedTuple):
    """Another participant as the ego sees it.

    ahead, aside: signed gaps of the boxes: positive ahead and to the left of the ego, 0 where they
    overlap. speed, sideways: velocity of the ego, and other_speed, other_sideways: of the other,
    ahead and to the left.
    """

    ahead: FloatArray
    aside: FloatArray
    speed: FloatArray
    sideways: FloatArray
    other_speed: FloatArray
    other_sideways: FloatArray


class Relations(NamedTuple):
    """Relations of other entities to the ego while both exist, one row per entity and instant.

    rows: of the ego. who: index of the other entity. distance: shortest distance of the boxes, m.
    view: how the ego sees it.
    """

    rows: IntArray
    who: IntArray
    distance: FloatArray
    view: View


# relations ----------------------------------------------------------------------------------


def relations(ego: MotionRows, others: Sequence[MotionRows]) -> Relations:
    """Return the relations of other entities to the ego while both exist, on the same level."""
    everyone = tuple(others)
    a, b, rows, theirs, who = common(ego, everyone)
    seen = seen_by(a, b)
    distance = box_distance(a, b, seen)
    # As a slope, so that a car ahead on a hill is on the same level and a bridge is not.
    level = vertical_gap(a, b) <= STEEPEST * distance
    if not level.all():
        rows, theirs, who, distance = rows[level], theirs[level], who[level], distance[level]
        a, b, seen = a.at(level), b.at(level), Sight(*(values[level] for values in seen))
    view = in_ego_frame(a, b, seen)
    same = np.equal(a.road, b.road).astype(bool) & np.not_equal(
        a.road, np.array(None, object)
    ).astype(bool)
    if same.any():
        alone = np.zeros(len(ego.time), np.int64)
        on_road = on_road_view(
            (a, *along_road(ego, alone, rows)), (b, *along_road(*joined(everyone), theirs))
        )
        view = View(
            *(np.where(same, one, another) for one, another in zip(on_road, view, strict=True))
        )
    return Relations(rows, who, distance, view)


@lru_cache(maxsize=1)  # as `joined`
def common(
    ego: MotionRows, others: tuple[MotionRows, ...]
) -> tuple[MotionRows, MotionRows, IntArray, IntArray, IntArray]:
    """Return ego and others at their common instants, the rows of both, and the index of the other
    one by row."""
    everyone, who = joined(others)
    rows, theirs = _common(ego.time, everyone.time, who)
    return (
        ego.at(rows),
        everyone if len(theirs) == len(who) else everyone.at(theirs),
        rows,
        theirs,
        who[theirs],
    )


def _common(time: FloatArray, theirs: FloatArray, who: IntArray) -> tuple[IntArray, IntArray]:
    """Rows of both with equal time (to the microsecond), of each one's first row at a time."""
    mine, times = np.round(time * 1e6), np.round(theirs * 1e6)
    rows = np.minimum(np.searchsorted(mine, times), len(mine) - 1)
    again = np.diff(times, prepend=-np.inf) == 0.0
    again[1:] &= who[1:] == who[:-1]
    found = np.flatnonzero((mine[rows] == times) & ~again) if len(mine) else np.empty(0, np.int64)
    return rows[found], found


def in_ego_frame(a: MotionRows, b: MotionRows, seen: Sight) -> View:
    """Return b in the frame of a, along and across its heading, row by row.

    Args:
        seen: how a sees b.
    """
    _, _, c, s = seen
    rear, front, right, left = extents(seen, b.box)
    half_length, half_width = a.box.length / 2, a.box.width / 2
    return View(
        interval_gaps(-half_length, half_length, rear, front),
        interval_gaps(-half_width, half_width, right, left),
        a.speed,
        np.zeros_like(rear),
        b.speed * c,
        b.speed * s,
    )


_OnRoad = tuple[MotionRows, FloatArray, FloatArray]
"""A participant at some instants, and how it moves along its road there (`along_road`)"""


def along_road(motion: MotionRows, who: IntArray, rows: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return the motion of entities along their roads in given rows (n,).

    Args:
        motion, who: rows of one or several entities, and the entity of each row (`joined`).

    Returns:
        +1 where one faces increasing s, −1 else: by its last movement, or its next one while it has
        not moved yet. And dt/dτ, its
        lateral speed towards +t, m/s; 0 in the step in which the road changes.
    """
    begins = np.diff(who, prepend=-1) != 0
    jumps = begins.copy()
    jumps[1:] |= motion.road[1:] != motion.road[:-1]
    # Values before the first row are masked by `jumps`. Reversing is movement, not a turn.
    turns = np.where(jumps, 0.0, np.sign(np.diff(motion.s, prepend=0.0)) * np.sign(motion.speed))
    known = np.concatenate([[-1], np.flatnonzero(turns), [len(who)]])
    place = 1 + np.cumsum(turns != 0.0)[rows]
    last, following = known[place - 1], np.minimum(known[place], len(who) - 1)
    before, after = (
        (last >= 0) & (who[last] == who[rows]),
        (turns[following] != 0.0) & (who[following] == who[rows]),
    )
    side = np.where(before | after, turns[np.where(before, last, following)], 1.0)
    drift = np.where(
        jumps,
        0.0,
        np.diff(motion.t, prepend=0.0) / np.maximum(np.diff(motion.time, prepend=0.0), 1e-9),
    )
    # A first row has no step before it: it takes the rate of the next one.
    first = np.flatnonzero(begins[:-1] & ~begins[1:])
    drift[first] = drift[first + 1]
    return side, drift[rows]


def on_road_view(ego: _OnRoad, other: _OnRoad) -> View:
    """View in road coordinates, turned into the ego's direction; boxes are taken as aligned with
    the road."""
    (a, side, drift), (b, other_side, other_drift) = ego, other
    low_a, high_a, right_a, left_a = _extent(a, side)
    low_b, high_b, right_b, left_b = _extent(b, other_side)
    return View(
        side * interval_gaps(low_a, high_a, low_b, high_b),
        side * interval_gaps(right_a, left_a, right_b, left_b),
        a.speed,
        side * drift,
        side * other_side * b.speed,
        side * other_drift,
    )


def _extent(
    m: MotionRows, side: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    s, t = m.s + side * m.box.x, m.t + side * m.box.y
    return s - m.box.length / 2, s + m.box.length / 2, t - m.box.width / 2, t + m.box.width / 2
