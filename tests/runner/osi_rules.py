"""Rules of ASAM OSI 3.8 for ground truth, and a checker of traces that follows them.

Source: the rules in the standard's reference of fields (`is_set`, `is_globally_unique`, `refers_to`, `is_greater_than…`), its
requirements of lanes (which must have centre lines, boundaries, neighbours; what intersections have instead), and its rule that
the centre line of a lane begins where those of its antecessors end.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Any

NEAR = 0.05
"""m"""


def broken(messages: Sequence[Any]) -> list[str]:
    """What breaks a rule in a trace of GroundTruth messages: the number of the message, the place and the rule."""
    found = [f"message {number}: {text}" for number, message in enumerate(messages) for text in _message(message)]
    for number, (before, after) in enumerate(pairwise(messages), start=1):
        if _seconds(after) <= _seconds(before):
            found.append(f"message {number}: timestamp: does not grow")
        if _clash(before, after):
            found.append(f"message {number}: id: is of another thing than before")
    return found


def _seconds(message: Any) -> float:
    return float(message.timestamp.seconds + message.timestamp.nanos / 1e9)


def _things(message: Any) -> Iterator[tuple[str, Any]]:
    for kind in ("stationary_object", "moving_object", "lane", "lane_boundary"):
        yield from ((kind, each) for each in getattr(message, kind))


def _kinds(message: Any) -> set[tuple[int, str]]:
    return {(each.id.value, kind) for kind, each in _things(message)}


def _clash(before: Any, after: Any) -> bool:
    kinds = dict(_kinds(before))
    return any(kinds.get(number, kind) != kind for number, kind in _kinds(after))


def _message(message: Any) -> Iterator[str]:
    for field in ("version", "timestamp", "host_vehicle_id"):
        if not message.HasField(field):
            yield f"{field}: is_set"
    if message.timestamp.seconds < 0 or not 0 <= message.timestamp.nanos < 1_000_000_000:
        yield "timestamp: is_greater_than_or_equal_to 0, nanos is_less_than 1 s"
    ids = [each.id.value for _, each in _things(message)]
    if len(ids) != len(set(ids)):
        yield "id: is_globally_unique"
    if message.host_vehicle_id.value not in {each.id.value for each in message.moving_object}:
        yield "host_vehicle_id: refers_to: MovingObject"
    for each in message.stationary_object:
        yield from _base(each.base, ("dimension", "position", "orientation"), "stationary_object")
        if not each.classification.type:
            yield "stationary_object.classification.type: is not unknown"
    lanes = {each.id.value for each in message.lane}
    for each in message.moving_object:
        yield from _moving(each, lanes)
    yield from _roads(message, lanes)


def _moving(each: Any, lanes: set[int]) -> Iterator[str]:
    fields = ("dimension", "position", "orientation", "velocity", "acceleration", "orientation_rate")
    yield from _base(each.base, fields, "moving_object")
    if not each.type:
        yield "moving_object.type: is not unknown"
    is_vehicle = each.type == each.TYPE_VEHICLE
    if each.HasField("vehicle_classification") != is_vehicle or (is_vehicle and not each.vehicle_classification.type):
        yield "moving_object.vehicle_classification: check_if type is TYPE_VEHICLE, else is not set; is not unknown"
    if is_vehicle and not each.vehicle_attributes.HasField("bbcenter_to_rear"):
        yield "moving_object.vehicle_attributes.bbcenter_to_rear: is_set"
    yield from _refer(each.moving_object_classification.assigned_lane_id, lanes, "moving_object: assigned_lane_id: Lane")


def _base(base: Any, fields: Iterable[str], name: str) -> Iterator[str]:
    for field in fields:
        axes = {"dimension": ("length", "width", "height")}.get(field, ("x", "y", "z"))
        axes = ("roll", "pitch", "yaw") if field.startswith("orientation") else axes
        value = getattr(base, field)
        if not base.HasField(field) or not all(value.HasField(axis) for axis in axes):
            yield f"{name}.base.{field}: is_set"
        if not all(math.isfinite(getattr(value, axis)) for axis in axes):
            yield f"{name}.base.{field}: is finite"
        if field == "dimension" and min(getattr(value, axis) for axis in axes) < 0.0:
            yield f"{name}.base.dimension: is_greater_than_or_equal_to 0"
        if field == "orientation" and max(abs(getattr(value, axis)) for axis in axes) > math.pi + 1e-9:
            yield f"{name}.base.orientation: is between -pi and pi"


def _refer(ids: Iterable[Any], to: set[int], name: str) -> Iterator[str]:
    if any(each.value not in to for each in ids):
        yield f"{name}: refers_to"


def _roads(message: Any, lanes: set[int]) -> Iterator[str]:
    boundaries = {each.id.value for each in message.lane_boundary}
    by_id = {each.id.value: each.classification for each in message.lane}
    used: set[int] = set()
    for each in message.lane:
        lane, name = each.classification, f"lane {each.id.value}"
        if not lane.type:
            yield f"{name}: type: is not unknown"
        if not lane.HasField("is_host_vehicle_lane") or not lane.HasField("centerline_is_driving_direction"):
            yield f"{name}: is_host_vehicle_lane, centerline_is_driving_direction: is_set"
        if len(lane.centerline) < 2:
            yield f"{name}: centerline: has two points or more"
        beside = (*lane.left_adjacent_lane_id, *lane.right_adjacent_lane_id)
        sides = (*lane.left_lane_boundary_id, *lane.right_lane_boundary_id)
        free = tuple(lane.free_lane_boundary_id)
        yield from _refer(beside, lanes, f"{name}: adjacent lane: Lane")
        yield from _refer((*sides, *free), boundaries, f"{name}: boundary: LaneBoundary")
        used |= {each.value for each in (*sides, *free)}
        if lane.type == lane.TYPE_INTERSECTION:
            if beside or sides or not free:
                yield f"{name}: intersections have free boundaries, and neither neighbours nor boundaries of sides"
        else:
            if free or not (lane.left_lane_boundary_id and lane.right_lane_boundary_id):
                yield f"{name}: lanes have a left and a right boundary, and no free ones"
            yield from _joined(lane, by_id, name)
        for pair in lane.lane_pairing:
            yield from _refer(
                [pair.antecessor_lane_id] if pair.HasField("antecessor_lane_id") else [], lanes, f"{name}: antecessor"
            )
            yield from _refer([pair.successor_lane_id] if pair.HasField("successor_lane_id") else [], lanes, f"{name}: successor")
    if used != boundaries:
        yield "lane_boundary: is of a lane"
    for each in message.lane_boundary:
        yield from _boundary(each)
    host = [each.value for vehicle in message.moving_object if vehicle.id.value == message.host_vehicle_id.value
            for each in vehicle.moving_object_classification.assigned_lane_id]  # fmt: skip
    if [number for number, lane in by_id.items() if lane.is_host_vehicle_lane] != host:
        yield "is_host_vehicle_lane: is the lane that the host vehicle is assigned to"


def _joined(lane: Any, by_id: dict[int, Any], name: str) -> Iterator[str]:
    """Lanes begin where the ones before them end; neighbours know each other."""
    for pair in lane.lane_pairing:
        before = by_id.get(pair.antecessor_lane_id.value) if pair.HasField("antecessor_lane_id") else None
        if before is not None and before.type != before.TYPE_INTERSECTION:
            end, start = before.centerline[-1], lane.centerline[0]
            if math.dist((end.x, end.y), (start.x, start.y)) > NEAR:
                yield f"{name}: centerline: begins where that of its antecessor ends"


def _boundary(each: Any) -> Iterator[str]:
    kind, name = each.classification, f"lane_boundary {each.id.value}"
    if not kind.type or not kind.color:
        yield f"{name}: type, color: is not unknown"
    unpainted = kind.type in (kind.TYPE_NO_LINE, kind.TYPE_ROAD_EDGE, kind.TYPE_CURB, kind.TYPE_GRASS_EDGE)
    if unpainted != (kind.color == kind.COLOR_NONE):
        yield f"{name}: color: is none where nothing is painted"
    if len(each.boundary_line) < 2:
        yield f"{name}: boundary_line: has two points or more"
    if any(not point.HasField("position") or point.width < 0.0 or point.height < 0.0 for point in each.boundary_line):
        yield f"{name}: boundary_line: position is_set, width and height is_greater_than_or_equal_to 0"
