"""Placement on a road: pose, and the road surface there with height, tilt and facing direction."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from xodr.model import RoadPoint, WorldPose

if TYPE_CHECKING:
    from runner.engine.participants.declaration import EntityState
    from xodr.graph.network import RoadNetwork
    from xodr.model import LaneSection
    from xodr.model.road import Road


class Placement(NamedTuple):
    """Placement: a world pose, and the road point below it if the position is tied to a road.

    x, y, z in m; h, pitch, roll in rad; `direction` is +1 when h faces increasing s.
    `heading_offset` is h relative to the lane in the direction faced, rad. `layered`: the position
    names a layer of lanes, no preference counts.
    """

    x: float
    y: float
    z: float
    h: float
    pitch: float = 0.0
    roll: float = 0.0
    point: RoadPoint | None = None
    direction: int = 1
    heading_offset: float = 0.0
    layered: bool = False


def wrap(angle: float) -> float:
    """Angle in (−π, π]."""
    return math.remainder(angle, math.tau)


_ACROSS = 1e-6
"""Angle (rad) within which a heading counts as across the road."""
_SHARPEST = 1e-3
"""Lower limit of the way per s on the inner side of a curve, beyond whose centre a lane can't be
followed."""
_OTHER_LEVEL = 2.0
"""Height (m) above or below a road's surface from which a pose has nothing to do with that road."""


def tilted(pose: WorldPose, h: float) -> tuple[float, float]:
    """Pitch and roll (rad) of something that stands on a surface and faces h, given the pose along
    the road."""
    if not (pose.pitch or pose.roll):
        return 0.0, 0.0
    turn = h - pose.h
    # A plane through the surface: the tilt seen in another heading, for small angles.
    cos, sin = math.cos(turn), math.sin(turn)
    return pose.pitch * cos - pose.roll * sin, pose.pitch * sin + pose.roll * cos


def surface(network: RoadNetwork, point: RoadPoint, h: float) -> tuple[float, float, float]:
    """z (m), pitch and roll (rad) of something that stands on the road at a point and faces h."""
    pose = network.pose(point)
    return pose.z, *tilted(pose, h)


def slant(road: Road, section: LaneSection, lane_id: int, s: float, t: float) -> float:
    """Angle (rad) between the way along a lane, at the offset that t has from its centre, and the
    road's at (s, t)."""
    # Inside a curve a metre of s is a shorter way, so the lane's slope over s is steeper over the
    # way.
    center = section.lanes[lane_id].center
    slope = 0.0 if center.constant is not None else center.slope(s)
    return math.atan(slope / max(1.0 - road.curvature(s) * t, _SHARPEST)) if slope else 0.0


def lane_heading(road: Road, point: RoadPoint) -> float:
    """Heading (rad) of the lane at a point, towards +s."""
    return road.heading(point.s) + slant(
        road, road.section(point.s), point.lane_id, point.s, point.t
    )


def facing(
    placement: Placement, road: Road, point: RoadPoint, along: float | None = None
) -> Placement:
    """The placement tied to a road point, with `direction` and `heading_offset` as its heading
    says.

    An entity across the road faces the direction of the lane's traffic.

    Args:
        along: heading towards +s that counts as straight ahead, rad; the lane's where it is not
            given.
    """
    heading = lane_heading(road, point) if along is None else along
    # Lane 0 is the reference line, which has no direction of traffic.
    direction = road.direction(point.lane_id, point.s) if point.lane_id else 1
    turn = wrap(placement.h - heading - (0.0 if direction > 0 else math.pi))
    # With a tolerance, so that rounding does not turn a pedestrian that stands exactly across the
    # road.
    if abs(turn) > math.pi / 2 + _ACROSS:
        direction, turn = -direction, wrap(turn + math.pi)
    return placement._replace(point=point, direction=direction, heading_offset=turn)


def in_world(
    network: RoadNetwork | None,
    pose: WorldPose,
    z_known: bool = True,
    hint: RoadPoint | None = None,
) -> Placement:
    """A placement at a world pose, tied to the road under it where there is one.

    Args:
        pose: where; its z counts where `z_known`, else z, pitch and roll are the surface's.
        hint: a road point close by.
    """
    placement = Placement(*pose)
    if network is None:
        return placement
    point = network.locate(pose.x, pose.y, pose.z if z_known else None, pose.h, hint)
    if not network.on_road(point):
        return placement
    surface = network.pose(point)
    if not z_known:
        pitch, roll = tilted(surface, pose.h)
        placement = placement._replace(
            z=surface.z, pitch=pose.pitch or pitch, roll=pose.roll or roll
        )
    # A pose on a bridge is not on the road below it.
    elif abs(surface.z - pose.z) > _OTHER_LEVEL:
        return placement
    return facing(placement, network.road_of(point), point)


def pose_of(entity: EntityState) -> WorldPose:
    """Return the pose of an entity, taken as level."""
    return WorldPose(entity.x, entity.y, entity.z, entity.h, 0.0, 0.0)
