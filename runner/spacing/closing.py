"""Closing speeds: how fast the distances of `runner.spacing.distances` shrink with the present velocities, m/s.

Positive while the distance shrinks, whatever its sign; positions stand still. None where the distance is undefined.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from runner.participants.boxes import Spot, gap
from runner.participants.entity import Entity
from runner.spacing import distances

if TYPE_CHECKING:
    from runner.motion.on_roads import Roads
    from runner.motion.placement import Placement
    from xodr.model import RoadPoint
    from xodr.road import Road

_MOMENT = 1e-3
"""Time (s) over which the distance of two boxes is differentiated"""
_SHARPEST = 1e-3
"""Least length of the way per length of the reference line, inside of sharp curves"""


def velocity(b: Entity | Placement) -> tuple[float, float]:
    """Velocity over ground, m/s; that of a position is zero."""
    return (b.vx, b.vy) if isinstance(b, Entity) else (0.0, 0.0)


def euclidean(a: Entity, b: Entity | Placement, freespace: bool) -> float:
    """Closing speed of the straight distance, along the line between reference points or nearest points of the boxes."""
    (vx, vy), (wx, wy) = velocity(a), velocity(b)
    if freespace:
        return (distances.euclidean(a, b, True) - _gap_after(a, b, wx - vx, wy - vy)) / _MOMENT
    dx, dy = b.x - a.x, b.y - a.y
    distance = math.sqrt(dx * dx + dy * dy + (b.z - a.z) ** 2)
    return (dx * (vx - wx) + dy * (vy - wy)) / distance if distance else 0.0


def _gap_after(a: Entity, b: Entity | Placement, vx: float, vy: float) -> float:
    """Gap a moment later, when b has moved with its velocity relative to a."""
    moved = Spot(b.x + vx * _MOMENT, b.y + vy * _MOMENT, b.z, b.h)
    return gap(a, moved._replace(box=b.box) if isinstance(b, Entity) else moved)


def longitudinal(roads: Roads, a: Entity, b: Entity | Placement, system: str, routing: str) -> float | None:
    """Closing speed of the longitudinal distance."""
    seen = _encounter(roads, a, b, system, routing)
    return math.copysign(1.0, seen.apart[0]) * (seen.own[0] - seen.other[0]) if seen is not None else None


def lateral(roads: Roads, a: Entity, b: Entity | Placement, system: str, routing: str) -> float | None:
    """Closing speed of the lateral distance."""
    seen = _encounter(roads, a, b, system, routing)
    return math.copysign(1.0, seen.apart[1]) * (seen.own[1] - seen.other[1]) if seen is not None else None


class _Encounter(NamedTuple):
    """Position of b relative to a (m) and both velocities (m/s), each ahead and to the left of a."""

    apart: tuple[float, float]
    own: tuple[float, float]
    other: tuple[float, float]


def _encounter(roads: Roads, a: Entity, b: Entity | Placement, system: str, routing: str) -> _Encounter | None:
    if system == "entity":
        return _Encounter(_turned((b.x - a.x, b.y - a.y), a.h), _turned(velocity(a), a.h), _turned(velocity(b), a.h))
    if system == "trajectory":
        return _on_trajectory(a, b)
    seen = distances.bearing(roads, a, b, system == "lane", routing)
    if seen is None or roads.network is None:
        return None
    here, there = roads.network.roads[seen.a.road_id], roads.network.roads[seen.b.road_id]
    own, other = _on_road(velocity(a), here, seen.a, seen.line_a), _on_road(velocity(b), there, seen.b, seen.line_b)
    side = distances.facing(a, here, seen.a.s)
    turn = side if seen.aligned else -side
    return _Encounter((side * seen.ds, side * seen.dt), (side * own[0], side * own[1]), (turn * other[0], turn * other[1]))


def _on_trajectory(a: Entity, b: Entity | Placement) -> _Encounter | None:
    path = distances.trajectory(a)
    if path is None:
        return None
    (s, t, h), (other_s, other_t, other_h) = distances.on_path(path, a), distances.on_path(path, b)
    return _Encounter((other_s - s, other_t - t), _turned(velocity(a), h), _turned(velocity(b), other_h))


def _turned(v: tuple[float, float], h: float) -> tuple[float, float]:
    c, s = math.cos(h), math.sin(h)
    return v[0] * c + v[1] * s, v[1] * c - v[0] * s


def _on_road(v: tuple[float, float], road: Road, point: RoadPoint, line: float) -> tuple[float, float]:
    """Return the speeds of a road point with a given velocity along the line at t = `line` and across it (m/s)."""
    along, across = _turned(v, road.heading(point.s))
    curvature = road.curvature(point.s)
    return along * (1.0 - curvature * line) / max(1.0 - curvature * point.t, _SHARPEST), across
