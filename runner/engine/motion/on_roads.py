"""Motion on the road network: along lanes, at the speed that the scenario has fixed, and the ways
of moving that lead there.

This module owns the entity's side of the road conventions: `EntityState.direction` is +1 when the
entity faces increasing s, offsets and t are positive to the left of the reference line's direction
whatever the entity faces, and a negative speed moves it backwards without turning it.

Motion keeps to an entity's intent: `kept_lane` at `kept_offset`. `Roads.road_point` is its place,
which everything else reads.
"""

from __future__ import annotations

import math
from math import cos, sin
from typing import TYPE_CHECKING

import numpy as np

from runner.engine.motion.dynamics import Easing
from runner.engine.motion.placement import Placement, in_world, lane_heading, pose_of, slant, wrap
from runner.engine.participants.entity import LATERAL, STRAIGHT_AHEAD
from xodr.model import RoadPoint
from xodr.model.geometry import Line

if TYPE_CHECKING:
    from runner.engine.participants.entity import Entity, Guide
    from runner.engine.participants.rows import EntityRows
    from schemas.common.array_types import BoolArray, FloatArray
    from xodr.graph.network import RoadNetwork
    from xodr.model import LaneSection
    from xodr.model.road import Road

_SHARPEST = 1e-3
"""Lower limit of the way per s on the inner side of a curve, beyond whose centre the lane can't be
followed."""
_MOVED = 1e-6
"""Distance (m) sideways that is no rounding"""
_ACROSS = math.radians(45.0)
"""Heading relative to the lane from which an entity faces across it, rad"""
_ROUNDING = 1e-3
"""Way (m) by which clearances are less than they seem: much more than places on a road are off"""


class LaneMotion:
    """Along the lane, at its lateral offset, over road borders and through junctions.

    Args:
        network: the roads.
    """

    stands = True

    def __init__(self, network: RoadNetwork) -> None:
        self.network = network

    def advance(self, entity: Entity, speed: float, dt: float) -> float:
        """Move along the lane; the entity's `target_offset`, where set, is reached at the end of
        the step.

        A lane change is driven at the given speed along its slanting path; a lane offset moves
        sideways on top. Where no action moves it sideways, it comes back to its place in the lane
        from a lane that has ended.
        """
        road, section, t = entity.road, entity.section, entity.t
        assert road is not None and section is not None
        distance, turn, controls = speed * dt, 0.0, entity.controls
        # Read before the easing sets the target offset: the entity's own way back into its lane is
        # no action.
        steered = controls.target_offset is not None
        if controls.route is not None and distance:
            self._change(entity, controls.route, speed)
        if controls.easing is not None:
            self._ease(entity, controls.easing, abs(distance))
        if controls.target_offset is not None:
            distance, turn = self._sidestep(entity, distance)
        lane = section.lanes[entity.kept_lane]
        center, constant = lane.center, lane.center.constant
        ds = entity.direction * distance
        if (
            constant is not None
            and road.flat
            and self._glide(entity, road, section, constant + entity.kept_offset, ds, turn)
        ):
            return speed
        if constant is None or not road.line.straight:
            # A metre of s is 1 - κt metres at t; the curvature in the middle of the step makes it
            # second order.
            per_s = 1.0 - road.line.curvature(entity.s + 0.5 * ds) * t
            slope = 0.0 if constant is not None else center.slope(entity.s)
            ds /= max(math.hypot(per_s, slope) if slope else per_s, _SHARPEST)
        s = entity.s + ds
        # A lane may end within its section, where its width comes to 0: that is crossed like a
        # border.
        if section.s <= s < section.end and (constant is not None or not lane.closed(s, ds > 0.0)):
            entity.s = s
            entity.t = (center(s) if constant is None else constant) + entity.kept_offset
            self._pose(entity, turn)
            return speed
        return self._cross(entity, distance, turn, dt, steered)

    def _glide(
        self, entity: Entity, road: Road, section: LaneSection, aside: float, ds: float, turn: float
    ) -> bool:
        """Move within one element of a level road, along a lane whose centre keeps its t: most
        steps; false where it is not one.

        It does what `advance` and `_pose` do in general, with the element found once.

        Args:
            aside: t at the end of the step, m.
            ds: way along the lane, m.
            turn: of the way across it, rad.
        """
        line, s = road.line, entity.s
        start, end, element = line.element(s)
        middle = s + 0.5 * ds
        # The curvature in the middle of the step would be that of another element.
        if not start <= middle < end:
            return False
        # Not isinstance: arcs and spirals are other classes, and this is the path of most steps.
        if type(element) is Line:
            s += ds
            if not (start <= s < end and section.s <= s < section.end):
                return False
            along, ahead, up, h = s - start, element.cos, element.sin, element.h
            entity.x, entity.y = (
                element.x + along * ahead - aside * up,
                element.y + along * up + aside * ahead,
            )
        else:
            per_s = 1.0 - element.curvature(middle - start) * entity.t
            s += ds / (per_s if per_s > _SHARPEST else _SHARPEST)
            if not (start <= s < end and section.s <= s < section.end):
                return False
            x, y, h = element.at(s - start)
            entity.x, entity.y = x - aside * sin(h), y + aside * cos(h)
        direction = entity.direction
        entity.s, entity.t = s, aside
        # `direction * 0.0` keeps the sign of zero as `_pose` gives it: recordings have the same
        # bytes.
        entity.z, entity.pitch, entity.roll = 0.0, direction * 0.0, direction * 0.0
        h = h + entity.heading_offset + turn
        entity.h = h + math.pi if direction < 0 else h
        return True

    def advance_arrays(
        self, rows: EntityRows, speed: FloatArray, dt: float, going: BoolArray
    ) -> FloatArray:
        """`advance` in many runs (n,), where they are `going`; steps that leave a line or arc are
        done one by one."""
        offset, distance, turn = rows.kept_offset, speed * dt, None
        steered = ~np.isnan(rows.target_offset)
        is_steered = steered.any()
        if is_steered:
            distance, turn = _sidestep_arrays(rows, distance, steered)
            offset = np.where(steered, rows.target_offset, offset)
        against = rows.direction < 0
        is_against = against.any()
        ahead = np.where(against, -distance, distance) if is_against else distance
        if rows.curvature.any():
            ahead = ahead / np.maximum(1.0 - rows.curvature * rows.t, _SHARPEST)
        s, aside = rows.s + ahead, rows.center + offset
        # All rows are computed; `glides` selects those for which the result holds.
        glides = rows.gliding & (rows.low <= s) & (s < rows.high)
        x, y, h = rows.on_stretch(s, aside)
        h = h + rows.heading_offset
        if turn is not None:
            h += turn
        if is_against:
            h[against] += math.pi
        moved = {"s": s, "t": aside, "x": x, "y": y, "h": h, "kept_offset": offset}
        if glides.all():  # runs that are over go on, unseen
            for name, values in moved.items():
                setattr(rows, name, values)
            if is_steered:
                rows.target_offset = np.full_like(speed, np.nan)
            return speed
        glides &= going
        for name, values in moved.items():
            setattr(rows, name, np.where(glides, values, getattr(rows, name)))
        left = going & rows.on_lane & ~glides
        if is_steered:
            rows.target_offset = np.where(glides, np.nan, rows.target_offset)
        left &= (speed != 0.0) | ~np.isnan(rows.target_offset)
        speed = speed.copy()
        # Rare steps, over a border say, are done by the same code as in one run.
        for row in np.flatnonzero(left):
            entity = rows.load(row)
            speed[row] = self.advance(entity, float(speed[row]), dt)
            rows.store(row, entity)
        return speed

    def _change(self, entity: Entity, route: Guide, speed: float) -> None:
        """Begin to change to the lane of a route, unless an action moves the entity sideways.

        A change under way is left where the route wishes for another lane meanwhile.
        A controller of the scenario that is activated and not run would steer: the lane is its own.
        """
        controls = entity.controls
        # Towards +s if it faces +s and drives forwards, or faces -s and reverses.
        lane, room = route.lane(entity, (entity.direction > 0) == (speed > 0.0))
        busy = controls.target_offset is not None
        led = LATERAL in controls.owners or (controls.activated and controls.driver is None)
        if lane == entity.kept_lane or busy or led or entity.section is None:
            return
        lanes, under_way = entity.section.lanes, controls.easing
        shift = lanes[lane].center(entity.s) - lanes[entity.kept_lane].center(entity.s)
        side = entity.direction
        # Offsets are those from the new lane's centre from now on; the entity stays where it is,
        # and the easing brings it to its place.
        left, place, slope = (entity.kept_offset - shift) * side, entity.kept_offset * side, 0.0
        if under_way is not None:
            place, slope = under_way.place, under_way.inclination
        easing = Easing(place, left, slope, speed, room)
        if route.waits(entity, lane, easing.length):
            return
        entity.kept_lane = lane
        entity.kept_offset -= shift
        controls.easing = easing

    def _ease(self, entity: Entity, easing: Easing, distance: float) -> None:
        """Ask for the next offset on the way back into the lane, unless something else has moved
        it, or is to."""
        controls = entity.controls
        if (
            controls.target_offset is not None
            # Something else has moved it: its way no longer begins where the entity is.
            or abs(entity.kept_offset * entity.direction - easing.left) > _MOVED
        ):
            controls.easing = None
            return
        controls.target_offset, controls.path_compensated = (
            easing.advance(distance) * entity.direction,
            True,
        )
        if easing.done:
            controls.easing = None

    def _sidestep(self, entity: Entity, distance: float) -> tuple[float, float]:
        """Take the offset asked for: the distance that is left to go along the lane, and the angle
        of the way to it (rad)."""
        assert entity.controls.target_offset is not None
        lateral = entity.controls.target_offset - entity.kept_offset
        entity.kept_offset = entity.controls.target_offset
        entity.controls.target_offset = None
        left = lateral * entity.direction
        if not entity.controls.path_compensated:
            # A lane offset moves sideways on top of the way along the lane; beyond 45° it is no
            # heading.
            return distance, math.atan(left / distance) if abs(left) <= abs(
                distance
            ) and left else 0.0
        # The way along the lane is the rest of the slanting one (Pythagoras), none if it is all
        # sideways.
        rest = distance * distance - left * left
        turn = math.asin(max(-1.0, min(left / distance, 1.0))) if distance and left else 0.0
        return math.copysign(math.sqrt(rest), distance) if rest > 0.0 else 0.0, turn

    def _cross(
        self, entity: Entity, distance: float, turn: float, dt: float, steered: bool
    ) -> float:
        """Leave the lane section, over section and road borders, or stop at the end of the road."""
        assert entity.road is not None
        backwards = distance < 0.0
        # Whether it moves towards +s, whichever way it faces.
        forward = (entity.direction > 0) != backwards
        point = RoadPoint(
            entity.road.id, entity.s, entity.t, entity.kept_lane, entity.kept_offset, entity.layer
        )
        if entity.controls.route is not None:
            point = self._on_route(point, entity.road, entity.controls.route, forward)
        choose = entity.controls.route.choose if entity.controls.route is not None else None
        # Before the move: the slope and offset that the entity had in the lane that it leaves.
        drift, aside = _drift(entity), point.offset * entity.direction
        reached, forward, left = self.network.travel(point, abs(distance), forward, choose)
        reached = self._preferred(entity, reached)
        entity.road, entity.layer = self.network.road_of(reached), reached.layer
        entity.kept_lane, entity.s, entity.t, entity.kept_offset = (
            reached.lane_id,
            reached.s,
            reached.t,
            reached.offset,
        )
        entity.section = entity.road.section(entity.s)
        entity.direction = 1 if forward != backwards else -1
        # Its lane ended beside another one, so its offset has jumped while its place has not: it
        # eases back.
        if not steered and abs(reached.offset * entity.direction - aside) > _MOVED:
            place = entity.controls.easing.place if entity.controls.easing is not None else aside
            slope = _drift(entity) - drift if backwards else drift - _drift(entity)
            easing = entity.controls.easing = Easing(
                place, reached.offset * entity.direction, slope, distance / dt
            )
            turn = math.atan(math.copysign(1.0, distance) * easing.slope)
        if entity.controls.route is not None:
            entity.controls.route.enter(reached.road_id, forward)
        self._pose(entity, turn)
        if left <= 0.0:
            return distance / dt
        # No way on: it stops at the end, and stays there until an action asks for a speed again.
        entity.at_road_end = True
        entity.controls.target_speed = 0.0
        return math.copysign(max(abs(distance) - left, 0.0), distance) / dt

    def _preferred(self, entity: Entity, point: RoadPoint) -> RoadPoint:
        """The point on the layer of lanes that the entity prefers, once the layers do not differ
        where it is."""
        layer = entity.controls.preferred_layer
        if layer is None or layer == point.layer:
            return point
        moved = self.network.moved(point, layer)
        # A change of the layer where lanes differ would put the entity aside.
        return moved if (moved.lane_id, moved.offset) == (point.lane_id, point.offset) else point

    def _on_route(self, point: RoadPoint, road: Road, route: Guide, forward: bool) -> RoadPoint:
        """The point, on the lane under it where that goes on along the route and the lane that it
        is bound for does not."""
        under = road.lane_at(point.s, point.t)
        if (
            under == point.lane_id
            or road.section(point.s) is not road.sections[-1 if forward else 0]
        ):
            return point
        own, there = (
            self.network.on(point.layer).links(road.id, lane, forward)
            for lane in (point.lane_id, under)
        )
        # The lane that it is bound for is kept where it leads on, or where the one under it does
        # not either.
        if route.leads(road.id, forward, own) or not route.leads(road.id, forward, there):
            return point
        return point._replace(lane_id=under, offset=point.t - road.lane_t(point.s, under))

    def _pose(self, entity: Entity, turn: float) -> None:
        """World pose at the entity's road coordinates, facing along its lane but for the turn (rad)
        of a way across it."""
        road, direction = entity.road, entity.direction
        assert road is not None and entity.section is not None
        if road.flat:
            entity.x, entity.y, h = road.line.beside(entity.s, entity.t)
            entity.z, entity.pitch, entity.roll = 0.0, direction * 0.0, direction * 0.0
        else:
            entity.x, entity.y, entity.z, h, pitch, roll = road.pose(entity.s, entity.t)
            entity.pitch, entity.roll = direction * pitch, direction * roll
        if entity.section.lanes[entity.kept_lane].center.constant is None:
            h += slant(road, entity.section, entity.kept_lane, entity.s, entity.t)
        h = h + entity.heading_offset + turn
        entity.h = h + math.pi if direction < 0 else h

    def distance_to(self, entity: Entity, placement: Placement) -> float | None:
        """Distance (m, in s) along the entity's route, or else the shortest way, to a place;
        negative once passed."""
        assert entity.road is not None
        here = RoadPoint(
            entity.road.id, entity.s, entity.t, entity.kept_lane, entity.kept_offset, entity.layer
        )
        there = placement.point or self.network.locate(placement.x, placement.y, placement.z)
        distance: float | None = (
            entity.controls.route.distance(here, there)
            if entity.controls.route is not None
            else None
        )
        if distance is None and here.road_id == there.road_id:
            # An assigned route knows best; on one road the difference of s is enough; else the
            # network is asked.
            ahead = entity.direction * (there.s - here.s)
            # on a closed road what lies ahead is not behind, however far it is
            distance = ahead if (ahead >= 0.0) == (entity.speed >= 0.0) else None
        if distance is None:
            relative = self.network.relative(here, there)
            distance = entity.direction * relative.ds if relative is not None else None
        return -distance if distance is not None and entity.speed < 0.0 else distance


def _sidestep_arrays(
    rows: EntityRows, distance: FloatArray, steered: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """`LaneMotion._sidestep` in many runs, where they are steered; nothing of the rows changes."""
    some = np.flatnonzero(steered)
    way = distance[some]
    left = (rows.target_offset[some] - rows.kept_offset[some]) * rows.direction[some]
    part = np.divide(left, way, out=np.zeros_like(left), where=way != 0.0)
    along, turn = distance.copy(), np.zeros_like(distance)
    compensated = rows.path_compensated[some]
    if compensated.any():
        rest = np.copysign(np.sqrt(np.maximum(way * way - left * left, 0.0)), way)
        along[some] = np.where(compensated, rest, way)
        turn[some] = np.arcsin(np.clip(part, -1.0, 1.0))
    if not compensated.all():
        beside = np.where(np.abs(left) <= np.abs(way), np.arctan(part), 0.0)
        turn[some] = np.where(compensated, turn[some], beside)
    return along, turn


def _drift(entity: Entity) -> float:
    """Return the lateral drift (m to +t per m of s) of the centre of an entity's lane."""
    assert entity.section is not None
    center = entity.section.lanes[entity.kept_lane].center
    return center.slope(entity.s) if center.constant is None else 0.0


class Roads:
    """Positions of entities on a road network, and transitions between lane motion and free motion.

    Args:
        network: the roads; None where the scenario names none.
    """

    def __init__(self, network: RoadNetwork | None) -> None:
        self.network = network
        self.lane_motion = LaneMotion(network) if network is not None else None
        self.plain = network is not None and _plain(network)
        """Whether there is one straight, level road and no way round: s changes no faster than the
        place in the plane."""

    def road_point(self, entity: Entity) -> RoadPoint | None:
        """Return the place of an entity on the roads, with the lane under it; None without a road
        network."""
        if self.network is None:
            return None
        if entity.on_lane and entity.road is not None:
            lane, offset = entity.lane_below()
            return RoadPoint(entity.road.id, entity.s, entity.t, lane, offset, entity.layer)
        # Places off the lanes are searched for, which is slow: once for each place.
        if entity.located_at != (entity.x, entity.y):
            entity.located_at = (entity.x, entity.y)
            layer = entity.controls.preferred_layer
            entity.located = self.network.locate(
                entity.x, entity.y, entity.z, entity.h, entity.located, layer
            )
        return entity.located

    def is_off_road(self, entity: Entity) -> bool:
        """Whether an entity's reference point is on no lane of the road network; never where there
        is no road network."""
        if entity.on_lane and entity.section is not None:
            # Within the borders of its lane no search is needed.
            lane = entity.section.lanes[entity.kept_lane]
            width = lane.width.constant
            if (
                lane.type != "none"
                and abs(entity.kept_offset)
                <= (lane.width(entity.s) if width is None else width) / 2
            ):
                return False
        point = self.road_point(entity)
        return point is not None and self.network is not None and not self.network.on_road(point)

    def is_within_lane(self, entity: Entity) -> bool:
        """Whether an entity that follows a lane is on the road wherever in this lane section it
        goes on at its offset."""
        if not entity.on_lane or entity.section is None:
            return False
        lane = entity.section.lanes[entity.kept_lane]
        width = lane.width.constant
        return width is not None and lane.type != "none" and abs(entity.kept_offset) <= width / 2

    def clearance(self, entity: Entity) -> float:
        """Return the distance (m) an entity in free motion on the road may move before it can leave
        the road; 0 if unknown.

        It is known on straight roads with lanes of constant width.
        """
        point = entity.located
        if self.network is None or entity.on_lane or point is None:
            return 0.0
        road = self.network.roads[point.road_id]
        if (
            len(road.line.segments) > 1
            or not road.line.straight
            or road.superelevation.constant != 0.0
        ):
            return 0.0
        section = road.section(point.s)
        if any(
            lane.outer.constant is None or (lane_id and lane.type == "none")
            for lane_id, lane in section.lanes.items()
        ):
            return 0.0
        right, left = road.edges(point.s)
        return (
            min(left - point.t, point.t - right, point.s - section.s, section.end - point.s)
            - _ROUNDING
        )

    # ways of moving -------------------------------------------------------------------------

    def place(self, entity: Entity, placement: Placement) -> None:
        """Put an entity somewhere, at its present speed; from there it follows its lane.

        It goes straight ahead where there is no lane, or where it faces across the lane (a
        pedestrian about to cross).
        """
        entity.x, entity.y, entity.z = placement.x, placement.y, placement.z
        entity.h, entity.pitch, entity.roll = wrap(placement.h), placement.pitch, placement.roll
        entity.placed = True
        entity.at_road_end, entity.road_end = False, 0.0
        entity.controls.target_offset = None
        if (
            placement.point is None
            or self.network is None
            or abs(wrap(placement.heading_offset)) > _ACROSS
        ):
            self.leave_lane(entity)
        else:
            layer = None if placement.layered else entity.controls.preferred_layer
            point = self.network.moved(placement.point, layer or placement.point.layer)
            # The file may put it at an offset that is in the next lane: `settle` makes that its
            # lane.
            self.follow_lane(entity, point, placement.direction, placement.heading_offset)
            self.settle(entity)

    def advance_arrays(
        self, rows: EntityRows, speed: FloatArray, dt: float, going: BoolArray
    ) -> FloatArray:
        """Move an entity in the runs (n,) that are `going`, along its lane or straight ahead;
        return its speeds."""
        if self.lane_motion is not None and rows.on_lane.all():
            return self.lane_motion.advance_arrays(rows, speed, dt, going)
        # An array of objects compared with None itself would give one value, not a mask.
        led = going & np.not_equal(rows.motion, np.array(None, object)).astype(bool)
        free = going & ~rows.on_lane & ~led
        # Lanes come first: a path that ends in this step puts its entity on a lane, along which it
        # moves from the next step on.
        if self.lane_motion is not None:
            speed = self.lane_motion.advance_arrays(rows, speed, dt, going & rows.on_lane & ~led)
        STRAIGHT_AHEAD.advance_arrays(rows, speed, dt, free)
        if led.any():
            speed, rows.h = speed.copy(), rows.h.copy()
        for row in np.flatnonzero(led):
            entity = rows.load(row)
            speed[row] = entity.controls.motion.advance(entity, float(speed[row]), dt)
            rows.store(row, entity)
        return speed

    def stay_arrays(self, rows: EntityRows, ended: BoolArray) -> None:
        """`stay` in the runs (n,) in which lateral action has ended."""
        moved = np.where(np.isnan(rows.target_offset), rows.kept_offset, rows.target_offset)
        within = np.abs(moved) <= 0.5 * rows.width + _MOVED
        for row in np.flatnonzero(ended & rows.on_lane & (rows.guided | ~within)):
            entity = rows.load(row)
            self.stay(entity)
            rows.store(row, entity)

    def stay(self, entity: Entity) -> None:
        """After lateral action, have an entity keep to the lane that it is on, and not to the lanes
        that its route wishes for."""
        self.settle(entity)
        if entity.controls.route is not None:
            entity.controls.route.released = True

    def settle(self, entity: Entity) -> None:
        """Have an entity keep to the lane that it is on (or will be on after this step), its place
        unchanged."""
        road, section, controls = entity.road, entity.section, entity.controls
        if road is None or section is None or not entity.on_lane:
            return
        target = controls.target_offset
        moved = 0.0 if target is None else target - entity.kept_offset
        center = section.lanes[entity.kept_lane].center(entity.s)
        width = section.lanes[entity.kept_lane].width(entity.s)
        if abs(entity.kept_offset + moved) <= 0.5 * width + _MOVED:
            return
        lane = road.lane_at(entity.s, entity.t + moved)
        if lane in (0, entity.kept_lane):
            return
        shift = road.lane_t(entity.s, lane) - center
        entity.kept_lane = lane
        entity.kept_offset -= shift
        if target is not None:
            controls.target_offset = target - shift

    def prefer(self, entity: Entity, layer: str) -> None:
        """Let an entity keep to a layer of lanes: where its lane is of the other one, from where
        the layers are one again."""
        entity.controls.preferred_layer = layer
        point = self.road_point(entity)
        if point is None or self.network is None or point.layer == layer:
            return
        moved = self.network.moved(point, layer)
        if not entity.on_lane:
            entity.located = moved
        elif (moved.lane_id, moved.offset) == (point.lane_id, point.offset):
            self.follow_lane(entity, moved, entity.direction, entity.heading_offset)

    def follow_lane(
        self, entity: Entity, point: RoadPoint, direction: int, heading_offset: float = 0.0
    ) -> None:
        """Let an entity follow the lane it is on, facing along (+1) or against
        (−1) increasing s.
        """
        assert self.network is not None and self.lane_motion is not None
        entity.road, entity.layer = self.network.road_of(point), point.layer
        entity.section = entity.road.section(point.s)
        entity.kept_lane, entity.s, entity.t, entity.kept_offset = (
            point.lane_id,
            point.s,
            point.t,
            point.offset,
        )
        entity.direction, entity.heading_offset, entity.on_lane = direction, heading_offset, True
        entity.controls.motion = self.lane_motion

    def leave_lane(self, entity: Entity) -> None:
        """Let an entity go straight ahead, off any lane."""
        entity.on_lane = False
        entity.controls.motion = STRAIGHT_AHEAD

    def keep_to_road(self, entity: Entity) -> None:
        """Let an entity that goes straight ahead move along its road instead, facing as it does."""
        point = self.road_point(entity)
        if point is None or self.network is None or entity.controls.motion is not STRAIGHT_AHEAD:
            return
        # Facing the nearer of the two directions of the road.
        turn = wrap(entity.h - lane_heading(self.network.road_of(point), point))
        direction = 1 if abs(turn) <= math.pi / 2 else -1
        self.follow_lane(entity, point, direction, turn if direction > 0 else wrap(turn + math.pi))

    def back_to_lane(self, entity: Entity) -> None:
        """Let an entity follow the lane that it is on, at the offset and heading it has; off the
        road, go straight ahead.

        Without any road there is nothing left to follow at the end of a path: the entity stops, as
        at the end of a road.
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
        # Pitch and roll of the surface are told along +s; seen the other way round both change
        # their signs.
        direction = 1.0 if math.cos(entity.h - pose.h) >= 0.0 else -1.0
        entity.z, entity.pitch, entity.roll = pose.z, direction * pose.pitch, direction * pose.roll


def _plain(network: RoadNetwork) -> bool:
    road, *others = network.roads.values()
    linked = others or road.predecessor or road.successor
    return not linked and road.flat and road.line.straight and len(road.line.segments) == 1
