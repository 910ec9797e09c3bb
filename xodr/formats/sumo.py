"""SUMO networks: written with exact centre lines and heights, read into lanes.

Source: SUMO documentation, "Networks/SUMO Road Networks". Lanes of SUMO have one width; their
shapes are centre lines. Lanes whose width or cross slope changes have their mean width for SUMO,
and their borders in two parameters, which SUMO's programs keep and do not read.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import shapely
from lxml import etree

from schemas.common.array_types import FloatArray
from schemas.common.errors import InvalidFile, Unsupported
from schemas.common.xml import line_of, parse
from xodr.formats.maps.lane_map import (
    LANE_TYPES,
    LaneMap,
    MapLane,
    MapSignal,
    MapStopLine,
    at_lengths,
    gone,
    heights_on,
    name_of,
    of_network,
    resampled,
    shifted,
)
from xodr.formats.sumo_net import DOCK, LaneTrack, georeference, lift
from xodr.formats.sumo_net.building import convert
from xodr.formats.sumo_net.plain import NARROW
from xodr.graph.network import RoadNetwork
from xodr.lookup.arrays import Points, section_stations
from xodr.lookup.lanelets import sides
from xodr.model import Lane, LaneSection

_WIDTH, _SPEED = 3.2, 13.89
"""Width (m) and speed limit (m/s) of lanes that name none."""
_TYPES = {
    "pedestrian": "sidewalk", "bicycle": "biking", "bus": "bus", "tram": "tram", "rail": "rail",
    "rail_urban": "rail",
    "emergency": "shoulder",
}  # fmt: skip
"""Lane types by the first vehicle class that a lane allows alone."""


def write(network: RoadNetwork) -> tuple[bytes, list[str]]:
    """The network file of OpenDRIVE roads, and what is changed, one sentence each.

    Raises:
        Unsupported: netconvert can't convert the roads.
    """
    content, index = convert(network, whole=True)
    if index["fallback"] is not None:
        raise Unsupported(
            f"SUMO's netconvert can't convert these roads: {index['fallback']}", path=network.path
        )
    root = etree.fromstring(content)
    passed = defaultdict[str, list[LaneTrack]](list)
    for lane, *track in index["tracks"]:
        passed[lane].append(LaneTrack(*track))
    notes = [note for note in (georeference(root, network),) if note is not None]
    height = network.header.offset[2]
    if height and network.geo_reference is not None and not notes:
        notes.append(f"the height of the offset, {height:g} m, is left out: SUMO has none")
    # A lane of SUMO may be several in a row: heights and type are those of most of it.
    longest = {lane: max(tracks, key=lambda track: track.length) for lane, tracks in passed.items()}
    lift(root, longest, network)
    _name_types(root, longest, network)
    lanes = of_network(network)
    notes += _add_stop_lines(root, passed, network, lanes)
    bordered = _add_borders(root, passed, network)
    notes += _add_strips(root, passed, network, lanes)
    if bordered:
        notes.append(
            f"widths or cross slopes of {bordered} lanes change: SUMO has their mean width, their"
            f" parameters {_SIDES[0]} and {_SIDES[1]} have their borders"
        )
    # The dock is for runs only; its nodes and inner edges have its name, too.
    for element in list(root):
        name = element.get("id", "")
        ends = (name, element.get("from", ""), element.get("to", ""))
        if DOCK in ends or name.startswith((f"{DOCK}/", f":{DOCK}/")):
            root.remove(element)
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True), notes


def _add_strips(
    root: etree._Element, passed: Mapping[str, list[LaneTrack]], roads: RoadNetwork, lanes: LaneMap
) -> Iterator[str]:
    """Give each lane that no lane of SUMO is an edge of its own, closed to traffic; say which.

    Ways through junctions lead from lane to lane: one that begins or ends inside has none. The
    links of such lanes are in the parameter `_ONWARD` of the lane before, as SUMO's connections
    would send traffic over them.
    """
    on = _placed(root, passed, roads)
    missing = [
        name for name, lane in lanes.lanes.items() if name not in on and _mean_width(lane) > NARROW
    ]
    if not missing:
        return
    # Edges come before lights and junctions, junctions before connections.
    first = next(child for child in root if child.tag in ("tlLogic", "junction"))
    last = root.findall("junction")[-1]
    for name in missing:
        edge, ends = _strip(f"{_STRIP}{name}", lanes.lanes[name])
        first.addprevious(edge)
        for end in ends:
            last.addnext(end)
        on[name] = [edge[0]]
    for name, lane in lanes.lanes.items():
        onward = [
            _nearest(on[other], lanes.lanes[other].centre[0], 0, roads.path).get("id", "")
            for other in lane.successors
            if on.get(other) and on.get(name) and (name in missing or other in missing)
        ]
        if onward:
            source = _nearest(on[name], lane.centre[-1], -1, roads.path)
            etree.SubElement(source, "param", key=_ONWARD, value=" ".join(onward))
    yield (
        "edges without traffic, since SUMO's ways through junctions lead from lane to lane:"
        f" {' '.join(missing[:_NAMED])}{' …' * (len(missing) > _NAMED)}"
    )


_STRIP, _ONWARD = "strip/", "successors"
"""Beginning of the ids of edges that no traffic uses, and the parameter of a lane with the lanes
that follow it without a connection"""
_NAMED = 10
"""Most lanes that a note names"""


def _strip(name: str, lane: MapLane) -> tuple[etree._Element, list[etree._Element]]:
    """An edge with one lane that is closed to traffic, and its two junctions."""
    ends = []
    for end, place, held in (
        ("end", lane.centre[-1], f"{name}_0"),
        ("start", lane.centre[0], ""),
    ):
        x, y, z = (f"{value:.4f}" for value in place.tolist())
        about = {"incLanes": held, "intLanes": "", "shape": f"{x},{y}"}
        here = {"id": f"{name}/{end}", "type": "dead_end", "x": x, "y": y, "z": z}
        ends.append(etree.Element("junction", here | about))
    edge = etree.Element("edge", {"id": name, "from": f"{name}/start", "to": f"{name}/end"})
    speed = _SPEED if lane.limit is None else lane.limit
    inner = etree.SubElement(
        edge, "lane", id=f"{name}_0", index="0", disallow="all", speed=f"{speed:.2f}",
        length=f"{lane.length:.2f}", width=f"{_mean_width(lane):.2f}", shape=_shape(lane.centre),
        type=lane.type,
    )  # fmt: skip
    for key, border in zip(_SIDES, (lane.left, lane.right), strict=True):
        etree.SubElement(inner, "param", key=key, value=_shape(border))
    return edge, ends


def _mean_width(lane: MapLane) -> float:
    left, right = (resampled(line, 5)[:, :2] for line in (lane.left, lane.right))
    return float(np.hypot(*(left - right).T).mean())


def _shape(line: Points) -> str:
    return " ".join(",".join(f"{number:.4f}" for number in point) for point in line.tolist())


def _placed(
    root: etree._Element, passed: Mapping[str, list[LaneTrack]], roads: RoadNetwork
) -> dict[str, list[etree._Element]]:
    """The lanes of SUMO by the lanes of roads that they are, wholly or in part."""
    on: dict[str, list[etree._Element]] = defaultdict(list)
    for lane in root.iter("lane"):
        for track in passed.get(lane.get("id", ""), []):
            number = roads.roads[track.road_id].section_index(0.5 * (track.start + track.end))
            on[name_of((track.road_id, number, track.lane_id))].append(lane)
    return on


def _nearest(
    lanes: Sequence[etree._Element], place: FloatArray, at: int, path: Path
) -> etree._Element:
    """The lane whose first (0) or last (-1) point is nearest to a place."""
    return min(lanes, key=lambda lane: math.dist(_points(lane, "shape", path)[at, :2], place[:2]))


def _add_stop_lines(
    root: etree._Element, passed: Mapping[str, list[LaneTrack]], roads: RoadNetwork, lanes: LaneMap
) -> Iterator[str]:
    """Give lanes the distance of their stop line from their end; say which have none."""
    on = _placed(root, passed, roads) if lanes.stop_lines else {}
    left_out = []
    for stop in lanes.stop_lines:
        spot, placed = shapely.LineString(stop.line[:, :2]), False
        for lane in (lane for name in stop.lanes for lane in on.get(name, ())):
            line = shapely.LineString(_points(lane, "shape", roads.path)[:, :2])
            # Traffic inside junctions does not stop by it.
            if lane.get("id", "").startswith(":") or line.distance(spot) > _BEFORE:
                continue
            at = line.project(shapely.Point(shapely.shortest_line(line, spot).coords[0]))
            rest = max(line.length - at, 0.0)
            known = lane.find("stopOffset")
            element = etree.SubElement(lane, "stopOffset") if known is None else known
            element.set("value", f"{rest:.2f}")
            placed = True
        if not placed:
            left_out.append(stop.id)
    if left_out:
        reason = "no lane of SUMO outside junctions leads over them"
        yield f"stop lines are left out, since {reason}: {' '.join(left_out)}"


_BEFORE = 5.0
"""Distance (m) of a stop line beyond the end of a lane of SUMO, which ends where the junction
begins"""


def _add_borders(
    root: etree._Element, passed: Mapping[str, list[LaneTrack]], roads: RoadNetwork
) -> int:
    """Give lanes the borders that their widths do not give; the number of these lanes."""
    bordered = 0
    for lane in root.iter("lane"):
        tracks = passed.get(lane.get("id", ""), [])
        width = float(lane.get("width", _WIDTH))
        # Then SUMO's own width says it all, and a parameter would be stale after an edit.
        if all(_of_one_width(roads, track, width) for track in tracks):
            continue
        line = _points(lane, "shape", roads.path)
        for key, border in zip(_SIDES, _borders(roads, tracks, line), strict=True):
            etree.SubElement(lane, "param", key=key, value=_shape(border))
        bordered += 1
    return bordered


def _name_types(root: etree._Element, longest: Mapping[str, LaneTrack], roads: RoadNetwork) -> None:
    """Give lanes inside junctions the types of the lanes that they are, or else come from."""
    lanes = {lane.get("id", ""): lane for lane in root.iter("lane")}
    for connection in root.iterchildren("connection"):  # those inside junctions come last
        within = lanes.get(connection.get("via", ""))
        source = lanes.get(f"{connection.get('from')}_{connection.get('fromLane')}")
        if within is not None and source is not None and within.get("type") is None:
            track = longest.get(within.get("id", ""))
            within.set("type", _lane_of(roads, track).type if track else source.get("type", "none"))


_SIDES = "border.left", "border.right"
"""Names of the parameters of a lane that have its borders, as SUMO writes shapes."""
_SAME_WIDTH = 0.01
"""Difference (m) up to which a width is that of a lane."""
_SPACING, _CHORD_ERROR = 10.0, 0.01
"""Greatest distance (m) of the points of borders along the road, and of borders from the lines
between these."""
_APART = 1.0
"""Distance (m) of tracks in a row from which on they are of two ways: SUMO has one from a lane to a
lane."""


def _lane_of(roads: RoadNetwork, track: LaneTrack) -> Lane:
    return _section_of(roads, track).lanes[track.lane_id]


def _section_of(roads: RoadNetwork, track: LaneTrack) -> LaneSection:
    return roads.roads[track.road_id].section(0.5 * (track.start + track.end))


def _of_one_width(roads: RoadNetwork, track: LaneTrack, width: float) -> bool:
    """Whether a lane is level and of this width (m) everywhere, across its own direction."""
    road, lane = roads.roads[track.road_id], _lane_of(roads, track)
    if lane.heights or any(
        road.superelevation.starts and road.superelevation(s) for s in (track.start, track.end)
    ):
        return False
    low, high = sorted((track.start, track.end))
    # Within each record: a bay that begins and ends is level where its records meet.
    starts = {*lane.width.starts, *lane.center.starts}
    records = pairwise(sorted({low, high, *(s for s in starts if low < s < high)}))
    places = [s for begin, end in records for s in np.linspace(begin, end, 9).tolist()]
    # A lane that leads away from the reference line is narrower than along that line's normals.
    turns = {
        s: math.atan2(lane.center.slope(s), 1.0 - road.curvature(s) * lane.center(s))
        for s in places
    }
    return all(
        abs(lane.width(s) * math.cos(turn) - width) <= _SAME_WIDTH for s, turn in turns.items()
    )


def _borders(
    roads: RoadNetwork, tracks: list[LaneTrack], line: FloatArray
) -> tuple[Points, Points]:
    """Left and right border, (n, 3) each, m, beside the centre line of a SUMO lane (m, 3)."""
    left, right = np.zeros((0, 3)), np.zeros((0, 3))
    for track in tracks:
        road, lane = roads.roads[track.road_id], _lane_of(roads, track)
        low, high = sorted((track.start, track.end))
        section = road.section(0.5 * (low + high))
        inside = section_stations(road, section, _CHORD_ERROR, _SPACING)
        along = np.array([low, *inside[(inside > low) & (inside < high)].tolist(), high])
        ours = sides(road, lane, along, track.end > track.start)
        # Only the first way is kept: its borders have to be one line.
        if len(left) and math.dist(left[-1], ours[0][0]) > _APART:
            break
        left, right = np.vstack([left, ours[0]]), np.vstack([right, ours[1]])
    centre = 0.5 * (left + right)
    along = gone(centre)
    spots = shapely.line_locate_point(
        shapely.LineString(centre[:, :2]), shapely.points(line[[0, -1], :2])
    )
    low, high = spots.tolist()
    # Both ends of the shape lie at one place of the borders: nothing to cut them to.
    if high - low < _SAME_WIDTH:
        return left, right
    places = np.array([low, *along[(along > low) & (along < high)].tolist(), high])
    left, right = (
        np.column_stack([np.interp(places, along, border[:, axis]) for axis in range(3)])
        for border in (left, right)
    )
    return left, right


def read(path: Path) -> LaneMap:
    """The lanes of a network file.

    Raises:
        InvalidFile: it is no SUMO network, a lane has no shape, or an id is used twice; names file
            and line.
    """
    root = parse(path).getroot()
    if root.tag != "net":
        raise InvalidFile(
            "the root element of a SUMO network is net",
            path=path,
            line=line_of(root),
            element=str(root.tag),
        )
    left_hand = root.get("lefthand") in ("true", "1")
    lanes: dict[str, MapLane] = {}
    moved: list[str] = []
    for edge in root.iterchildren("edge"):
        if edge.get("function") in ("crossing", "walkingarea", "connector"):
            continue
        row = sorted(edge.iterchildren("lane"), key=lambda lane: _number(lane, "index", 0.0, path))
        made = [_lane(lane, edge, path) for lane in row]
        # Inner lanes of one edge may cross each other, so none lies beside another.
        internal = edge.get("function") == "internal"
        if not internal:
            _lean(made, -1 if left_hand else 1)
        moved += [
            ours.id
            for ours, element in zip(made, row, strict=True)
            if _take_borders(ours, element, path) is False
        ]
        for number, lane in enumerate(made):
            lane.in_junction = internal
            # By index: SUMO counts lanes from the outer border of the edge.
            inner, outer = (
                made[n].id if 0 <= n < len(made) and not internal else None
                for n in (number + 1, number - 1)
            )
            sides = [
                (name, True) if name is not None else None
                for name in ((outer, inner) if left_hand else (inner, outer))
            ]
            lane.beside = (sides[0], sides[1])
            if lane.id in lanes:
                raise InvalidFile(
                    f"the id {lane.id!r} is used twice",
                    path=path,
                    line=line_of(row[number]),
                    element="lane",
                )
            lanes[lane.id] = lane
    lights = _connect(root, lanes)
    stops = _stop_lines(root, lanes, path)
    location = root.find("location")
    projection, offset = _location(location, path)
    notes = ["the network says nothing of its place on Earth"] if projection is None else []
    if moved:
        notes.append(
            f"lanes are not between their parameters {' and '.join(_SIDES)}, whose borders are "
            f"left out: {' '.join(moved)}"
        )
    return LaneMap(
        path.name.split(".")[0], lanes, lights, projection, offset, left_hand, notes,
        stop_lines=stops,
    )  # fmt: skip


def _stop_lines(
    root: etree._Element, lanes: Mapping[str, MapLane], path: Path
) -> list[MapStopLine]:
    """The stop lines of lanes, those of neighbours that meet as one."""
    found: list[MapStopLine] = []
    for edge in root.iterchildren("edge"):
        row = []
        for element in edge.iterchildren("lane"):
            offset, lane = element.find("stopOffset"), lanes.get(element.get("id", ""))
            if offset is None or lane is None:
                continue
            at = max(lane.length - _number(offset, "value", 0.0, path), 0.0) / lane.length
            left, right = (
                at_lengths(line, np.array([at * gone(line)[-1]]))
                for line in (lane.left, lane.right)
            )
            row.append(MapStopLine(lane.id, np.vstack([left, right]), (lane.id,)))
        for stop in row:
            # Within one edge only: lines of two roads may meet at a corner.
            before = found[-1] if found and stop is not row[0] else None
            if before is not None and math.dist(before.line[0], stop.line[1]) < _SAME_LINE:
                line = np.vstack([stop.line[:1], before.line[1:]])
                stop = MapStopLine(before.id, line, (*before.lanes, *stop.lanes))
                found.pop()
            found.append(stop)
    return found


_SAME_LINE = 0.3
"""Distance (m) of the ends of stop lines of neighbours that are one"""


def _lane(lane: etree._Element, edge: etree._Element, path: Path) -> MapLane:
    line = _points(lane, "shape", path)
    line = (
        # Points that repeat give no direction.
        line[np.append(True, np.hypot(*np.diff(line[:, :2], axis=0).T) > 1e-4)]
        if len(line)
        else line
    )
    if len(line) == 1:  # a way without length, between edges that meet
        line = np.vstack([line, line + np.array([1e-3, 0.0, 0.0])])
    if len(line) < 2:
        raise InvalidFile(
            "the lane has no shape", path=path, line=line_of(lane), element=f"lane {lane.get('id')}"
        )
    half = 0.5 * _number(lane, "width", _WIDTH, path)
    return MapLane(
        lane.get("id", ""), shifted(line, half), shifted(line, -half), _type(lane, edge),
        limit=_number(lane, "speed", _SPEED, path),
    )  # fmt: skip


def _take_borders(made: MapLane, lane: etree._Element, path: Path) -> bool | None:
    """Give a lane the borders of its parameters; None where it has none, False where its shape is
    no longer in their middle."""
    found = {param.get("key"): param for param in lane.iterchildren("param")}
    if not all(side in found for side in _SIDES):
        return None
    left, right = (_points(found[side], "value", path) for side in _SIDES)
    if len(left) != len(right) or len(left) < 2:
        return False
    middle = shapely.LineString(0.5 * (left + right)[:, :2])
    away = shapely.distance(middle, shapely.points(made.centre[:, :2]))
    # Somebody has moved the lane in an editor: his shape counts, not the borders of before.
    if away.max() > _MOVED:
        return False
    made.left, made.right = left, right
    # Cached properties of the old borders.
    made.__dict__.pop("centre", None)
    made.__dict__.pop("length", None)
    return True


_MOVED = 0.1
"""Distance (m) of a shape from the middle of the borders, above which the lane
has been moved since.
"""


def _number(element: etree._Element, attribute: str, default: float, path: Path) -> float:
    """A finite number of an attribute.

    Raises:
        InvalidFile: it is none.
    """
    value = element.get(attribute)
    try:
        number = default if value is None else float(value)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise InvalidFile(
            f"{attribute}={value!r} is no finite number",
            path=path,
            line=line_of(element),
            element=str(element.tag),
        )
    return number


def _points(element: etree._Element, attribute: str, path: Path) -> Points:
    """Points of a lane, (n, 3), m.

    Raises:
        InvalidFile: one is no point.
    """
    points = []
    for text in element.get(attribute, "").split():
        try:
            numbers = [float(part) for part in text.split(",")]
        except ValueError:
            numbers = []
        if len(numbers) not in (2, 3) or not np.isfinite(numbers).all():
            raise InvalidFile(
                f"{attribute}={text!r} is no point x,y or x,y,z",
                path=path,
                line=line_of(element),
                element=str(element.tag),
            )
        points.append([*numbers, 0.0][:3])
    return np.array(points).reshape(-1, 3)


def _lean(row: list[MapLane], leftwards: int) -> None:
    """Tilt lanes beside each other by the heights of their centre lines: a network has no other
    cross slope.

    Args:
        row: lanes of an edge by index.
        leftwards: 1 where the index grows to the left, -1 where to the right.
    """
    centres = [lane.centre for lane in row]
    # A flat row has no slope, and one lane alone shows none.
    if len(row) < 2 or not any(line[:, 2].any() for line in centres):
        return
    halves = [float(np.hypot(*(lane.left - lane.right)[0, :2])) / 2 for lane in row]
    for number, lane in enumerate(row):
        line = centres[number]
        slopes = [
            (heights_on(line[:, :2], [centres[n]]) - line[:, 2])
            / ((n - number) * leftwards * (halves[n] + halves[number]))
            for n in (number - 1, number + 1)
            if 0 <= n < len(row)
        ]
        rise = np.mean(slopes, axis=0) * halves[number]
        lane.left[:, 2] += rise
        lane.right[:, 2] -= rise


def _type(lane: etree._Element, edge: etree._Element) -> str:
    named = lane.get("type") or edge.get("type") or ""
    if named in LANE_TYPES or named == "none":
        return named
    # A lane for everything has no list.
    allowed = (lane.get("allow") or "").split()
    if allowed and "passenger" not in allowed:
        return next((_TYPES[user] for user in allowed if user in _TYPES), "restricted")
    return "none" if lane.get("disallow") == "all" else "driving"


def _connect(root: etree._Element, lanes: dict[str, MapLane]) -> list[MapSignal]:
    """Link the lanes; the lights at connections, one for each light and lane."""
    held: dict[str, dict[str, None]] = {}
    for connection in root.iterchildren("connection"):
        source = f"{connection.get('from')}_{connection.get('fromLane')}"
        # By the lane inside the junction, if there is one: it leads on by a connection of its own.
        target = connection.get("via") or f"{connection.get('to')}_{connection.get('toLane')}"
        if source in lanes and target in lanes and target not in lanes[source].successors:
            lanes[source].successors.append(target)
        if connection.get("tl") and source in lanes and not source.startswith(":"):
            held.setdefault(str(connection.get("tl")), {})[source] = None
    for lane in root.iter("lane"):
        for param in lane.iterfind(f"param[@key='{_ONWARD}']"):
            onward = [name for name in param.get("value", "").split() if name in lanes]
            before = lanes.get(lane.get("id", ""))
            if before is not None:
                before.successors += [name for name in onward if name not in before.successors]
    signals = []
    for light, names in held.items():
        end = lanes[next(iter(names))].right[-1]
        place = (float(end[0]), float(end[1]), float(end[2]))
        signals.append(
            MapSignal(
                light, "light", ("1000001", "-1", "OpenDRIVE", None, ""), place, 0.0, tuple(names)
            )
        )
    return signals


def _location(
    location: etree._Element | None, path: Path
) -> tuple[str | None, tuple[float, float, float, float]]:
    """Projection and offset, as OpenDRIVE has them."""
    projection = location.get("projParameter", "!") if location is not None else "!"
    if location is None or projection in ("!", "-", ""):
        return None, (0.0, 0.0, 0.0, 0.0)
    found = _points(location, "netOffset", path)
    x, y = found[0, :2].tolist() if len(found) else (0.0, 0.0)
    # `0.0 - x` never gives -0.0, as `-x` does; SUMO's offset has the other sign.
    return projection, (0.0 - x, 0.0 - y, 0.0, 0.0)
