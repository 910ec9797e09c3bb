"""Lanelet2 maps: lanes as lanelets that share nodes and ways, and lanelets as lanes.

Source: Lanelet2 documentation, "LaneletPrimitives", "LaneletAndAreaTagging", "LinestringTagging",
"RegulatoryElementTagging". Nodes have latitude and longitude (11 decimals, 1 µm), and the
coordinates of the map as `local_x`, `local_y` and `ele`. The root element has the projection and
the offset of these as the attributes `xosc_projection` and `xosc_offset`, which Lanelet2 does not
read; without a projection latitudes and longitudes are those of metres about 0, 0.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from lxml import etree

from schemas.common.array_types import FloatArray
from schemas.common.errors import InvalidFile
from schemas.common.terminal.text import finite_number
from schemas.common.xml import parse
from xodr.formats.lanelet2 import Lanelet
from xodr.formats.lanelet2.borders import TOUCHING, completed
from xodr.formats.lanelet2.reader import read_lanelets
from xodr.formats.lanelet2.signs import MADE, element_tags, face, way_tags
from xodr.formats.maps.lane_map import (
    LaneMap,
    LanesByPlace,
    MapCrosswalk,
    MapLane,
    MapPole,
    MapSignal,
    MapStopLine,
    at_lengths,
    gone,
    heights_on,
    sides_of,
    with_area,
)
from xodr.formats.maps.projecting import Projector

_NEAR = 0.02
"""Points nearer to each other than this (m) are one node."""
_TURNED = 2.0
"""Length (m) of a border that turns where its end is moved."""
_DECIMALS = 4
"""Decimals of local coordinates"""
_GAP = 1.0
"""Ends of linked lanes further apart than this (m) are not joined."""
_NOWHERE = ("+proj=utm +zone=31 +datum=WGS84 +units=m +no_defs", (166021.4431793306, 0.0, 0.0, 0.0))
"""Projection of maps without one, with its offset: about latitude 0, longitude 0."""
_LINES = {
    "solid": ("line_thin", "solid"), "broken": ("line_thin", "dashed"),
    "solid solid": ("line_thin", "solid_solid"),
    "solid broken": ("line_thin", "solid_dashed"), "broken solid": ("line_thin", "dashed_solid"),
    "curb": ("curbstone", "high"),
    "broken broken": ("line_thin", "dashed"),
}  # fmt: skip
"""Type and subtype of ways by road mark; others are virtual."""
_SUBTYPES = {
    "biking": ("bicycle_lane", "bicycle"), "sidewalk": ("walkway", "pedestrian"),
    "walking": ("walkway", "pedestrian"),
    "bus": ("bus_lane", "vehicle:bus"), "shoulder": ("emergency_lane", "vehicle:emergency"),
    "stop": ("emergency_lane", "vehicle:emergency"), "exit": ("exit", "vehicle"),
    "offRamp": ("exit", "vehicle"),
    "rail": ("rail", "vehicle"), "tram": ("rail", "vehicle"),
}  # fmt: skip
"""Subtype of lanelets and their participant by lane type; others are roads or highways."""
_AREAS = {
    "border": "keepout", "median": "traffic_island", "curb": "keepout", "restricted": "keepout",
    "parking": "parking",
}  # fmt: skip
"""Subtypes of areas by lane types that are no lanelets."""
_TWO_WAY = {"sidewalk", "walking"}
_SIDES = ("left", "right")
_WALK = {"type": "pedestrian_marking"}
_CROSSWALK_TAGS = {
    "type": "lanelet", "subtype": "crosswalk", "location": "urban", "one_way": "no",
    "participant:pedestrian": "yes",
}  # fmt: skip
_RANK = {"type": "regulatory_element", "subtype": "right_of_way"}
_URBAN = {"motorway": "nonurban", "rural": "nonurban"}


class _OsmWriter:
    """Nodes, ways and relations of a map."""

    def __init__(self, lane_map: LaneMap) -> None:
        self.root = etree.Element("osm", version="0.6", generator="xosc-toolchain", upload="false")
        if lane_map.projection is not None:
            self.root.set("xosc_projection", lane_map.projection)
            self.root.set("xosc_offset", " ".join(repr(part) for part in lane_map.offset))
        self.nodes: list[tuple[float, float, float]] = []
        self._cells: dict[tuple[int, int], list[int]] = {}
        self._ways: dict[tuple[int, ...], int] = {}
        self._tags: dict[int, dict[str, str]] = {}
        self.poles: dict[int, dict[str, str]] = {}

    def node(self, place: Iterable[float]) -> int:
        """Number of the node at a place, made where there is none."""
        x, y, z = place
        # A near node may lie beyond the border of its cell.
        cell = (math.floor(x / _NEAR), math.floor(y / _NEAR))
        for i in (-1, 0, 1):
            for j in (-1, 0, 1):
                for number in self._cells.get((cell[0] + i, cell[1] + j), ()):
                    if math.dist(self.nodes[number], (x, y, z)) < _NEAR:
                        return number
        self.nodes.append((x, y, z))
        self._cells.setdefault(cell, []).append(len(self.nodes) - 1)
        return len(self.nodes) - 1

    def pole(self, pole: MapPole) -> None:
        """Make a node of its own, with tags."""
        height = {"height": f"{pole.height:.4f}"} if pole.height else {}
        self.poles[len(self.nodes)] = {"type": "pole", "name": pole.id, **height}
        self.nodes.append(pole.place)

    def line(self, line: FloatArray) -> tuple[int, ...]:
        """The nodes of a line, without repetitions."""
        numbers = [self.node(place) for place in line.tolist()]
        kept = [numbers[0], *(b for a, b in pairwise(numbers) if a != b)]
        return tuple(kept)

    def length(self, nodes: tuple[int, ...]) -> float:
        """Length (m) in the plane, as the reader measures it."""
        places = np.round([self.nodes[number][:2] for number in nodes], _DECIMALS)
        return float(np.hypot(*np.diff(places, axis=0).T).sum())

    def way(self, nodes: tuple[int, ...], tags: dict[str, str]) -> int:
        """Number of the way through nodes, either way round; a mark counts more than none."""
        # Either way round: neighbours of opposite directions share a way, which each reads from its
        # own side.
        found = self._ways.get(nodes, self._ways.get(nodes[::-1]))
        if found is None:
            found = self._ways[nodes] = len(self._ways)
            self._tags[found] = tags
        # Neighbours share a way; where only one of them knows its mark, that is it.
        elif self._tags[found]["type"] == "virtual":
            self._tags[found] = tags
        return found

    def relation(
        self, number: int, members: Iterable[tuple[str, int, str]], tags: dict[str, str]
    ) -> None:
        """Write a relation with members (type, number, role)."""
        relation = etree.SubElement(
            self.root, "relation", id=str(number), visible="true", version="1"
        )
        for kind, ref, role in members:
            etree.SubElement(relation, "member", type=kind, ref=str(ref), role=role)
        _add_tags(relation, tags)

    def ways(self) -> Iterable[tuple[int, tuple[int, ...], dict[str, str]]]:
        """All ways with their numbers, nodes and tags."""
        return ((number, nodes, self._tags[number]) for nodes, number in self._ways.items())


class _Rule(NamedTuple):
    """A regulatory element: the lanes that refer to it, its ways and lanelets with their roles, and
    its tags."""

    lanes: Collection[str]
    ways: list[tuple[int, str]]
    lanelets: list[tuple[str, str]]
    tags: dict[str, str]


def write(lane_map: LaneMap) -> tuple[bytes, list[str]]:
    """The content of a file, and what is changed or left out, one sentence each."""
    writer, notes = _OsmWriter(lane_map), []
    lanes = {name: lane for name, lane in lane_map.lanes.items() if lane.type != "none"}
    if len(lanes) < len(lane_map.lanes):
        notes.append(f"{len(lane_map.lanes) - len(lanes)} lanes of type none are left out")
    bounds = _bounds(writer, lanes, notes)
    driven = {name for name in bounds if lanes[name].type not in _AREAS}
    stops = [
        (line, writer.way(writer.line(line.line), {"type": "stop_line", "name": line.id}))
        for line in lane_map.stop_lines
    ]
    rules = [
        *_lights(writer, lane_map, driven, stops),
        *_ranks(lane_map, driven, stops),
        *_signs(writer, lane_map, stops),
    ]
    for pole in lane_map.poles:
        writer.pole(pole)
    walks = [
        [writer.way(writer.line(side), _WALK) for side in sides_of(area.outline)]
        for area in lane_map.crosswalks
    ]
    # Last of all that makes nodes: their numbers, which ways have, are those of this order.
    _write_nodes(writer, lane_map)
    offset = len(writer.nodes) + 1
    for number, nodes, tags in writer.ways():
        way = etree.SubElement(
            writer.root, "way", id=str(offset + number), visible="true", version="1"
        )
        for node in nodes:
            etree.SubElement(way, "nd", ref=str(node + 1))
        _add_tags(way, tags)
    # Ids go on from nodes over ways to relations, so that none is used twice.
    first = offset + len(writer._ways)
    ids = {name: first + number for number, name in enumerate(bounds)}
    first += len(ids)
    held: dict[str, list[int]] = defaultdict(list)
    for number, rule in enumerate(rules, first):
        for name in rule.lanes:
            held[name].append(number)
    for name, ways in bounds.items():
        roles = ("outer",) * len(ways) if lanes[name].type in _AREAS else _SIDES
        members = [("way", offset + way, role) for way, role in zip(ways, roles, strict=True)]
        members += [("relation", number, "regulatory_element") for number in held[name]]
        writer.relation(ids[name], members, _lane_tags(lanes[name], name))
    for number, rule in enumerate(rules, first):
        members = [("way", offset + way, role) for way, role in rule.ways]
        members += [("relation", ids[name], role) for name, role in rule.lanelets]
        writer.relation(number, members, rule.tags)
    first += len(rules)
    for number, (area, sides) in enumerate(zip(lane_map.crosswalks, walks, strict=True), first):
        members = [("way", offset + way, role) for way, role in zip(sides, _SIDES, strict=True)]
        writer.relation(number, members, {**_CROSSWALK_TAGS, "name": area.id})
    if lane_map.projection is None:
        notes.append(
            "the map has no projection: latitudes and longitudes are those of its metres about 0, 0"
        )
    etree.indent(writer.root)
    return etree.tostring(writer.root, xml_declaration=True, encoding="UTF-8") + b"\n", notes


def _bounds(
    writer: _OsmWriter, lanes: dict[str, MapLane], notes: list[str]
) -> dict[str, tuple[int, ...]]:
    """The ways of lanes: their borders, and of areas the ends between these as well."""
    ends = _joined_ends(lanes, notes)
    bounds: dict[str, tuple[int, ...]] = {}
    short: list[str] = []
    for name, lane in lanes.items():
        lines = [
            _with_ends(line, ends, (name, side))
            for side, line in (("left", lane.left), ("right", lane.right))
        ]
        left, right = (writer.line(line) for line in lines)
        # Such a lane could not be read again. Measured as written: near points became one node.
        if min(writer.length(nodes) for nodes in (left, right)) <= TOUCHING:
            short.append(name)
            continue
        ways = [(left, _mark_tags(lane.marks[0][0])), (right, _mark_tags(lane.marks[1][0]))]
        if lane.type in _AREAS:
            # Where an area narrows to a point, its borders close it themselves.
            closing = [(left[at], right[at]) for at in (-1, 0) if left[at] != right[at]]
            ways += [(nodes, {"type": "virtual"}) for nodes in closing]
        bounds[name] = tuple(writer.way(nodes, tags) for nodes, tags in ways)
    if short:
        notes.append(
            f"lanes are left out, since a border of them is shorter than {TOUCHING:g} m: "
            f"{' '.join(short)}"
        )
    return bounds


def _joined_ends(
    lanes: dict[str, MapLane], notes: list[str]
) -> dict[tuple[str, str, int], FloatArray]:
    """Ends of borders that are moved to where the lane before or after them begins: Lanelet2 links
    by shared nodes."""
    places: dict[tuple[str, str, int], FloatArray] = {}
    parents: dict[tuple[str, str, int], tuple[str, str, int]] = {}

    def root(key: tuple[str, str, int]) -> tuple[str, str, int]:
        while parents.get(key, key) != key:
            key = parents[key]
        return key

    apart = 0
    for name, lane in lanes.items():
        for following in lane.successors:
            other = lanes.get(following)
            if other is None:
                continue
            pairs = [((name, side, -1), (following, side, 0)) for side in ("left", "right")]
            gaps = [
                np.linalg.norm(getattr(lane, side)[-1] - getattr(other, side)[0])
                for side in ("left", "right")
            ]
            # The mean of such ends would bend both lanes by metres.
            if max(gaps) > _GAP:
                apart += 1
                continue
            for one, two in pairs:
                a, b = root(one), root(two)
                if a != b:
                    # The smaller key is the root, so that the same map gives the same file.
                    parents[max(a, b)] = min(a, b)
    if apart:
        notes.append(f"{apart} connections are lost: their lanes end more than {_GAP:g} m apart")
    groups: dict[tuple[str, str, int], list[tuple[str, str, int]]] = {}
    for key in [*parents, *parents.values()]:
        groups.setdefault(root(key), [])
        if key not in groups[root(key)]:
            groups[root(key)].append(key)
    for members in groups.values():
        points = np.array([getattr(lanes[name], side)[at] for name, side, at in members])
        # The mean moves each end by the least.
        for key in members:
            places[key] = points.mean(axis=0)
    return places


def _with_ends(
    line: FloatArray, ends: dict[tuple[str, str, int], FloatArray], key: tuple[str, str]
) -> FloatArray:
    """A border with its ends moved; of a long stretch beside an end only the last metres turn."""
    moved, length = line.copy(), gone(line)[-1]
    for at in (0, -1):
        goal = ends.get((*key, at))
        if goal is None:
            continue
        # A point more, so that a straight border of hundreds of metres does not turn as a whole.
        if np.linalg.norm(goal - moved[at]) > _NEAR and length > 2.0 * _TURNED:
            inner = gone(moved)
            away = _TURNED if at == 0 else inner[-1] - _TURNED
            place = int(np.searchsorted(inner, away))
            moved = np.insert(moved, place, at_lengths(moved, np.array([away])), axis=0)
        moved[at] = goal
    return moved


def _mark_tags(mark: str) -> dict[str, str]:
    kind = _LINES.get(mark)
    return {"type": kind[0], "subtype": kind[1]} if kind is not None else {"type": "virtual"}


def _lane_tags(lane: MapLane, name: str) -> dict[str, str]:
    if lane.type in _AREAS:
        return _area_tags(lane, name)
    subtype, participant = _SUBTYPES.get(
        lane.type, ("highway" if lane.road_type == "motorway" else "road", "vehicle")
    )
    tags = {
        "type": "lanelet", "subtype": subtype, "location": _URBAN.get(lane.road_type, "urban"),
        "one_way": "no" if lane.type in _TWO_WAY else "yes", f"participant:{participant}": "yes",
        "lane_type": lane.type, "road_type": lane.road_type, "name": name,
    }  # fmt: skip
    # Roads are for bicycles too, by Lanelet2's German traffic rules.
    if subtype == "road":
        tags["participant:bicycle"] = "yes"
    if lane.limit is not None:
        tags["speed_limit"] = f"{lane.limit * 3.6:.6f}".rstrip("0").rstrip(".") + " km/h"
    if lane.in_junction:
        tags["junction"] = "yes"
    return tags


def _area_tags(lane: MapLane, name: str) -> dict[str, str]:
    """Tags of a lane that is an area; its first two ways are its borders."""
    tags = {"type": "multipolygon", "subtype": _AREAS[lane.type], "name": name}
    return {**tags, "lane_type": lane.type, "road_type": lane.road_type}


_Stops = list[tuple[MapStopLine, int]]
"""Stop lines with their ways"""


def _across(stops: _Stops, lanes: Collection[str]) -> list[tuple[int, str]]:
    """The stop lines of lanes, in their role."""
    return [(way, "ref_line") for line, way in stops if not set(lanes).isdisjoint(line.lanes)]


def _lights(
    writer: _OsmWriter, lane_map: LaneMap, driven: Collection[str], stops: _Stops
) -> Iterator[_Rule]:
    """The lights, each with its face and the stop lines of the lanes that it holds, or else one
    across the end of the first of these."""
    for signal in lane_map.signals:
        held = [name for name in signal.lanes if name in driven]
        if signal.kind != "light" or not held:
            continue
        bulb = writer.way(
            writer.line(face(signal.place, signal.heading)),
            {"type": "traffic_light", "subtype": "red_yellow_green"},
        )
        lines = _across(stops, held)
        # Autoware wants a stop line for each light.
        if not lines:
            lane = lane_map.lanes[held[0]]
            line = writer.line(np.array([lane.left[-1], lane.right[-1]]))
            lines = [(writer.way(line, {"type": "stop_line", "note": MADE}), "ref_line")]
        tags = {"type": "regulatory_element", "subtype": "traffic_light", "name": signal.id}
        yield _Rule(held, [(bulb, "refers"), *lines], [], tags)


def _ranks(lane_map: LaneMap, driven: Collection[str], stops: _Stops) -> Iterator[_Rule]:
    """The right of way of each lane over others, with the lines at which these stop."""
    before = defaultdict[str, list[str]](list)
    for lane in lane_map.lanes.values():
        for name in lane.successors:
            before[name].append(lane.id)
    ranks: dict[str, list[str]] = {}
    for high, low in lane_map.priorities:
        if high in driven and low in driven:
            ranks.setdefault(high, []).append(low)
    for high, lows in ranks.items():
        roles = [(high, "right_of_way"), *((low, "yield") for low in lows)]
        # The lanes before those that yield: a stop line lies at their ends.
        waiting = [*lows, *(name for low in lows for name in before[low])]
        lines = _across(stops, waiting)
        yield _Rule({high: None, **dict.fromkeys(lows)}, lines, roles, _RANK)


_STOP = ("206", "R1-1")
"""Stop signs of Germany and the United States"""


def _signs(writer: _OsmWriter, lane_map: LaneMap, stops: _Stops) -> Iterator[_Rule]:
    """The signs, each with its face; stop signs with their stop lines."""
    for sign in lane_map.signals:
        if sign.kind == "sign":
            way = writer.way(writer.line(face(sign.place, sign.heading)), way_tags(sign))
            lines = _across(stops, sign.lanes) if sign.type in _STOP else []
            yield _Rule(sign.lanes, [(way, "refers"), *lines], [], element_tags(sign))


def _write_nodes(writer: _OsmWriter, lane_map: LaneMap) -> None:
    # Without a projection the metres are put down about 0, 0, to be read back the same way.
    projector = Projector(*_NOWHERE) if lane_map.projection is None else Projector.of(lane_map)
    assert projector is not None
    longitude, latitude, _ = projector.to_geodetic(np.array(writer.nodes).reshape(-1, 3))
    for number, ((x, y, z), east, north) in enumerate(
        zip(writer.nodes, longitude, latitude, strict=True), 1
    ):
        node = etree.SubElement(
            writer.root,
            "node",
            id=str(number),
            visible="true",
            version="1",
            lat=f"{north:.11f}",
            lon=f"{east:.11f}",
        )
        local = {"local_x": x, "local_y": y, "ele": z}
        _add_tags(node, {key: f"{value:.{_DECIMALS}f}" for key, value in local.items()})
        _add_tags(node, writer.poles.get(number - 1, {}))


def _add_tags(element: etree._Element, tags: dict[str, str]) -> None:
    for key, value in tags.items():
        etree.SubElement(element, "tag", k=key, v=value)


# reading ----------------------------------------------------------------------------------------


def read(path: Path, origin: tuple[float, float] | None = None) -> LaneMap:
    """The lanes of a file.

    Args:
        origin: latitude and longitude (degrees) of the origin of its UTM coordinates; None for the
            file's local coordinates, or the origin 0, 0 where it has none.

    Raises:
        InvalidFile: malformed, or without lanelets; names file, line and element.
        UsageError: the origin is no place on Earth.
    """
    found = read_lanelets(path, origin)
    lanes, added = completed(found.lanes)
    made = {one.id: _map_lane(one, found.surveyed) for one in lanes}
    for one in lanes:
        for before in one.predecessors:
            if before in made and one.id not in made[before].successors:
                made[before].successors.append(one.id)
        for side, beside in ((0, one.beside_left), (1, one.beside_right)):
            if beside is not None and beside.id in made:
                _put_beside(made, one.id, beside.id, beside.same_direction, side)
    lights: dict[str, list[str]] = {}
    for one in lanes:
        for light in one.lights:
            lights.setdefault(light, []).append(one.id)
    signals = []
    for light, names in lights.items():
        # Where a light has no face: at the end of the first lane that it holds.
        x, y, z = made[names[0]].right[-1].tolist()
        place, heading = found.faces.get(light, ((x, y, z), 0.0))
        what = ("1000001", "-1", "OpenDRIVE", None, "")
        signals.append(MapSignal(light, "light", what, place, heading, tuple(names)))
    for sign in found.signs:
        sign.lanes = tuple(name for name in sign.lanes if name in made)
        signals.append(sign)
    # An origin that the caller gives replaces that of the file.
    projection, offset = _own_projection(path) if origin is None else (None, (0.0, 0.0, 0.0, 0.0))
    if projection is None and found.geo is not None:
        projection, offset = found.geo.projection, (*found.geo.origin, 0.0, 0.0)
    areas, left_out = with_area(
        MapCrosswalk(area.id, np.column_stack([area.outline, _heights_beside(area.outline, made)]))
        for area in found.crosswalks
    )
    index = LanesByPlace(made)
    return LaneMap(
        path.stem, made, signals, projection, offset, notes=[*found.notes, *added, *left_out],
        crosswalks=areas, priorities=found.priorities, poles=found.poles,
        stop_lines=[MapStopLine(name, line, index.of(line)) for name, line in found.stop_lines],
    )  # fmt: skip


def _heights_beside(points: FloatArray, lanes: Mapping[str, MapLane]) -> FloatArray:
    """Heights (n,) of the lanes nearest to points (n, 2), m: the outlines of
    crosswalks have none.
    """
    return heights_on(points, [lane.left for lane in lanes.values()])


def _own_projection(path: Path) -> tuple[str | None, tuple[float, float, float, float]]:
    root = parse(path).getroot()
    projection = root.get("xosc_projection")
    numbers = [finite_number(part) for part in root.get("xosc_offset", "0 0 0 0").split()]
    x, y, z, heading = numbers if len(numbers) == 4 else [None] * 4
    if x is None or y is None or z is None or heading is None:
        raise InvalidFile(
            "xosc_offset has four numbers: x, y, z and heading", path=path, line=1, element="osm"
        )
    return projection, (x, y, z, heading)


def _map_lane(one: Lanelet, surveyed: Mapping[str, tuple[FloatArray, FloatArray]]) -> MapLane:
    known = surveyed.get(one.id) or surveyed.get(one.id.partition("/")[0])  # it may be a part
    left, right = (
        np.column_stack([line, heights_on(line, known) if known else np.zeros(len(line))])
        for line in (one.left, one.right)
    )
    return MapLane(
        one.id, left, right, one.type, one.road_type,
        None if math.isinf(one.speed_limit) else one.speed_limit,
        ((one.left_mark, "standard", None), (one.right_mark, "standard", None)),
        successors=list(one.successors),
    )  # fmt: skip


def _put_beside(lanes: dict[str, MapLane], name: str, other: str, same: bool, side: int) -> None:
    sides = list(lanes[name].beside)
    sides[side] = (other, same)
    lanes[name].beside = (sides[0], sides[1])
    if same:
        back = list(lanes[other].beside)
        back[1 - side] = (name, True)
        lanes[other].beside = (back[0], back[1])
