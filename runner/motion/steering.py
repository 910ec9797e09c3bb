"""Motion of an entity off its lane that a system under test steers, or puts at a pose."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from runner.motion.free import STRAIGHT_AHEAD
from runner.motion.placement import Placement, wrap

if TYPE_CHECKING:
    from runner.motion.roads import Roads
    from runner.participants.entity import Entity

_WHEELBASE = 0.6
"""Wheelbase as a share of the length, where the file says nothing of axles."""
_SHARPEST = 1.0
"""Steering angle (rad) that front wheels can have, where the file gives no maxSteering."""


class SteeredMotion:
    """A kinematic bicycle about the rear axle, on the surface of the road: the heading turns with v·tan(δ)/L.

    Source: Rajamani, "Vehicle Dynamics and Control" (2012), 2.2, with the reference point on the rear axle.
    """

    stands = False

    def __init__(self, roads: Roads) -> None:
        self._roads = roads
        self._angle = 0.0

    def steer(self, entity: Entity, angle: float) -> None:
        """Take the entity off its lane or path and turn its front wheels, rad, positive to the left."""
        most = entity.declared.max_steering or _SHARPEST
        self._angle = max(-most, min(most, angle))
        entity.on_lane = False
        entity.controls.motion = self

    def advance(self, entity: Entity, speed: float, dt: float) -> float:
        """Move along the arc that the wheels ask for."""
        wheelbase = entity.declared.front_axle if entity.declared.front_axle > 0.0 else _WHEELBASE * entity.box.length
        turn = speed * math.tan(self._angle) / wheelbase * dt if wheelbase > 0.0 else 0.0
        h = entity.h + 0.5 * turn
        entity.x += speed * dt * math.cos(h)
        entity.y += speed * dt * math.sin(h)
        entity.h = wrap(entity.h + turn)
        self._roads.lift(entity)
        return speed

    def distance_to(self, entity: Entity, placement: Placement) -> float | None:
        """Return the distance straight ahead to the place."""
        return STRAIGHT_AHEAD.distance_to(entity, placement)


class PosedMotion:
    """Pose by pose as a system under test with a vehicle model of its own gives them, on the surface of the road."""

    stands = False

    def __init__(self, roads: Roads) -> None:
        self._roads = roads
        self._pose = (0.0, 0.0, 0.0)

    def put(self, entity: Entity, x: float, y: float, h: float) -> None:
        """Take the entity off its lane or path and give it a pose for the end of the step; m, rad."""
        self._pose = (x, y, wrap(h))
        entity.on_lane = False
        entity.controls.motion = self

    def advance(self, entity: Entity, speed: float, dt: float) -> float:
        """Move to the pose."""
        entity.x, entity.y, entity.h = self._pose
        self._roads.lift(entity)
        return speed

    def distance_to(self, entity: Entity, placement: Placement) -> float | None:
        """Return the distance straight ahead to the place."""
        return STRAIGHT_AHEAD.distance_to(entity, placement)
