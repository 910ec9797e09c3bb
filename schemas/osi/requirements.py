"""Requirements on objects and lanes in ground truth from the text of OSI's messages, beyond the rules at its fields.

Source: ASAM OSI 3.8: values that must not be used in ground truth, what is set for moving objects, lanes and their boundaries,
what intersections have instead, and that a lane begins where its antecessors end.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any

REQUIREMENTS = {
    "timestamp.ascends": ("error", "The timestamps of a trace ascend."),
    "values.are_finite": ("error", "Positions, angles, velocities and dimensions are numbers."),
    "orientation.in_range": ("warning", "Angles are from -pi to pi."),
    "object.is_complete": ("warning", "Objects have dimensions and pose; moving ones velocity, acceleration and rates too."),
    "object.type_is_known": ("warning", "The type of an object is not unknown in ground truth."),
    "vehicle.classification": ("warning", "Vehicles alone have a classification, which is not unknown, and bbcenter_to_rear."),
    "host.is_there": ("warning", "The host vehicle is on the lanes that are marked as the host vehicle's."),
    "assigned_lane.is_there": ("warning", "Assigned lanes are lanes of the trace."),
    "lane.is_complete": ("warning", "Lanes have a type, a centre line, boundaries on both sides, or free ones in intersections."),
    "lane.references": ("warning", "Neighbours and boundaries of a lane are in the trace."),
    "lane.begins_at_antecessor": ("warning", "The centre line of a lane begins where that of its antecessor ends."),
    "lane_boundary.is_complete": ("warning", "Boundaries have a type, a colour, two points or more, and belong to a lane."),
}  # fmt: skip
"""Level and description by name"""
NEAR = 0.05
"""Distance (m) up to which points are the same"""
_MOVING = ("dimension", "position", "orientation", "velocity", "acceleration", "orientation_rate")
_ROUND = 1e-9

Finding = tuple[str, str]


class Requirements:
    """Checks of the messages of one trace, in their order."""

    def __init__(self) -> None:
        self._before: int | None = None
        self._lanes: dict[int, Any] = {}
        self._boundaries: set[int] = set()

    def of(self, truth: Any) -> Iterator[Finding]:
        """Yield the broken requirements of a message: name and fault."""
        now = truth.timestamp.seconds * 1_000_000_000 + truth.timestamp.nanos
        if self._before is not None and now <= self._before:
            yield "timestamp.ascends", "the timestamp does not ascend"
        self._before = now
        self._lanes |= {each.id.value: each.classification for each in truth.lane}
        self._boundaries |= {each.id.value for each in truth.lane_boundary}
        for each in truth.stationary_object:
            name = f"stationary_object {each.id.value}"
            yield from _base(each.base, _MOVING[:3], name)
            if not each.classification.type:
                yield "object.type_is_known", f"{name}: the type is unknown"
        for each in truth.moving_object:
            yield from self._moving(each)
        yield from self._roads(truth)

    def _moving(self, each: Any) -> Iterator[Finding]:
        name = f"moving_object {each.id.value}"
        yield from _base(each.base, _MOVING, name)
        if not each.type:
            yield "object.type_is_known", f"{name}: the type is unknown"
        is_vehicle = each.type == each.TYPE_VEHICLE
        if each.HasField("vehicle_classification") != is_vehicle or (is_vehicle and not each.vehicle_classification.type):
            yield "vehicle.classification", f"{name}: vehicle_classification is missing, unknown, or of no vehicle"
        if is_vehicle and not each.vehicle_attributes.HasField("bbcenter_to_rear"):
            yield "vehicle.classification", f"{name}: bbcenter_to_rear is not set"
        for lane in each.moving_object_classification.assigned_lane_id:
            if lane.value not in self._lanes:
                yield "assigned_lane.is_there", f"{name}: the assigned lane {lane.value} is not in the trace"

    def _roads(self, truth: Any) -> Iterator[Finding]:
        used: set[int] = set()
        for each in truth.lane:
            lane, name = each.classification, f"lane {each.id.value}"
            yield from _lane(lane, name)
            beside = (*lane.left_adjacent_lane_id, *lane.right_adjacent_lane_id)
            sides = (*lane.left_lane_boundary_id, *lane.right_lane_boundary_id, *lane.free_lane_boundary_id)
            used |= {one.value for one in sides}
            for number in (one.value for one in beside if one.value not in self._lanes):
                yield "lane.references", f"{name}: the neighbour {number} is not in the trace"
            for number in (one.value for one in sides if one.value not in self._boundaries):
                yield "lane.references", f"{name}: the boundary {number} is not in the trace"
            yield from self._joined(lane, name)
        for each in truth.lane_boundary:
            yield from _boundary(each)
            if each.id.value not in used:
                yield "lane_boundary.is_complete", f"lane_boundary {each.id.value}: no lane has it"
        marked = {each.id.value for each in truth.lane if each.classification.is_host_vehicle_lane}
        host = {
            one.value
            for vehicle in truth.moving_object
            if truth.HasField("host_vehicle_id") and vehicle.id.value == truth.host_vehicle_id.value
            for one in vehicle.moving_object_classification.assigned_lane_id
        }
        if truth.lane and marked != host:
            yield "host.is_there", "lanes with is_host_vehicle_lane are not those that the host vehicle is assigned to"

    def _joined(self, lane: Any, name: str) -> Iterator[Finding]:
        if lane.type == lane.TYPE_INTERSECTION or not lane.centerline:
            return
        for pair in lane.lane_pairing:
            before = self._lanes.get(pair.antecessor_lane_id.value) if pair.HasField("antecessor_lane_id") else None
            if before is None or before.type == before.TYPE_INTERSECTION or not before.centerline:
                continue
            end, start = before.centerline[-1], lane.centerline[0]
            if math.dist((end.x, end.y), (start.x, start.y)) > NEAR:
                yield "lane.begins_at_antecessor", f"{name}: it does not begin where lane {pair.antecessor_lane_id.value} ends"


def _base(base: Any, fields: Iterable[str], name: str) -> Iterator[Finding]:
    for field in fields:
        axes = {"dimension": ("length", "width", "height")}.get(field, ("x", "y", "z"))
        axes = ("roll", "pitch", "yaw") if field.startswith("orientation") else axes
        value = getattr(base, field)
        if not base.HasField(field) or not all(value.HasField(axis) for axis in axes):
            yield "object.is_complete", f"{name}: {field} is not set in full"
        values = [getattr(value, axis) for axis in axes]
        if not all(map(math.isfinite, values)):
            yield "values.are_finite", f"{name}: {field} is no number"
        elif field == "orientation" and max(map(abs, values)) > math.pi + _ROUND:
            yield "orientation.in_range", f"{name}: an angle is not from -pi to pi"


def _lane(lane: Any, name: str) -> Iterator[Finding]:
    def incomplete(text: str) -> Finding:
        return "lane.is_complete", f"{name}: {text}"

    if not lane.type:
        yield incomplete("the type is unknown")
    driving = lane.type == lane.TYPE_DRIVING
    if driving and not lane.HasField("centerline_is_driving_direction"):
        yield incomplete("centerline_is_driving_direction is not set")
    if driving and len(lane.centerline) < 2:
        yield incomplete("the centre line has less than two points")
    sides, free = (*lane.left_lane_boundary_id, *lane.right_lane_boundary_id), tuple(lane.free_lane_boundary_id)
    if lane.type == lane.TYPE_INTERSECTION:
        if lane.left_adjacent_lane_id or lane.right_adjacent_lane_id or sides or not free:
            yield incomplete("intersections have free boundaries, and neither neighbours nor boundaries of sides")
    elif free or not (lane.left_lane_boundary_id and lane.right_lane_boundary_id):
        yield incomplete("lanes have a left and a right boundary, and no free ones")


def _boundary(each: Any) -> Iterator[Finding]:
    kind, name = each.classification, f"lane_boundary {each.id.value}"
    if not kind.type or not kind.color:
        yield "lane_boundary.is_complete", f"{name}: the type or colour is unknown"
    unpainted = kind.type in (kind.TYPE_NO_LINE, kind.TYPE_ROAD_EDGE, kind.TYPE_CURB, kind.TYPE_GRASS_EDGE)
    if kind.color and unpainted != (kind.color == kind.COLOR_NONE):
        yield "lane_boundary.is_complete", f"{name}: the colour is none exactly where nothing is painted"
    if len(each.boundary_line) < 2:
        yield "lane_boundary.is_complete", f"{name}: there are less than two points"
    if any(not point.HasField("position") or point.width < 0.0 or point.height < 0.0 for point in each.boundary_line):
        yield "lane_boundary.is_complete", f"{name}: a point has no position, or a width or height below 0"
