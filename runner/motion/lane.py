"""Motion along the lane, at the speed that the scenario has fixed.

This module owns the entity's side of the road conventions: `EntityState.direction` is +1 when the entity faces increasing s,
offsets and t are positive to the left of the reference line's direction whatever the entity faces, and a
negative speed moves it backwards without turning it.
"""

from __future__ import annotations

import math
from math import cos, sin
from typing import TYPE_CHECKING

from runner.motion.dynamics import Easing
from runner.motion.placement import slant
from xodr.geometry import Line
from xodr.model import RoadPoint

if TYPE_CHECKING:
    from runner.motion.placement import Placement
    from runner.participants.entity import Entity, Guide
    from xodr.model import LaneSection
    from xodr.network import RoadNetwork
    from xodr.road import Road

_SHARPEST = 1e-3
"""Lower limit of the way per s on the inner side of a curve, beyond whose centre the lane can't be followed."""


_MOVED = 1e-6
"""Distance (m) sideways that is no rounding"""


class LaneMotion:
    """Along the lane, at its lateral offset, over road borders and through junctions.

    Args:
        network: the roads.
    """

    stands = True

    def __init__(self, network: RoadNetwork) -> None:
        self.network = network

    def advance(self, entity: Entity, speed: float, dt: float) -> float:
        """Move along the lane; the entity's `target_offset`, where set, is reached at the end of the step.

        A lane change is driven at the given speed along its slanting path; a lane offset moves sideways on top. Where no action
        moves it sideways, it comes back to its place in the lane from a lane that has ended.
        """
        road, section, t = entity.road, entity.section, entity.t
        assert road is not None and section is not None
        distance, turn, controls = speed * dt, 0.0, entity.controls
        steered = controls.target_offset is not None
        if controls.easing is not None:
            self._ease(entity, controls.easing, abs(distance))
        if controls.target_offset is not None:
            distance, turn = self._sidestep(entity, distance)
        lane = section.lanes[entity.lane]
        center, constant = lane.center, lane.center.constant
        ds = entity.direction * distance
        if constant is not None and road.flat and self._glide(entity, road, section, constant + entity.offset, ds, turn):
            return speed
        if constant is None or not road.line.straight:
            per_s = 1.0 - road.line.curvature(entity.s + 0.5 * ds) * t
            slope = 0.0 if constant is not None else center.slope(entity.s)
            ds /= max(math.hypot(per_s, slope) if slope else per_s, _SHARPEST)
        s = entity.s + ds
        if section.s <= s < section.end and (constant is not None or not lane.closed(s, ds > 0.0)):
            entity.s = s
            entity.t = (center(s) if constant is None else constant) + entity.offset
            self._pose(entity, turn)
            return speed
        return self._cross(entity, distance, turn, dt, steered)

    def _glide(self, entity: Entity, road: Road, section: LaneSection, aside: float, ds: float, turn: float) -> bool:
        """Move within one element of a level road, along a lane whose centre keeps its t: most steps; false where it is not one.

        It does what `advance` and `_pose` do in general, with the element found once.

        Args:
            aside: t at the end of the step, m.
            ds: way along the lane, m.
            turn: of the way across it, rad.
        """
        line, s = road.line, entity.s
        start, end, element = line.element(s)
        middle = s + 0.5 * ds
        if not start <= middle < end:
            return False
        if type(element) is Line:
            s += ds
            if not (start <= s < end and section.s <= s < section.end):
                return False
            along, ahead, up, h = s - start, element.cos, element.sin, element.h
            entity.x, entity.y = element.x + along * ahead - aside * up, element.y + along * up + aside * ahead
        else:
            per_s = 1.0 - element.curvature(middle - start) * entity.t
            s += ds / (per_s if per_s > _SHARPEST else _SHARPEST)
            if not (start <= s < end and section.s <= s < section.end):
                return False
            x, y, h = element.at(s - start)
            entity.x, entity.y = x - aside * sin(h), y + aside * cos(h)
        direction = entity.direction
        entity.s, entity.t = s, aside
        entity.z, entity.pitch, entity.roll = 0.0, direction * 0.0, direction * 0.0
        h = h + entity.heading_offset + turn
        entity.h = h + math.pi if direction < 0 else h
        return True

    def _ease(self, entity: Entity, easing: Easing, distance: float) -> None:
        """Ask for the next offset on the way back into the lane, unless something else has moved it, or is to."""
        controls = entity.controls
        if controls.target_offset is not None or abs(entity.offset * entity.direction - easing.left) > _MOVED:
            controls.easing = None
            return
        controls.target_offset, controls.path_compensated = easing.advance(distance) * entity.direction, True
        if easing.done:
            controls.easing = None

    def _sidestep(self, entity: Entity, distance: float) -> tuple[float, float]:
        """Take the offset asked for: the distance that is left to go along the lane, and the angle of the way to it (rad)."""
        assert entity.controls.target_offset is not None
        lateral = entity.controls.target_offset - entity.offset
        entity.offset = entity.controls.target_offset
        entity.controls.target_offset = None
        left = lateral * entity.direction
        if not entity.controls.path_compensated:
            return distance, math.atan(left / distance) if abs(left) <= abs(distance) and left else 0.0
        rest = distance * distance - left * left
        turn = math.asin(max(-1.0, min(left / distance, 1.0))) if distance and left else 0.0
        return math.copysign(math.sqrt(rest), distance) if rest > 0.0 else 0.0, turn

    def _cross(self, entity: Entity, distance: float, turn: float, dt: float, steered: bool) -> float:
        """Leave the lane section, over section and road borders, or stop at the end of the road."""
        assert entity.road is not None
        backwards = distance < 0.0
        forward = (entity.direction > 0) != backwards
        point = RoadPoint(entity.road.id, entity.s, entity.t, entity.lane, entity.offset, entity.layer)
        if entity.controls.route is not None:
            point = self._on_route(point, entity.road, entity.controls.route, forward)
        choose = entity.controls.route.choose if entity.controls.route is not None else None
        drift, aside = _drift(entity), point.offset * entity.direction
        reached, forward, left = self.network.travel(point, abs(distance), forward, choose)
        reached = self._preferred(entity, reached)
        entity.road, entity.layer = self.network.road_of(reached), reached.layer
        entity.lane, entity.s, entity.t, entity.offset = reached.lane_id, reached.s, reached.t, reached.offset
        entity.section = entity.road.section(entity.s)
        entity.direction = 1 if forward != backwards else -1
        if not steered and abs(reached.offset * entity.direction - aside) > _MOVED:
            place = entity.controls.easing.place if entity.controls.easing is not None else aside
            slope = _drift(entity) - drift if backwards else drift - _drift(entity)
            easing = entity.controls.easing = Easing(place, reached.offset * entity.direction, slope, distance / dt)
            turn = math.atan(math.copysign(1.0, distance) * easing.slope)
        if entity.controls.route is not None:
            entity.controls.route.enter(reached.road_id, forward)
        self._pose(entity, turn)
        if left <= 0.0:
            return distance / dt
        entity.at_road_end = True
        entity.controls.target_speed = 0.0
        return math.copysign(max(abs(distance) - left, 0.0), distance) / dt

    def _preferred(self, entity: Entity, point: RoadPoint) -> RoadPoint:
        """The point on the layer of lanes that the entity prefers, once the layers do not differ where it is."""
        layer = entity.controls.preferred_layer
        if layer is None or layer == point.layer:
            return point
        moved = self.network.moved(point, layer)
        return moved if (moved.lane_id, moved.offset) == (point.lane_id, point.offset) else point

    def _on_route(self, point: RoadPoint, road: Road, route: Guide, forward: bool) -> RoadPoint:
        """The point, on the lane under it where that goes on along the route and the lane that it is bound for does not."""
        under = road.lane_at(point.s, point.t)
        if under == point.lane_id or road.section(point.s) is not road.sections[-1 if forward else 0]:
            return point
        own, there = (self.network.on(point.layer).links(road.id, lane, forward) for lane in (point.lane_id, under))
        if route.leads(road.id, forward, own) or not route.leads(road.id, forward, there):
            return point
        return point._replace(lane_id=under, offset=point.t - road.lane_t(point.s, under))

    def _pose(self, entity: Entity, turn: float) -> None:
        """World pose at the entity's road coordinates, facing along its lane but for the turn (rad) of a way across it."""
        road, direction = entity.road, entity.direction
        assert road is not None and entity.section is not None
        if road.flat:
            entity.x, entity.y, h = road.line.beside(entity.s, entity.t)
            entity.z, entity.pitch, entity.roll = 0.0, direction * 0.0, direction * 0.0
        else:
            entity.x, entity.y, entity.z, h, pitch, roll = road.pose(entity.s, entity.t)
            entity.pitch, entity.roll = direction * pitch, direction * roll
        if entity.section.lanes[entity.lane].center.constant is None:
            h += slant(road, entity.section, entity.lane, entity.s, entity.t)
        h = h + entity.heading_offset + turn
        entity.h = h + math.pi if direction < 0 else h

    def distance_to(self, entity: Entity, placement: Placement) -> float | None:
        """Distance (m, in s) along the entity's route, or else the shortest way, to a place; negative once passed."""
        assert entity.road is not None
        here = RoadPoint(entity.road.id, entity.s, entity.t, entity.lane, entity.offset, entity.layer)
        there = placement.point or self.network.locate(placement.x, placement.y, placement.z)
        distance: float | None = entity.controls.route.distance(here, there) if entity.controls.route is not None else None
        if distance is None:
            relative = self.network.relative(here, there)
            distance = entity.direction * relative.ds if relative is not None else None
        return -distance if distance is not None and entity.speed < 0.0 else distance


def _drift(entity: Entity) -> float:
    """Return the lateral drift (m to +t per m of s) of the centre of an entity's lane."""
    assert entity.section is not None
    center = entity.section.lanes[entity.lane].center
    return center.slope(entity.s) if center.constant is None else 0.0
