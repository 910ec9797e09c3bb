"""Lanes near a run, and logical lanes with reference lines of OSI ground truth, from OpenDRIVE
roads.

Sources: ASAM OSI 3.8, ReferenceLine, LogicalLaneBoundary and LogicalLane. A lane of a lane section
is a logical lane, also in junctions; its reference line is that of its road, with OpenDRIVE's s and
t. Boundaries run in the direction of the reference line. Overlaps of lanes in junctions are not
exported.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np
from shapely import LineString, dwithin
from shapely import Point as ShapelyPoint

from runner.exchange.exports.moments import box_centre
from runner.systems.outside.osi.lanes import junction_of
from xodr.lookup.arrays import sample, stations
from xodr.lookup.lanelets import ExportedLanelet, Key, lanelets

if TYPE_CHECKING:
    from runner.recording import Recording, Track
    from xodr import RoadNetwork
    from xodr.model.road import Road


_REACH = 200.0
"""Margin (m) around the paths of the entities within which lanes are exported"""


class Nearby:
    """Surroundings of the ways of all participants of a run.

    Args:
        recording: the run.
    """

    def __init__(self, recording: Recording) -> None:
        columns = [track.columns for track in recording.tracks.values()]
        # A line needs two points: the way of one instant has its point twice.
        self._ways = [
            LineString(
                np.column_stack([column["x"], column["y"]]).repeat(
                    2 if len(column["x"]) < 2 else 1, 0
                )
            )
            for column in columns
        ]

    def lanes(self, everything: Sequence[ExportedLanelet]) -> set[ExportedLanelet]:
        """Lanes within reach."""
        from shapely import STRtree

        tree = STRtree([LineString(lanelet.centre[:, :2]) for lanelet in everything])
        query = partial(tree.query, predicate="dwithin", distance=_REACH)
        numbers = {int(number) for way in self._ways for number in query(way)}
        return {everything[number] for number in numbers}

    def has(self, x: float, y: float) -> bool:
        """Whether a place (m) is within reach."""
        return any(bool(dwithin(way, ShapelyPoint(x, y), _REACH)) for way in self._ways)


def around(network: RoadNetwork, nearby: Nearby) -> list[ExportedLanelet]:
    """The lanes near the ways of the participants of a run, and the rest of their junctions."""
    everything = list(lanelets(network).values())
    near = nearby.lanes(everything)
    junctions = {junction_of(network, lanelet) for lanelet in near} - {None}
    return [lane for lane in everything if lane in near or junction_of(network, lane) in junctions]


_LOGICAL_CLOSE, _SPACING = 0.02, 2.0
"""m by which lines of fewer points may be off, and greatest distance (m) of the points that they
are chosen from"""
_TYPES = {
    "driving": "NORMAL", "bidirectional": "NORMAL", "biking": "BIKING", "sidewalk": "SIDEWALK",
    "walking": "SIDEWALK",
    "parking": "PARKING", "stop": "STOP", "restricted": "RESTRICTED", "border": "BORDER",
    "curb": "CURB", "shoulder": "SHOULDER",
    "exit": "EXIT", "mwyExit": "EXIT", "entry": "ENTRY", "mwyEntry": "ENTRY", "onRamp": "ONRAMP",
    "offRamp": "OFFRAMP",
    "connectingRamp": "CONNECTINGRAMP", "slipLane": "CONNECTINGRAMP", "median": "MEDIAN",
    "rail": "RAIL", "tram": "TRAM",
}  # fmt: skip
"""OSI's types by OpenDRIVE lane type; everything else is `OTHER`"""
_ROADS = {
    "lowSpeed", "motorway", "pedestrian", "rural", "townArterial", "townCollector",
    "townExpressway", "townLocal", "townPlayStreet", "townPrivate", "town", "bicycle",
}  # fmt: skip
"""OpenDRIVE road types that OSI has, too"""
_UNREFERENCED = {"median", "curb", "tram", "rail"}
"""Lane types whose logical lanes name no physical lane"""
_PASSING = {
    "solid": "NONE_ALLOWED", "solid solid": "NONE_ALLOWED", "broken": "BOTH_ALLOWED",
    "broken broken": "BOTH_ALLOWED",
    "solid broken": "INCREASING_T", "broken solid": "DECREASING_T",
}  # fmt: skip
"""Passing rules by road mark, read from larger to smaller t; everything else is `OTHER`"""
_SWAPPED = {"solid broken": "broken solid", "broken solid": "solid broken"}


class LogicalLanes:
    """Logical lanes of a road network.

    Args:
        network: the roads.
        chosen: the lanes, at most one of each lane of a section.
        physical: gives the id of the physical lane of a key.
        first_id: ids from here on are free.
    """

    def __init__(
        self,
        network: RoadNetwork,
        chosen: Iterable[ExportedLanelet],
        physical: Callable[[Key], int | None],
        first_id: int,
    ) -> None:
        self._network, self._physical = network, physical
        self._lanelets = {lanelet.key: lanelet for lanelet in chosen}
        roads = dict.fromkeys(key[0] for key in self._lanelets)
        borders = dict.fromkeys(border for key in self._lanelets for border in (_inner(key), key))
        numbers = iter(range(first_id, first_id + len(roads) + len(borders) + len(self._lanelets)))
        self._lines = {road: next(numbers) for road in roads}
        self._borders = {border: next(numbers) for border in borders}
        self._ids = {key: next(numbers) for key in self._lanelets}
        self.next_id = first_id + len(roads) + len(borders) + len(self._lanelets)
        """ids from here on are still free"""

    def fill(self, message: Any) -> None:
        """Add reference lines, boundaries and lanes to a GroundTruth."""
        for field in ("reference_line", "logical_lane_boundary", "logical_lane"):
            getattr(message, field).MergeFrom(getattr(self._messages, field))

    def assignments(self, track: Track) -> list[tuple[int, float, float, float] | None]:
        """Lane of the middle of a participant's box at each row: its id, s and t (m), angle to it
        (rad); None off lanes."""
        assigned: list[tuple[int, float, float, float] | None] = []
        hint = None
        heights, headings = track.columns["z"].tolist(), track.columns["h"].tolist()
        for (x, y, _), z, h in zip(box_centre(track).tolist(), heights, headings, strict=True):
            hint = self._network.locate(x, y, z, h, hint)
            # A hint keeps the search near: after a jump the whole network is looked at.
            if not self._network.on_road(hint):
                hint = self._network.locate(x, y, z, h)
            road = self._network.roads[hint.road_id]
            section = road.section(hint.s)
            number = self._ids.get((road.id, road.sections.index(section), hint.lane_id))
            turn = h - road.heading(hint.s)
            angle = math.atan2(math.sin(turn), math.cos(turn))
            assigned.append(
                (number, hint.s, hint.t, angle)
                if number is not None and self._network.on_road(hint)
                else None
            )
        return assigned

    @cached_property
    def _messages(self) -> Any:
        from osi3.osi_groundtruth_pb2 import GroundTruth

        message = GroundTruth()
        for road_id, number in self._lines.items():
            self._fill_line(message.reference_line.add(), self._network.roads[road_id], number)
        for border, number in self._borders.items():
            self._fill_boundary(message.logical_lane_boundary.add(), border, number)
        for lanelet in self._lanelets.values():
            self._fill_lane(message.logical_lane.add(), lanelet)
        return message

    def _fill_line(self, line: Any, road: Road, number: int) -> None:
        line.id.value, line.type = number, line.TYPE_POLYLINE_WITH_T_AXIS
        along = stations(road, _SPACING)
        points = sample(road, along, 0.0)
        for index in _needed(np.column_stack([points, along])):
            one = line.poly_line.add(
                s_position=float(along[index]),
                t_axis_yaw=_wrapped(road.heading(along[index]) + math.pi / 2),
            )
            one.world_position.x, one.world_position.y, one.world_position.z = points[
                index
            ].tolist()

    def _fill_boundary(self, boundary: Any, border: Key, number: int) -> None:
        road_id, section_number, lane_id = border
        road = self._network.roads[road_id]
        section = road.sections[section_number]
        lane = section.lanes[lane_id]
        along = np.array(_stations(road, section))
        aside = [lane.outer(s) for s in along.tolist()]
        points = sample(road, along, aside)
        boundary.id.value, boundary.reference_line_id.value = number, self._lines[road_id]
        mark = lane.marks[0].type if lane.marks else "none"
        # Road marks are named from the inside, which on the left of the road is the smaller t.
        rule = _PASSING.get(_SWAPPED.get(mark, mark) if lane_id > 0 else mark, "OTHER")
        boundary.passing_rule = boundary.PassingRule.Value(f"PASSING_RULE_{rule}")
        for index in _needed(np.column_stack([points, along])):
            one = boundary.boundary_line.add(
                s_position=float(along[index]), t_position=float(aside[index])
            )
            one.position.x, one.position.y, one.position.z = points[index].tolist()

    def _fill_lane(self, lane: Any, lanelet: ExportedLanelet) -> None:
        road_id, section_number, lane_id = key = lanelet.key
        road = self._network.roads[road_id]
        section = road.sections[section_number]
        forward = self._forward(key)
        lane.id.value, lane.type = (
            self._ids[key],
            lane.Type.Value(f"TYPE_{_TYPES.get(lanelet.lane_type, 'OTHER')}"),
        )
        source = lane.source_reference.add(type="net.asam.opendrive")
        source.identifier.extend([road_id, repr(section.s), str(lane_id)])
        physical = self._physical(key) if lanelet.lane_type not in _UNREFERENCED else None
        if physical is not None:
            reference = lane.physical_lane_reference.add(start_s=section.s, end_s=section.end)
            reference.physical_lane_id.value = physical
        lane.reference_line_id.value, lane.start_s, lane.end_s = (
            self._lines[road_id],
            section.s,
            section.end,
        )
        move = (
            "BOTH_ALLOWED"
            if lanelet.lane_type == "bidirectional"
            else "INCREASING_S"
            if forward
            else "DECREASING_S"
        )
        lane.move_direction = lane.MoveDirection.Value(f"MOVE_DIRECTION_{move}")
        borders = (_inner(key), key) if lane_id < 0 else (key, _inner(key))
        for border, ids in zip(
            borders, (lane.left_boundary_id, lane.right_boundary_id), strict=True
        ):
            ids.add(value=self._borders[border])
        road_type = lanelet.road_type.upper() if lanelet.road_type in _ROADS else "UNKNOWN"
        lane.road_type = lane.RoadType.Value(f"ROAD_TYPE_{road_type}")
        if lanelet.limit is not None:
            _fill_limit(lane, lanelet.limit)
        for step, relations in ((1, lane.left_adjacent_lane), (-1, lane.right_adjacent_lane)):
            # There is no lane 0: across the middle lies lane 1 or -1.
            other = (road_id, section_number, lane_id + step or step)
            if other in self._ids:
                relation = relations.add(
                    start_s=section.s,
                    end_s=section.end,
                    start_s_other=section.s,
                    end_s_other=section.end,
                )
                relation.other_lane_id.value = self._ids[other]
        # OSI's successors follow the reference line, whichever way the traffic drives.
        ahead, behind = (lane.successor_lane, lane.predecessor_lane)[:: 1 if forward else -1]
        for connections, keys, at_start in (
            (ahead, lanelet.successors, True),
            (behind, lanelet.predecessors, False),
        ):
            for other in (key for key in keys if key in self._ids):
                connection = connections.add(
                    at_begin_of_other_lane=self._forward(other) == at_start
                )
                connection.other_lane_id.value = self._ids[other]

    def _forward(self, key: Key) -> bool:
        """Whether a lane's traffic goes along the reference line."""
        road = self._network.roads[key[0]]
        return road.direction(key[2], road.sections[key[1]].s) > 0


def _fill_limit(lane: Any, limit: float) -> None:
    """Give a logical lane its speed limit (m/s), for all."""
    rule = lane.traffic_rule.add()
    rule.traffic_rule_type = rule.TRAFFIC_RULE_TYPE_SPEED_LIMIT
    rule.traffic_rule_validity.start_s, rule.traffic_rule_validity.end_s = lane.start_s, lane.end_s
    value = rule.speed_limit.speed_limit_value
    value.value, value.value_unit = limit * 3.6, value.Unit.Value("UNIT_KILOMETER_PER_HOUR")


def _inner(key: Key) -> Key:
    """Key of the inner border of a lane: the lane with that outer border; 0 is the middle."""
    road_id, section, lane = key
    return road_id, section, lane + (1 if lane < 0 else -1)


def _stations(road: Road, section: Any) -> list[float]:
    return [
        section.s,
        *(s for s in stations(road, _SPACING).tolist() if section.s < s < section.end),
        section.end,
    ]


def _needed(points: np.ndarray) -> list[int]:
    """Rows of a line (x, y, z and s) that are needed: its ends, and rows with x, y and z linear in
    s between them."""
    kept, pending = {0, len(points) - 1}, [(0, len(points) - 1)]
    while pending:
        first, last = pending.pop()
        if last - first < 2:
            continue
        inner = points[first + 1 : last]
        # By s, not by length: readers interpolate between points by s.
        share = (inner[:, 3] - points[first, 3]) / (points[last, 3] - points[first, 3])
        line = points[first, :3] + share[:, None] * (points[last, :3] - points[first, :3])
        off = np.linalg.norm(inner[:, :3] - line, axis=1)
        worst = int(off.argmax())
        if off[worst] > _LOGICAL_CLOSE:
            kept.add(first + 1 + worst)
            pending += [(first, first + 1 + worst), (first + 1 + worst, last)]
    return sorted(kept)


def _wrapped(angle: float) -> float:
    return math.atan2(math.sin(angle), math.cos(angle))
