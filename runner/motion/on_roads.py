"""The road network as entities move on it: where they are, and which way of moving takes them on from there."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from runner.motion.free import STRAIGHT_AHEAD
from runner.motion.lane import LaneMotion
from runner.motion.placement import Placement, in_world, lane_heading, pose_of, wrap
from xodr.model import RoadPoint

if TYPE_CHECKING:
    from runner.participants.entity import Entity
    from xodr.network import RoadNetwork

_ACROSS = math.radians(45.0)
"""Heading relative to the lane from which an entity faces across it, rad"""


_ROUNDING = 1e-3
"""Way (m) by which clearances are less than they seem: much more than places on a road are off"""


class Roads:
    """Positions of entities on a road network, and transitions between lane motion and free motion.

    Args:
        network: the roads; None where the scenario names none.
    """

    def __init__(self, network: RoadNetwork | None) -> None:
        self.network = network
        self._lane_motion = LaneMotion(network) if network is not None else None
        self.plain = network is not None and _plain(network)
        """Whether there is one straight, level road and no way round: s changes no faster than the place in the plane."""

    def road_point(self, entity: Entity) -> RoadPoint | None:
        """Return the road position of an entity; None off the road network."""
        if self.network is None:
            return None
        if entity.on_lane and entity.road is not None:
            return RoadPoint(entity.road.id, entity.s, entity.t, entity.lane, entity.offset, entity.layer)
        if entity.located_at != (entity.x, entity.y):
            entity.located_at = (entity.x, entity.y)
            layer = entity.controls.preferred_layer
            entity.located = self.network.locate(entity.x, entity.y, entity.z, entity.h, entity.located, layer)
        return entity.located

    def is_off_road(self, entity: Entity) -> bool:
        """Whether an entity's reference point is on no lane of the road network; never where there is no road network."""
        if entity.on_lane and entity.section is not None:
            lane = entity.section.lanes[entity.lane]
            width = lane.width.constant
            if lane.type != "none" and abs(entity.offset) <= (lane.width(entity.s) if width is None else width) / 2:
                return False
        point = self.road_point(entity)
        return point is not None and self.network is not None and not self.network.on_road(point)

    def is_within_lane(self, entity: Entity) -> bool:
        """Whether an entity that follows a lane is on the road wherever in this lane section it goes on at its offset."""
        if not entity.on_lane or entity.section is None:
            return False
        lane = entity.section.lanes[entity.lane]
        width = lane.width.constant
        return width is not None and lane.type != "none" and abs(entity.offset) <= width / 2

    def clearance(self, entity: Entity) -> float:
        """Return the distance (m) an entity in free motion on the road may move before it can leave the road; 0 if unknown.

        Known on straight roads whose lanes keep their widths.
        """
        point = entity.located
        if self.network is None or entity.on_lane or point is None:
            return 0.0
        road = self.network.roads[point.road_id]
        if len(road.line.segments) > 1 or not road.line.straight or road.superelevation.constant != 0.0:
            return 0.0
        section = road.section(point.s)
        if any(lane.outer.constant is None or (lane_id and lane.type == "none") for lane_id, lane in section.lanes.items()):
            return 0.0
        right, left = road.edges(point.s)
        return min(left - point.t, point.t - right, point.s - section.s, section.end - point.s) - _ROUNDING

    # ways of moving -------------------------------------------------------------------------

    def place(self, entity: Entity, placement: Placement) -> None:
        """Put an entity somewhere, at its present speed; from there it follows its lane.

        It goes straight ahead where there is no lane, or where it faces across the lane (a pedestrian about to cross).
        """
        entity.x, entity.y, entity.z = placement.x, placement.y, placement.z
        entity.h, entity.pitch, entity.roll = wrap(placement.h), placement.pitch, placement.roll
        entity.placed = True
        entity.at_road_end, entity.road_end = False, 0.0
        entity.controls.target_offset = None
        if placement.point is None or self.network is None or abs(wrap(placement.heading_offset)) > _ACROSS:
            self.leave_lane(entity)
        else:
            layer = None if placement.layered else entity.controls.preferred_layer
            point = self.network.moved(placement.point, layer or placement.point.layer)
            self.follow_lane(entity, point, placement.direction, placement.heading_offset)

    def prefer(self, entity: Entity, layer: str) -> None:
        """Let an entity keep to a layer of lanes: where its lane is of the other one, from where the layers are one again."""
        entity.controls.preferred_layer = layer
        point = self.road_point(entity)
        if point is None or self.network is None or point.layer == layer:
            return
        moved = self.network.moved(point, layer)
        if not entity.on_lane:
            entity.located = moved
        elif (moved.lane_id, moved.offset) == (point.lane_id, point.offset):
            self.follow_lane(entity, moved, entity.direction, entity.heading_offset)

    def follow_lane(self, entity: Entity, point: RoadPoint, direction: int, heading_offset: float = 0.0) -> None:
        """Let an entity follow the lane it is on, facing along (+1) or against (−1) increasing s."""
        assert self.network is not None and self._lane_motion is not None
        entity.road, entity.layer = self.network.road_of(point), point.layer
        entity.section = entity.road.section(point.s)
        entity.lane, entity.s, entity.t, entity.offset = point.lane_id, point.s, point.t, point.offset
        entity.direction, entity.heading_offset, entity.on_lane = direction, heading_offset, True
        entity.controls.motion = self._lane_motion

    def leave_lane(self, entity: Entity) -> None:
        """Let an entity go straight ahead, off any lane."""
        entity.on_lane = False
        entity.controls.motion = STRAIGHT_AHEAD

    def keep_to_road(self, entity: Entity) -> None:
        """Let an entity that goes straight ahead move along its road instead, facing as it does."""
        point = self.road_point(entity)
        if point is None or self.network is None or entity.controls.motion is not STRAIGHT_AHEAD:
            return
        turn = wrap(entity.h - lane_heading(self.network.road_of(point), point))
        direction = 1 if abs(turn) <= math.pi / 2 else -1
        self.follow_lane(entity, point, direction, turn if direction > 0 else wrap(turn + math.pi))

    def back_to_lane(self, entity: Entity) -> None:
        """Let an entity follow the lane that it is on, at the offset and heading it has; off the road, go straight ahead.

        Without any road there is nothing left to follow at the end of a path: the entity stops, as at the end of a road.
        """
        if self.network is None:
            self.leave_lane(entity)
            entity.controls.target_speed = 0.0
            return
        place = in_world(self.network, pose_of(entity), z_known=False, hint=self.road_point(entity))
        if place.point is None:
            self.leave_lane(entity)
        else:
            self.follow_lane(entity, place.point, place.direction, place.heading_offset)

    def lift(self, entity: Entity) -> None:
        """Put an entity that moves in the plane onto the road's surface."""
        point = self.road_point(entity)
        if point is None or self.network is None or self.network.roads[point.road_id].flat:
            return
        pose = self.network.pose(point)
        direction = 1.0 if math.cos(entity.h - pose.h) >= 0.0 else -1.0
        entity.z, entity.pitch, entity.roll = pose.z, direction * pose.pitch, direction * pose.roll


def _plain(network: RoadNetwork) -> bool:
    road, *others = network.roads.values()
    linked = others or road.predecessor or road.successor
    return not linked and road.flat and road.line.straight and len(road.line.segments) == 1
