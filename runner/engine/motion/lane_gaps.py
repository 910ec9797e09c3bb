"""Gaps between other participants that a lane change needs."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from runner.engine.motion.on_roads import Roads
    from runner.engine.participants.entity import Entity

STANDING_GAP = 2.0
"""Least gap (m) between bumpers at standstill"""
TIME_GAP = 0.5
"""Time (s) that the rear one of two needs to where the other one is, beyond the gap at standstill
"""
_ASIDE = 0.25
"""Least distance (m) sideways to a box in the next lane that is no obstacle"""


def blocker(
    entity: Entity, lane: int, duration: float, others: Iterable[Entity], roads: Roads
) -> Entity | None:
    """Return a participant that leaves an entity no gap in a lane of its road, or None.

    The gap has to be left at present speeds until the end of the change: the standing gap, the time
    gap of the rear one of both, and the way by which they come nearer.

    Args:
        entity: follows a lane.
        lane: to be changed to.
        duration: of the lane change, s.
        others: all participants that are there.
        roads: where they are.
    """
    return next(
        (
            other
            for other in others
            if other is not entity and _obstructs(other, entity, lane, duration, roads)
        ),
        None,
    )


def _obstructs(other: Entity, entity: Entity, lane: int, duration: float, roads: Roads) -> bool:
    speeds = abs(entity.speed), abs(other.speed)
    # Upper bound of the gap that could matter: pairs beyond it need no road coordinates.
    far = (
        entity.reach + other.reach + STANDING_GAP + TIME_GAP * max(speeds) + sum(speeds) * duration
    )
    if math.dist((entity.x, entity.y), (other.x, other.y)) > far:
        return False
    here, there = roads.road_point(entity), roads.road_point(other)
    if here is None or there is None or roads.network is None or entity.section is None:
        return False
    relative = roads.network.relative(here, there)
    if relative is None:
        return False
    to_lane = entity.section.lanes[lane].center(entity.s) - entity.t
    beside = 0.5 * (entity.box.width + other.box.width) + _ASIDE
    # Positive towards the lane to be changed to, whichever side that is.
    aside = math.copysign(relative.dt, relative.dt * to_lane)
    crossed = max(abs(lane - entity.kept_lane), 1)
    # From the first lane to be entered to the far side of the target lane: entities in the present
    # lane do not block the change.
    if not abs(to_lane) / crossed - beside < aside < abs(to_lane) + beside:
        return False
    # all along the direction that the entity faces, from its reference point
    ahead = entity.direction * relative.ds
    turn = math.cos(other.h - entity.h)
    own, theirs = entity.box.x, math.copysign(other.box.x, turn)
    apart = (ahead + theirs) - own
    gap = abs(apart) - 0.5 * (entity.box.length + other.box.length)
    speed, their_speed = entity.speed, math.copysign(1.0, turn) * other.speed
    # The rear one needs the time gap, whoever it is: the entity must not cut in closely either.
    rear, front = (speed, their_speed) if apart >= 0.0 else (their_speed, speed)
    return gap < STANDING_GAP + TIME_GAP * abs(rear) + max(rear - front, 0.0) * duration
