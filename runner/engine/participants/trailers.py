"""Motion of trailers: the coupler stays on the tractor's hitch, the axle rolls along the trailer's
heading.

The axle's path is the tractrix of the hitch's. Where the hitch moves straight by d, the angle α
between its direction and the trailer's heading goes by tan(α/2) ~ exp(−d / L), L the length from
axle to coupler (also backwards, where it grows); each step's motion of the hitch is taken as
straight. The tractor is not influenced; its trailer may tow another one.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from runner.engine.motion.placement import surface

if TYPE_CHECKING:
    from collections.abc import Iterator

    from runner.engine.motion.on_roads import Roads
    from runner.engine.participants.entity import Entity

_STILL = 1e-9
"""Distance (m) from which no direction follows."""


def train(entity: Entity) -> Iterator[Entity]:
    """A vehicle and the trailers behind it."""
    current: Entity | None = entity
    while current is not None:
        yield current
        current = current.controls.trailer


def connect(roads: Roads, tractor: Entity, trailer: Entity) -> None:
    """Put a trailer that no action moves any more on a tractor's hitch."""
    tractor.controls.trailer, trailer.controls.tractor = trailer, tractor
    if not trailer.placed:
        line_up(roads, tractor)
    else:
        x, y = _hitch_point(tractor)
        on_hitch = math.hypot(x - trailer.x, y - trailer.y) < _STILL
        _place(
            tractor, trailer, tractor.h if on_hitch else math.atan2(y - trailer.y, x - trailer.x)
        )
        _follow(roads, trailer)


def disconnect(roads: Roads, tractor: Entity) -> None:
    """Leave a tractor's trailer standing where it is."""
    trailer = tractor.controls.trailer
    assert trailer is not None
    tractor.controls.trailer = trailer.controls.tractor = None
    for member in train(trailer):
        member.speed = member.controls.target_speed = member.acceleration = 0.0
    roads.back_to_lane(trailer)


def line_up(roads: Roads, tractor: Entity) -> None:
    """Put the trailers of an entity that has been placed straight behind it."""
    trailer = tractor.controls.trailer
    if trailer is not None:
        _place(tractor, trailer, tractor.h)
        trailer.placed = True
        _follow(roads, trailer)
        line_up(roads, trailer)


def tow(roads: Roads, tractor: Entity, dt: float) -> None:
    """Move the trailers of an entity that has moved for dt (s)."""
    trailer = tractor.controls.trailer
    if trailer is None or not trailer.active:
        return
    x, y, h = trailer.x, trailer.y, trailer.h
    _place(tractor, trailer, _pulled(tractor, trailer))
    trailer.turn = trailer.h - h
    trailer.vx, trailer.vy = (trailer.x - x) / dt, (trailer.y - y) / dt
    trailer.speed = trailer.controls.target_speed = tractor.speed
    trailer.acceleration = tractor.acceleration
    trailer.odometer += math.hypot(trailer.x - x, trailer.y - y)
    trailer.standstill = tractor.standstill
    _follow(roads, trailer)
    tow(roads, trailer, dt)


def _hitch_point(tractor: Entity) -> tuple[float, float]:
    reach = tractor.declared.hitch or 0.0
    return tractor.x + reach * math.cos(tractor.h), tractor.y + reach * math.sin(tractor.h)


def _pulled(tractor: Entity, trailer: Entity) -> float:
    """Heading (rad) of a trailer whose coupler moves straight to the hitch."""
    reach = trailer.declared.coupler or 0.0
    x, y = _hitch_point(tractor)
    dx, dy = (
        x - trailer.x - reach * math.cos(trailer.h),
        y - trailer.y - reach * math.sin(trailer.h),
    )
    distance = math.hypot(dx, dy)
    if distance < _STILL or reach <= 0.0:
        return trailer.h if reach > 0.0 else tractor.h
    direction = math.atan2(dy, dx)
    half = math.tan(0.5 * math.remainder(trailer.h - direction, math.tau))
    return direction + 2.0 * math.atan(half * math.exp(-distance / reach))


def _place(tractor: Entity, trailer: Entity, h: float) -> None:
    x, y = _hitch_point(tractor)
    reach = trailer.declared.coupler or 0.0
    trailer.h = h
    trailer.x, trailer.y = x - reach * math.cos(h), y - reach * math.sin(h)
    trailer.z, trailer.pitch, trailer.roll = tractor.z, tractor.pitch, tractor.roll
    trailer.on_lane = False


def _follow(roads: Roads, trailer: Entity) -> None:
    """Give a trailer the height and tilt of the road below its axle."""
    network = roads.network
    point = roads.road_point(trailer)
    if (
        network is None
        or point is None
        or network.roads[point.road_id].flat
        or not network.on_road(point)
    ):
        return
    trailer.z, trailer.pitch, trailer.roll = surface(network, point, trailer.h)
