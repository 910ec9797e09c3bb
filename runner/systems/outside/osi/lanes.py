"""Lanes and lane boundaries of OSI ground truth, from OpenDRIVE roads.

Sources: ASAM OSI 3.8, Lane and LaneBoundary. A lane of a lane section is a lane; lanes beside each
other share the boundary between them. All lanes of a junction are one lane of type intersection,
with free boundaries and no neighbours. Centre lines lead in driving direction, and begin where
those of the lanes before end.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from shapely import LineString

from xodr.lookup.lanelets import ExportedLanelet, Key, lanelets

if TYPE_CHECKING:
    from runner.recording import Track
    from xodr import RoadNetwork
    from xodr.lookup.arrays import Points


_CLOSE = 0.03
"""m by which lines of fewer points may be off; with that of the points that they are chosen from
less than 5 cm"""
_DRIVING = {
    "driving", "bidirectional", "entry", "exit", "onRamp", "offRamp", "connectingRamp", "slipLane",
    "bus", "taxi", "HOV", "mwyEntry", "mwyExit", "roadWorks", "tram", "rail",
}  # fmt: skip
"""OpenDRIVE lane types that vehicles drive on; all others are non-driving."""
_SUBTYPES = {
    "driving": "NORMAL", "bidirectional": "NORMAL", "biking": "BIKING", "sidewalk": "SIDEWALK",
    "walking": "SIDEWALK",
    "parking": "PARKING", "stop": "STOP", "restricted": "RESTRICTED", "border": "BORDER",
    "curb": "BORDER",
    "shoulder": "SHOULDER", "exit": "EXIT", "mwyExit": "EXIT", "entry": "ENTRY",
    "mwyEntry": "ENTRY", "onRamp": "ONRAMP",
    "offRamp": "OFFRAMP", "connectingRamp": "CONNECTINGRAMP", "slipLane": "CONNECTINGRAMP",
}  # fmt: skip
"""OSI's subtypes by OpenDRIVE lane type; everything else is `OTHER`."""
_LINES = {
    "none": "NO_LINE", "solid": "SOLID_LINE", "broken": "DASHED_LINE", "solid solid": "SOLID_LINE",
    "solid broken": "SOLID_LINE", "broken solid": "SOLID_LINE", "broken broken": "DASHED_LINE",
    "botts dots": "BOTTS_DOTS",
    "curb": "CURB", "grass": "GRASS_EDGE", "edge": "ROAD_EDGE",
}  # fmt: skip
"""OSI's boundary types by OpenDRIVE road mark; everything else is `OTHER`."""
_UNPAINTED = {"NO_LINE", "CURB", "GRASS_EDGE", "ROAD_EDGE"}
_COLORS = {"standard", "white", "yellow", "red", "blue", "green", "violet", "orange"}
_PAINTED = 0.12
"""m wide where the road does not say."""

Border = tuple[str, int, int]
"""A border: road id, number of the section, id of the lane that it is the outer border of; 0 is the
middle."""


class Lanes:
    """Lanes of a road network, as OSI has them.

    Args:
        network: the roads.
        chosen: the lanes, those of a junction all or none.
        first_id: ids from here on are free.
    """

    def __init__(
        self, network: RoadNetwork, chosen: Iterable[ExportedLanelet], first_id: int
    ) -> None:
        self._network = network
        self._lanelets = list(chosen)
        names: dict[Key | str, int] = {}
        for lanelet in self._lanelets:
            names.setdefault(self._junction(lanelet) or lanelet.key, first_id + len(names))
        self._ids = names
        borders = dict.fromkeys(
            border for lanelet in self._lanelets for border in self._borders(lanelet)
        )
        self._border_ids = {
            border: first_id + len(names) + number for number, border in enumerate(borders)
        }
        self.next_id = first_id + len(names) + len(borders)
        """ids from here on are still free"""

    def _junction(self, lanelet: ExportedLanelet) -> str | None:
        return junction_of(self._network, lanelet)

    def _borders(self, lanelet: ExportedLanelet) -> tuple[Border, Border]:
        """The left and the right border in driving direction."""
        road_id, section, lane = lanelet.key
        inner, outer = (road_id, section, lane + (1 if lane < 0 else -1)), (road_id, section, lane)
        forward = (
            self._network.roads[road_id].direction(
                lane, self._network.roads[road_id].sections[section].s
            )
            > 0
        )
        return (inner, outer) if (lane < 0) == forward else (outer, inner)

    def of(self, track: Track) -> list[int | None]:
        """The id of the lane that a participant is on at every row; None where it is on none."""
        columns = track.columns
        places = zip(columns["road_id"], columns["lane_id"], columns["s"], strict=True)
        return [self.at(road_id, int(lane), float(s)) for road_id, lane, s in places]

    def at(self, road_id: str | None, lane: int, s: float) -> int | None:
        """The id of a lane at a place of its road (m); None where there is none."""
        road = self._network.roads.get(str(road_id)) if road_id else None
        return (
            self.id((road.id, road.sections.index(road.section(s)), lane))
            if road is not None
            else None
        )

    def fill(self, message: Any, host: int | None) -> None:
        """Add lanes and boundaries to a GroundTruth.

        Args:
            host: id of the lane that the host vehicle is on.
        """
        message.lane.MergeFrom(self._messages.lane)
        message.lane_boundary.MergeFrom(self._messages.lane_boundary)
        for lane in message.lane:
            lane.classification.is_host_vehicle_lane = lane.id.value == host

    @cached_property
    def _messages(self) -> Any:
        from osi3.osi_groundtruth_pb2 import GroundTruth

        message, made = GroundTruth(), dict[int, Any]()
        for lanelet in self._lanelets:
            number = self._ids[self._junction(lanelet) or lanelet.key]
            if number not in made:
                made[number] = message.lane.add()
                made[number].id.value = number
            self._fill_lane(made[number].classification, lanelet)
        lines = {
            border: line for lanelet in self._lanelets for border, line in self._lines(lanelet)
        }
        for (
            each
        ) in self._lanelets:  # on a kerb the outer side of the lane counts whose border it is
            lines |= {border: line for border, line in self._lines(each) if border == each.key}
        for border, number in self._border_ids.items():
            _fill_boundary(message.lane_boundary.add(), number, *lines[border])
        return message

    def _lines(
        self, lanelet: ExportedLanelet
    ) -> Iterable[tuple[Border, tuple[Points, tuple[str, str, float | None]]]]:
        sides = (lanelet.left, lanelet.right)
        yield from zip(self._borders(lanelet), zip(sides, lanelet.paint, strict=True), strict=True)

    def _fill_lane(self, lane: Any, lanelet: ExportedLanelet) -> None:
        lane.centerline_is_driving_direction = True
        if lanelet.in_junction:
            lane.type = lane.TYPE_INTERSECTION
            _add_points(lane.centerline, lanelet.centre)
            _add_ids(
                lane.free_lane_boundary_id,
                (self._border_ids[border] for border in self._borders(lanelet)),
            )
            # Ways of a junction lead between lanes outside of it: each counts once, where it
            # enters.
            outside = [key for key in lanelet.predecessors if not self._is_inside(key)]
            if outside:
                _add_pairs(lane, self._present(outside), self._present(self._exits(lanelet.key)))
            return
        lane.type = lane.TYPE_DRIVING if lanelet.lane_type in _DRIVING else lane.TYPE_NONDRIVING
        lane.subtype = lane.Subtype.Value(f"SUBTYPE_{_SUBTYPES.get(lanelet.lane_type, 'OTHER')}")
        _add_points(lane.centerline, lanelet.centre)
        _add_pairs(lane, self._present(lanelet.predecessors), self._present(lanelet.successors))
        left, right = self._borders(lanelet)
        _add_ids(lane.left_lane_boundary_id, [self._border_ids[left]])
        _add_ids(lane.right_lane_boundary_id, [self._border_ids[right]])
        for beside, ids in zip(
            lanelet.beside, (lane.left_adjacent_lane_id, lane.right_adjacent_lane_id), strict=True
        ):
            _add_ids(ids, [self.id(beside[0])] if beside is not None else [])

    def _is_inside(self, key: Key) -> bool:
        return self._network.roads[key[0]].junction_id in self._network.junctions

    def _exits(self, key: Key) -> list[Key]:
        """The lanes that a lane of a junction leads to."""
        ahead = lanelets(self._network)[key].successors
        return [
            lane
            for following in ahead
            for lane in (self._exits(following) if self._is_inside(following) else [following])
        ]

    def _present(self, keys: Iterable[Key]) -> list[int]:
        """Ids of lanes, each once, without those too far away for export."""
        return list(dict.fromkeys(number for key in keys if (number := self.id(key)) is not None))

    def id(self, key: Key) -> int | None:
        """The id of a lane; None if it is too far away for export."""
        road = self._network.roads[key[0]]
        junction = (
            f"junction {road.junction_id}" if road.junction_id in self._network.junctions else None
        )
        return self._ids.get(junction or key)


def junction_of(network: RoadNetwork, lanelet: ExportedLanelet) -> str | None:
    """Return a name of the junction of a lane; None where it is in none."""
    return f"junction {network.roads[lanelet.key[0]].junction_id}" if lanelet.in_junction else None


def _fill_boundary(
    boundary: Any, number: int, points: Points, paint: tuple[str, str, float | None]
) -> None:
    boundary.id.value = number
    mark, color, width = paint
    kind = _LINES.get(mark, "OTHER")
    painted = kind not in _UNPAINTED
    boundary.classification.type = boundary.classification.Type.Value(f"TYPE_{kind}")
    # OpenDRIVE's colour `standard` is white.
    said = {"standard": "WHITE"}.get(color, color.upper()) if color in _COLORS else "OTHER"
    boundary.classification.color = boundary.classification.Color.Value(
        f"COLOR_{said if painted else 'NONE'}"
    )
    for place in _thinned(points):
        point = boundary.boundary_line.add()
        point.position.x, point.position.y, point.position.z = place
        point.width = (width or _PAINTED) if painted else 0.0
        point.height = 0.0


def _add_points(line: Any, points: Points) -> None:
    for x, y, z in _thinned(points):
        line.add(x=x, y=y, z=z)


def _thinned(points: Points) -> Sequence[Sequence[float]]:
    """The points of a line that are needed, its ends among them."""
    kept: list[list[float]] = np.asarray(LineString(points).simplify(_CLOSE).coords).tolist()
    return kept


def _add_ids(ids: Any, numbers: Iterable[int | None]) -> None:
    for number in numbers:
        if number is not None:
            ids.add(value=number)


def _add_pairs(lane: Any, behind: Sequence[int], ahead: Sequence[int]) -> None:
    """Each way through a lane: from one before it to one after it."""
    befores: Sequence[int | None] = behind or [None]
    afters: Sequence[int | None] = ahead or [None]
    for before in befores:
        for after in afters:
            if before is None and after is None:
                continue
            pair = lane.lane_pairing.add()
            if before is not None:
                pair.antecessor_lane_id.value = before
            if after is not None:
                pair.successor_lane_id.value = after
