"""Location of many world positions at once: `RoadNetwork.locate` in numpy.

Each part of a road is tried for the positions within its bounds. As in `xodr.graph.locate`, the
nearest surface counts, and where surfaces overlap height, heading and the distance from the lane's
centre decide, in this order.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schemas.common.array_types import BoolArray, FloatArray, IntArray
from xodr.graph.locate import CONVERGED, ON_SURFACE, OTHER_LEVEL
from xodr.graph.network import RoadNetwork
from xodr.lookup import arrays
from xodr.lookup.arrays import OnChord, RoadPart
from xodr.model import PERMANENT, RoadError
from xodr.model.road import Road

_MOST_STEPS, _MOST_HALVINGS = 12, 60
_FIRST_REACH, _WIDER = 5.0, 8.0
"""Roads of positions that are on none are looked for within this distance (m) first, then within so
many times as much."""


class Places(NamedTuple):
    """Road coordinates of n positions: those of `xodr.model.RoadPoint`, in
    arrays of that length.
    """

    road_id: NDArray[np.object_]
    lane_id: IntArray
    s: FloatArray
    t: FloatArray
    offset: FloatArray


def place(
    network: RoadNetwork,
    x: ArrayLike,
    y: ArrayLike,
    z: ArrayLike | None = None,
    h: ArrayLike | None = None,
) -> Places:
    """The nearest road point of each position; off the road its t lies outside the road's edges.

    Args:
        x, y: positions (n,), m.
        z, h: heights (m) and headings (rad) of road users, to decide between overlapping roads.

    Raises:
        RoadError: a position is not finite.
    """
    users = _Users(np.asarray(x, np.float64), np.asarray(y, np.float64), _given(z), _given(h))
    lost = np.flatnonzero(~np.isfinite(users.x + users.y))
    if len(lost):
        raise RoadError(
            f"({users.x[lost[0]]}, {users.y[lost[0]]}) is no place in the world", path=network.path
        )
    parts, best = _parts(network), _Best(len(users.x))
    # On a road first (reach 0); then farther and farther, until no part that is not yet asked can
    # be nearer.
    reach, left = 0.0, np.arange(len(users.x))
    while len(left):
        for part in parts:
            rows = left[part.near(users.x[left], users.y[left], reach)]
            if len(rows):
                best.offer(rows, part, users.at(rows), reach)
        left = left[best.rank[0, left] > reach]
        reach = max(_WIDER * reach, _FIRST_REACH)
    return best.places


class LanesUnder(NamedTuple):
    """Lanes of one road under some of n positions: which positions, the lane of each, its s, t and
    offset from the centre (m)."""

    road: Road
    rows: IntArray
    lane_id: IntArray
    s: FloatArray
    t: FloatArray
    offset: FloatArray


def lanes_under(
    network: RoadNetwork, x: ArrayLike, y: ArrayLike, z: ArrayLike | None = None
) -> Iterator[LanesUnder]:
    """Every lane under each position: where roads overlap, as in junctions, a position is on
    several.

    Args:
        x, y: positions (n,), m.
        z: heights (m), to leave out roads on another level.
    """
    users = _Users(np.asarray(x, np.float64), np.asarray(y, np.float64), _given(z), None)
    for part in _parts(network):
        rows = np.flatnonzero(part.near(users.x, users.y, 0.0))
        if not len(rows):
            continue
        s, t, gap = _project(
            part, users.x[rows], users.y[rows], part.on_chords(users.x[rows], users.y[rows])
        )
        on = gap == 0.0
        if users.z is not None:
            on &= np.abs(users.z[rows] - _heights(part.road, s, t)) <= OTHER_LEVEL
        if on.any():
            lane_id, offset, _ = _lanes(part.road, s[on], t[on])
            yield LanesUnder(part.road, rows[on], lane_id, s[on], t[on], offset)


@lru_cache(maxsize=8)
def _parts(network: RoadNetwork) -> list[RoadPart]:
    return [part for road in network.roads.values() for part in arrays.parts(road)]


class _Users(NamedTuple):
    x: FloatArray
    y: FloatArray
    z: FloatArray | None
    h: FloatArray | None

    def at(self, rows: IntArray) -> _Users:
        z, h = (None if values is None else values[rows] for values in (self.z, self.h))
        return _Users(self.x[rows], self.y[rows], z, h)


def _given(values: ArrayLike | None) -> FloatArray | None:
    return None if values is None else np.asarray(values, np.float64)


class _Best:
    """Best place so far of each position; `rank` is its gap and its mismatches, less is better."""

    def __init__(self, count: int) -> None:
        self.rank = np.full((4, count), np.inf)
        self.places = Places(
            np.full(count, None, object), np.zeros(count, np.int64), *np.zeros((3, count))
        )

    def offer(self, rows: IntArray, part: RoadPart, users: _Users, reach: float) -> None:
        """Take those of a part's places that are better, and not further away than `reach` (m)."""
        # Chords are cheap to ask, and most positions are too far from them to go on.
        start = part.on_chords(users.x, users.y)
        near = np.flatnonzero(start.distance <= part.room + reach)
        rows, users = rows[near], users.at(near)
        s, t, gap = _project(part, users.x, users.y, start.at(near))
        # Equal gaps, as on roads that overlap, are decided by the rest of the rank.
        nearer = gap <= self.rank[0, rows]
        rows, s, t, gap, users = (
            rows[nearer],
            s[nearer],
            t[nearer],
            gap[nearer],
            users.at(np.flatnonzero(nearer)),
        )
        lane_id, offset, against = _lanes(part.road, s, t)
        rank = np.stack([gap, *_mismatch(part, s, t, against, users), np.round(np.abs(offset), 6)])
        # Ranks are compared in lexical order, one row for all positions at a time.
        better, level = np.zeros(len(rows), bool), np.ones(len(rows), bool)
        for mine, theirs in zip(rank, self.rank[:, rows], strict=True):
            better |= level & (mine < theirs)
            level &= mine == theirs
        rows = rows[better]
        self.rank[:, rows] = rank[:, better]
        self.places.road_id[rows] = part.road.id
        for column, values in zip(self.places[1:], (lane_id, s, t, offset), strict=True):
            column[rows] = values[better]


def _project(
    part: RoadPart, x: FloatArray, y: FloatArray, start: OnChord
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """s and t of the feet of perpendiculars onto a part, and the distance of each position from its
    surface: 0 on it."""
    road, s = part.road, start.s.copy()
    moving = np.arange(len(x))
    for _ in range(_MOST_STEPS):
        ahead, aside, curvature = part.local(x[moving], y[moving], s[moving])
        following = np.clip(
            s[moving] + ahead / np.maximum(1.0 - curvature * aside, 0.1), part.s[0], part.s[-1]
        )
        step, s[moving] = np.abs(following - s[moving]), following
        # Most positions have converged after a few steps; only the others go on.
        moving = moving[step >= CONVERGED]
        if not len(moving):
            break
    if len(moving):
        s[moving] = _bisect(part, x[moving], y[moving], start.low[moving], start.high[moving])
    ahead, aside, _ = part.local(x, y, s)
    t = (
        # t_of works on one place at a time; banked roads are rare.
        aside
        if road.superelevation.constant == 0.0
        else np.array([road.t_of(*one) for one in zip(s.tolist(), aside.tolist(), strict=True)])
    )
    beside = np.maximum(_beside(road, s, t), 0.0)
    off = np.abs(ahead) > ON_SURFACE
    gap = np.where(off, np.hypot(beside, ahead), beside)
    beyond = off & (((s == 0.0) & (ahead < 0.0)) | ((s == road.length) & (ahead > 0.0)))
    return np.where(beyond, s + ahead, s), t, np.where(gap <= ON_SURFACE, 0.0, gap)


def _bisect(
    part: RoadPart, x: FloatArray, y: FloatArray, low: FloatArray, high: FloatArray
) -> FloatArray:
    """Find the s at which "ahead" changes sign; works at kinks of the line too."""
    for _ in range(_MOST_HALVINGS):
        middle = 0.5 * (low + high)
        beyond = part.local(x, y, middle).ahead > 0.0
        low, high = np.where(beyond, middle, low), np.where(beyond, high, middle)
    return 0.5 * (low + high)


def _beside(road: Road, s: FloatArray, t: FloatArray) -> FloatArray:
    """Return the distance (m) of each place outside of the road's edges; negative inside."""
    outside, section_of = np.zeros(len(s)), arrays.sections(road, s)
    for index, section in enumerate(road.sections):
        rows = section_of == index
        right, left = arrays.edges(section, s[rows])
        outside[rows] = np.maximum(right - t[rows], t[rows] - left)
    return (
        outside
        if road.permanent is None
        else np.minimum(outside, _beside(road.on(PERMANENT), s, t))
    )


def _lanes(road: Road, s: FloatArray, t: FloatArray) -> tuple[IntArray, FloatArray, BoolArray]:
    """Lane of each place, offset from its centre, whether its traffic drives towards -s; beyond the
    road's ends those there."""
    inside = np.clip(s, 0.0, road.length)
    lane_id, offset, against = np.zeros(len(s), np.int64), np.zeros(len(s)), np.zeros(len(s), bool)
    section_of = arrays.sections(road, inside)
    for index, section in enumerate(road.sections):
        rows = section_of == index
        lane_id[rows] = arrays.lanes(section, inside[rows], t[rows])
        for lane in section.lanes.values():
            mine = rows & (lane_id == lane.id)
            offset[mine] = t[mine] - arrays.values(lane.center, inside[mine])
            against[mine] = road.direction(lane.id, section.s) < 0
    return lane_id, offset, against


def _mismatch(
    part: RoadPart, s: FloatArray, t: FloatArray, against: BoolArray, users: _Users
) -> tuple[FloatArray, FloatArray]:
    """Height on another level (m), and angle between heading and the lane's
    traffic (rad, coarse).
    """
    road, height = part.road, np.zeros(len(s))
    angle: FloatArray = np.zeros(len(s))
    if users.z is not None:
        above = np.abs(users.z - _heights(road, s, t))
        height = np.where(above > OTHER_LEVEL, above, 0.0)
    if users.h is not None:
        way = part.heading(np.clip(s, part.s[0], part.s[-1])) + np.where(against, math.pi, 0.0)
        angle = np.abs(np.remainder(users.h - way + math.pi, math.tau) - math.pi).round(3)
    return height, angle


def _heights(road: Road, s: FloatArray, t: FloatArray) -> FloatArray:
    if road.flat:
        return np.zeros(len(s))
    return np.array([road.pose(*one).z for one in zip(s.tolist(), t.tolist(), strict=True)])
