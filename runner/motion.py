"""How a scripted participant moves when the scenario has fixed its speed: along its lane, or straight ahead.

This module owns the entity's side of the road conventions: `along` is +1 when the entity faces increasing s,
offsets and t are positive to the left of the reference line's direction whatever the entity faces, and a
negative speed moves it backwards without turning it.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple, Protocol

from xodr.network import RoadPoint

if TYPE_CHECKING:
    from runner.entities import Entity
    from xodr.network import RoadNetwork

_ALIGNED = math.radians(45.0)
_STILL = 1e-9


class Placement(NamedTuple):
    """Where a position is: a world pose, and the road point under it where the position is tied to a road.

    x, y, z in m; h, pitch, roll in rad; `along` is +1 when h faces increasing s. `heading_offset` is h relative
    to the lane in the direction faced, rad.
    """

    x: float
    y: float
    z: float
    h: float
    pitch: float = 0.0
    roll: float = 0.0
    point: RoadPoint | None = None
    along: int = 1
    heading_offset: float = 0.0


class Motion(Protocol):
    """A way of moving; shared between entities, the state is the entity's."""

    def advance(self, entity: Entity, speed: float, dt: float) -> None:
        """Move the entity for dt (s) at a speed (m/s, signed), pose and road coordinates included."""
        ...


def wrap(angle: float) -> float:
    """Angle in (−π, π]."""
    return math.remainder(angle, math.tau)


class FreeMotion:
    """Straight ahead in the direction faced, off any lane."""

    def advance(self, entity: Entity, speed: float, dt: float) -> None:
        """Move along the heading."""
        distance = speed * dt
        entity.x += distance * math.cos(entity.h)
        entity.y += distance * math.sin(entity.h)
        entity.on_lane = False


class LaneMotion:
    """Along the lane, at its lateral offset, over road borders and through junctions.

    Args:
        network: the roads.
    """

    def __init__(self, network: RoadNetwork) -> None:
        self.network = network

    def advance(self, entity: Entity, speed: float, dt: float) -> None:
        """Move along the lane; the entity's `next_offset`, where set, is reached at the end of the step.

        A lane change is driven at the given speed along its slanting path; a lane offset moves sideways on top.
        """
        distance = speed * dt
        offset = entity.offset
        if entity.next_offset is not None:
            if entity.path_compensated:
                lateral = entity.next_offset - offset
                rest = distance * distance - lateral * lateral
                distance = math.copysign(math.sqrt(rest), distance) if rest > 0.0 else 0.0
            offset = entity.next_offset
            entity.next_offset = None
        road, t = entity.road, entity.t
        assert road is not None
        s = entity.s + entity.along * distance / (1.0 - road.curvature(entity.s) * t)
        if road.in_section(entity.s, s):
            entity.s, entity.offset = s, offset
        else:
            self._cross(entity, distance, offset)
            road = entity.road
            assert road is not None
            t = math.nan
        self._pose(entity, distance, t)

    def _cross(self, entity: Entity, distance: float, offset: float) -> None:
        """Leave the lane section: over section and road borders, or stop at the end of the road."""
        step = self.network.travel(entity, distance)
        raise NotImplementedError(step, offset)

    def _pose(self, entity: Entity, distance: float, t_before: float) -> None:
        road = entity.road
        assert road is not None
        t = road.lane_t(entity.s, entity.lane) + entity.offset
        pose = road.pose(entity.s, t)
        drift = t - t_before
        h = pose.h + entity.heading_offset
        if distance > _STILL or distance < -_STILL:
            h += math.atan2(drift, abs(distance)) if drift == drift else 0.0
        entity.t = t
        entity.x, entity.y, entity.z, entity.pitch, entity.roll = pose.x, pose.y, pose.z, pose.pitch, pose.roll
        entity.h = h if entity.along > 0 else h + math.pi
