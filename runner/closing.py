"""Closing speeds: how fast the distances of `runner.distances` shrink with the present velocities, m/s.

Positive while the distance shrinks, whatever its sign; positions stand still. None where the distance is undefined.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from runner import distances
from runner.boxes import Spot, gap
from runner.entities import Entity
from runner.paths import nearest

if TYPE_CHECKING:
    from runner.motion import Placement
    from runner.simulation import Simulation
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


def longitudinal(sim: Simulation, a: Entity, b: Entity | Placement, system: str, routing: str) -> float | None:
    """Closing speed of the longitudinal distance."""
    return _closing(sim, a, b, system, routing, 0)


def lateral(sim: Simulation, a: Entity, b: Entity | Placement, system: str, routing: str) -> float | None:
    """Closing speed of the lateral distance."""
    return _closing(sim, a, b, system, routing, 1)


def _closing(sim: Simulation, a: Entity, b: Entity | Placement, system: str, routing: str, axis: int) -> float | None:
    measure = distances.lateral if axis else distances.longitudinal
    distance = measure(sim, a, b, system, False, routing)
    rates = _rates(sim, a, b, system, routing)
    if distance is None or rates is None:
        return None
    ours, theirs = rates
    return math.copysign(1.0, distance) * (ours[axis] - theirs[axis])


def _rates(
    sim: Simulation, a: Entity, b: Entity | Placement, system: str, routing: str
) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """Velocities of both along and across, towards ahead and left of a."""
    if system == "entity":
        return _turned(velocity(a), a.h), _turned(velocity(b), a.h)
    if system == "trajectory":
        path = distances.trajectory(a)
        if path is None:
            return None
        headings = [path.at(nearest(path, e.x, e.y)).h for e in (a, b)]
        return _turned(velocity(a), headings[0]), _turned(velocity(b), headings[1])
    seen = distances.bearing(sim, a, b, system == "lane", routing)
    if seen is None or sim.network is None:
        return None
    here, there = sim.network.roads[seen.a.road_id], sim.network.roads[seen.b.road_id]
    ours, theirs = _on_road(velocity(a), here, seen.a, seen.line_a), _on_road(velocity(b), there, seen.b, seen.line_b)
    side = distances.facing(a, here, seen.a.s)
    other = side if seen.aligned else -side
    return (side * ours[0], side * ours[1]), (other * theirs[0], other * theirs[1])


def _turned(v: tuple[float, float], h: float) -> tuple[float, float]:
    c, s = math.cos(h), math.sin(h)
    return v[0] * c + v[1] * s, v[1] * c - v[0] * s


def _on_road(v: tuple[float, float], road: Road, point: RoadPoint, line: float) -> tuple[float, float]:
    """How fast a road point that moves with a velocity goes on along the line at t = `line` (m), and across it."""
    along, across = _turned(v, road.heading(point.s))
    curvature = road.curvature(point.s)
    return along * (1.0 - curvature * line) / max(1.0 - curvature * point.t, _SHARPEST), across
