"""CommonRoad maps: lanelets of a file as lanes, and lanes as a file; values in CommonRoad's XML.

Source: CommonRoad "XML Format" 2020a. Lanelets lead in the direction of their traffic; the signs of
speed limits count in m/s.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from lxml import etree

from schemas.common.array_types import FloatArray
from schemas.common.errors import InvalidFile, Unsupported
from schemas.common.xml import line_of, parse
from xodr.formats.lanelet2 import LaneletNeighbour
from xodr.formats.maps.lane_map import (
    LaneMap,
    MapCrosswalk,
    MapLane,
    MapPole,
    MapSignal,
    MapStopLine,
    resampled,
    sides_of,
    with_area,
)
from xodr.formats.maps.projecting import Projector

_GREATEST = 1e9
"""Magnitude of measured values"""
_SPEED_LIMITS = ("274", "R2-1")
"""Ids of signs for speed limits, in Europe and in the United States"""
_SPEED = re.compile(r"([0-9]{1,3}(?:\.[0-9]*)?) *(kmh|mph|)")
_UNITS = {"": 1.0, "kmh": 1.0 / 3.6, "mph": 0.44704}
"""Factors to m/s, which values without a unit are in"""
_LANE_TYPES = {
    "sidewalk": "sidewalk", "crosswalk": "sidewalk", "bicycleLane": "biking", "busLane": "bus",
    "shoulder": "shoulder",
    "accessRamp": "onRamp", "exitRamp": "offRamp", "border": "border",
}  # fmt: skip


def lane_type(types: tuple[str, ...]) -> str:
    """OpenDRIVE's lane type of a lanelet's types."""
    return next((_LANE_TYPES[one] for one in types if one in _LANE_TYPES), "driving")


def child(parent: etree._Element, *path: str) -> etree._Element:
    """The element at the end of a path of names.

    Raises:
        InvalidFile: it is not there.
    """
    for name in path:
        found = next(parent.iterchildren(name), None)
        if found is None:
            raise invalid(parent, f"there is no {name}")
        parent = found
    return parent


def number(parent: etree._Element, *path: str) -> float:
    """The number in the element at the end of a path of names."""
    element = child(parent, *path)
    return measured(element.text or "", element)


def measured(text: str, element: etree._Element) -> float:
    """A finite number of the magnitude of a measured value.

    Raises:
        InvalidFile: it is none.
    """
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not abs(value) <= _GREATEST:
        raise invalid(element, f"{text.strip()!r} is no measured value")
    return value


def invalid(element: etree._Element, message: str) -> InvalidFile:
    """The error for an element that is wrong."""
    return InvalidFile(
        message, path=_file(element), line=line_of(element), element=str(element.tag)
    )


def unsupported(element: etree._Element, message: str) -> Unsupported:
    """The error for an element that is right, but asks for something that is not done here."""
    return Unsupported(
        message, path=_file(element), line=line_of(element), element=str(element.tag)
    )


def _file(element: etree._Element) -> str | None:
    return element.getroottree().docinfo.URL


class CommonRoadLanelet(NamedTuple):
    """A piece of a lane, from its first to its last points.

    left, right: its bounds, (n, 2), m. predecessors, successors: lanelets before and after it.
    beside_left, beside_right: neighbours. types: as in `laneletType`, e.g. highway, onRamp.
    limit: speed limit (m/s) of the traffic signs that it refers to, infinite without.
    """

    id: str
    left: FloatArray
    right: FloatArray
    predecessors: tuple[str, ...]
    successors: tuple[str, ...]
    beside_left: LaneletNeighbour | None
    beside_right: LaneletNeighbour | None
    types: tuple[str, ...]
    limit: float = math.inf


def lanelets(root: etree._Element) -> list[CommonRoadLanelet]:
    """The lanelets of a scenario (the root of a CommonRoad file).

    Raises:
        InvalidFile: a bound has fewer than two points, the bounds have unequally many, or an id is
            used twice; names line and element.
    """
    limits = _limits(root)
    found: dict[str, CommonRoadLanelet] = {}
    for element in root.iterchildren("lanelet"):
        made = _lanelet(element, limits)
        if made.id in found:
            raise invalid(element, f"the id {made.id!r} is used twice")
        found[made.id] = made
    return list(found.values())


def _limits(root: etree._Element) -> dict[str, float]:
    """Speed limits (m/s) by the ids of their traffic signs."""
    return {
        sign.get("id") or "": float(value[1]) * _UNITS[value[2]]
        for sign in root.iterchildren("trafficSign")
        for part in sign.iterchildren("trafficSignElement")
        if part.findtext("trafficSignID", "").strip() in _SPEED_LIMITS
        and (value := _SPEED.fullmatch(part.findtext("additionalValue", "").strip()))
    }


def _lanelet(element: etree._Element, limits: dict[str, float]) -> CommonRoadLanelet:
    left, right = _bound(element, "leftBound"), _bound(element, "rightBound")
    if len(left) != len(right):
        raise invalid(element, f"the left bound has {len(left)} points, the right one {len(right)}")
    types = tuple((kind.text or "").strip() for kind in element.iterchildren("laneletType"))
    return CommonRoadLanelet(
        element.get("id") or "", left, right, _refs(element, "predecessor"),
        _refs(element, "successor"),
        _beside(element, "adjacentLeft"), _beside(element, "adjacentRight"), types,
        min((limits[sign] for sign in _refs(element, "trafficSignRef") if sign in limits),
            default=math.inf),
    )  # fmt: skip


def _bound(element: etree._Element, name: str) -> FloatArray:
    bound = child(element, name)
    points = [(number(point, "x"), number(point, "y")) for point in bound.iterchildren("point")]
    if len(points) < 2:
        raise invalid(bound, "a bound has two points or more")
    return np.array(points)


def _refs(element: etree._Element, name: str) -> tuple[str, ...]:
    return tuple(link.get("ref") or "" for link in element.iterchildren(name))


def _beside(element: etree._Element, name: str) -> LaneletNeighbour | None:
    link = element.find(name)
    return (
        LaneletNeighbour(link.get("ref") or "", link.get("drivingDir") == "same")
        if link is not None
        else None
    )


# maps --------------------------------------------------------------------------------------------

LANELET_TYPES = {
    "sidewalk": "sidewalk", "walking": "sidewalk", "biking": "bicycleLane", "shoulder": "shoulder",
    "stop": "shoulder",
    "bus": "busLane", "exit": "exitRamp", "offRamp": "exitRamp", "entry": "accessRamp",
    "onRamp": "accessRamp",
    "parking": "parking", "border": "border", "restricted": "restricted",
}  # fmt: skip
"""Lanelet types by OpenDRIVE lane type; other lanes have the type of their road."""
ROAD_LANELETS = {
    "motorway": "interstate", "rural": "country", "town": "urban", "townExpressway": "urban",
    "lowSpeed": "urban",
    "pedestrian": "sidewalk", "bicycle": "bicycleLane",
}  # fmt: skip
"""Lanelet types by OpenDRIVE road type"""
_ROAD_TYPES = {"interstate": "motorway", "highway": "motorway", "country": "rural", "urban": "town"}
LINE_MARKINGS = {
    "none": "no_marking", "solid": "solid", "broken": "dashed", "solid solid": "solid_solid",
    "broken broken": "dashed_dashed",
    "solid broken": "solid_dashed", "broken solid": "dashed_solid", "curb": "curb",
}  # fmt: skip
"""Markings by OpenDRIVE road mark; others are unknown"""
_MARKS_OF = {there: here for here, there in LINE_MARKINGS.items()}


_CROSSWALK = "crosswalk"


def write(lane_map: LaneMap) -> tuple[bytes, list[str]]:
    """The content of a file without scenario, and what is changed.

    CommonRoad's schema asks for a planning problem in each file.

    Raises:
        Unsupported: there is no lane.
    """
    if not lane_map.lanes:
        raise Unsupported("a map without lanes is no CommonRoad file")
    attributes = {
        "timeStepSize": "0.1", "commonRoadVersion": "2020a", "author": "xosc-toolchain",
        "affiliation": "xosc-toolchain",
        "source": lane_map.name,
        # ZAM is CommonRoad's country of made-up places.
        "benchmarkID": f"ZAM_{re.sub('[^A-Za-z0-9]', '', lane_map.name.title()) or 'Map'}-1",
        "date": "2020-01-01",
    }  # fmt: skip
    root = etree.Element("commonRoad", attributes)
    root.append(_location(lane_map))
    etree.SubElement(etree.SubElement(root, "scenarioTags"), "simulated")
    ids = {name: str(number) for number, name in enumerate(lane_map.lanes, 1)}
    limits = sorted({lane.limit for lane in lane_map.lanes.values() if lane.limit is not None})
    signs = {limit: str(len(ids) + number) for number, limit in enumerate(limits, 1)}
    # Ids are unique in the whole file, whatever they are of.
    lights = [signal for signal in lane_map.signals if signal.kind == "light"]
    numbers = {
        id(signal): str(len(ids) + len(signs) + number) for number, signal in enumerate(lights, 1)
    }
    held: dict[str, list[str]] = {}
    for signal in lights:
        for name in signal.lanes:
            held.setdefault(name, []).append(numbers[id(signal)])
    # One for each lanelet, as the format has it: of two the later one.
    lines = {name: line for line in lane_map.stop_lines for name in line.lanes}
    hidden = [
        line.id
        for line in lane_map.stop_lines
        if all(lines[name] is not line for name in line.lanes)
    ]
    for lane in lane_map.lanes.values():
        line = lines.get(lane.id)
        root.append(_lanelet_element(lane, ids, signs, held.get(lane.id, []), line))
    taken = len(ids) + len(signs) + len(lights)
    for number_of, area in enumerate(lane_map.crosswalks, taken + 1):
        root.append(_crosswalk(str(number_of), area))
    taken += len(lane_map.crosswalks)
    for limit in limits:
        first = next(lane for lane in lane_map.lanes.values() if lane.limit == limit)
        root.append(_limit_sign(signs[limit], limit, first))
    for signal in lights:
        light = etree.SubElement(root, "trafficLight", id=numbers[id(signal)])
        element = etree.SubElement(etree.SubElement(light, "cycle"), "cycleElement")
        etree.SubElement(element, "duration").text = "1"
        # A cycle has to have an element; a map has no program of its lights.
        etree.SubElement(element, "color").text = "inactive"
        etree.SubElement(light, "position").append(_point(signal.place, False))
        etree.SubElement(light, "active").text = "false"
    for number_of, pole in enumerate(lane_map.poles, taken + 1):
        root.append(_pillar(str(number_of), pole))
    problem = taken + len(lane_map.poles) + 1
    root.append(_standing(str(problem), next(iter(lane_map.lanes.values())), ids))
    etree.indent(root)
    notes = ["CommonRoad asks for a planning problem: one stands on lanelet 1"]
    if hidden:
        reason = "CommonRoad has one on a lanelet, and none beside"
        notes.append(f"stop lines are left out, since {reason}: {' '.join(hidden)}")
    notes += (
        []
        if lane_map.projection is not None
        else ["the map has no projection: its place on Earth is unknown"]
    )
    if lane_map.projection is not None and lane_map.offset[2]:
        height = lane_map.offset[2]
        notes.append(f"the height of the offset, {height:g} m, is left out: CommonRoad has none")
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8") + b"\n", notes


def _standing(number: str, lane: MapLane, ids: dict[str, str]) -> etree._Element:
    """The planning problem that the format asks of each file: a vehicle that stays on a lane."""
    problem = etree.Element("planningProblem", id=number)
    initial = etree.SubElement(problem, "initialState")
    first, second = lane.centre[:2].tolist()
    etree.SubElement(initial, "position").append(_point(first, False))
    heading = math.atan2(second[1] - first[1], second[0] - first[0])
    for tag, value in (
        ("velocity", "0.0"),
        ("orientation", f"{heading:.6f}"),
        ("yawRate", "0.0"),
        ("slipAngle", "0.0"),
        ("time", "0"),
    ):
        etree.SubElement(etree.SubElement(initial, tag), "exact").text = value
    goal = etree.SubElement(problem, "goalState")
    time = etree.SubElement(goal, "time")
    etree.SubElement(time, "intervalStart").text = "0"
    etree.SubElement(time, "intervalEnd").text = "1"
    etree.SubElement(etree.SubElement(goal, "position"), "lanelet", ref=ids[lane.id])
    return problem


def _location(lane_map: LaneMap) -> etree._Element:
    location, projector = etree.Element("location"), Projector.of(lane_map)
    # 999 is CommonRoad's number for an unknown place.
    latitude, longitude = "999", "999"
    if projector is not None:
        east, north, _ = projector.to_geodetic(np.zeros((1, 3)))
        latitude, longitude = f"{north[0]:.10f}", f"{east[0]:.10f}"
    for tag, text in (
        ("geoNameId", "-999"),
        ("gpsLatitude", latitude),
        ("gpsLongitude", longitude),
    ):
        etree.SubElement(location, tag).text = text
    if lane_map.projection is not None:
        transformation = etree.SubElement(location, "geoTransformation")
        etree.SubElement(transformation, "geoReference").text = lane_map.projection
        more = etree.SubElement(transformation, "additionalTransformation")
        x, y, _, heading = lane_map.offset
        for tag, value in (
            ("xTranslation", x),
            ("yTranslation", y),
            ("zRotation", heading),
            ("scaling", 1.0),
        ):
            etree.SubElement(more, tag).text = f"{value:.10f}"
    return location


def _lanelet_element(
    lane: MapLane, ids: dict[str, str], signs: dict[float, str], lights: list[str],
    stop: MapStopLine | None,
) -> etree._Element:  # fmt: skip
    element = etree.Element("lanelet", id=ids[lane.id])
    sides = lane.left, lane.right
    # CommonRoad wants as many points on the left as on the right.
    if len(lane.left) != len(lane.right):
        count = 2 * max(len(lane.left), len(lane.right))
        sides = resampled(lane.left, count), resampled(lane.right, count)
    heights = bool(np.any(lane.left[:, 2])) or bool(np.any(lane.right[:, 2]))
    for tag, line, mark in zip(("leftBound", "rightBound"), sides, lane.marks, strict=True):
        bound = etree.SubElement(element, tag)
        bound.extend(_point(place, heights) for place in line.tolist())
        etree.SubElement(bound, "lineMarking").text = LINE_MARKINGS.get(mark[0], "unknown")
    element.extend(
        etree.Element("successor", ref=ids[name]) for name in lane.successors if name in ids
    )
    for tag, beside in zip(("adjacentLeft", "adjacentRight"), lane.beside, strict=True):
        if beside is not None and beside[0] in ids:
            etree.SubElement(
                element, tag, ref=ids[beside[0]], drivingDir="same" if beside[1] else "opposite"
            )
    if stop is not None:
        # The whole line on each of its lanes, so that it can be read again as one.
        across = etree.SubElement(element, "stopLine")
        across.extend(_point(place, heights) for place in stop.line[[0, -1]].tolist())
        etree.SubElement(across, "lineMarking").text = "solid"
    kind = LANELET_TYPES.get(lane.type) or ROAD_LANELETS.get(lane.road_type, "unknown")
    for text in (kind, *(["intersection"] if lane.in_junction else [])):
        etree.SubElement(element, "laneletType").text = text
    if lane.limit is not None:
        etree.SubElement(element, "trafficSignRef", ref=signs[lane.limit])
    element.extend(etree.Element("trafficLightRef", ref=ref) for ref in lights)
    return element


def _crosswalk(number: str, area: MapCrosswalk) -> etree._Element:
    element = etree.Element("lanelet", id=number)
    sides = sides_of(area.outline)
    count = max(map(len, sides))
    for tag, line in zip(("leftBound", "rightBound"), sides, strict=True):
        even = line if len(line) == count else resampled(line, count)
        bound = etree.SubElement(element, tag)
        bound.extend(_point(place, bool(np.any(area.outline[:, 2]))) for place in even.tolist())
    etree.SubElement(element, "laneletType").text = "crosswalk"
    return element


def _pillar(number: str, pole: MapPole) -> etree._Element:
    element = etree.Element("environmentObstacle", id=number)
    etree.SubElement(element, "type").text = "pillar"
    circle = etree.SubElement(etree.SubElement(element, "shape"), "circle")
    etree.SubElement(circle, "radius").text = f"{_RADIUS:g}"
    center = etree.SubElement(circle, "center")
    for tag, value in zip("xy", pole.place, strict=False):
        etree.SubElement(center, tag).text = f"{value:.6f}"
    return element


_RADIUS = 0.1
"""Radius (m) of poles, which a map does not say"""


def _limit_sign(number: str, limit: float, lane: MapLane) -> etree._Element:
    sign = etree.Element("trafficSign", id=number)
    element = etree.SubElement(sign, "trafficSignElement")
    etree.SubElement(element, "trafficSignID").text = "274"
    etree.SubElement(element, "additionalValue").text = f"{limit:.6f}".rstrip("0").rstrip(".")
    etree.SubElement(sign, "position").append(_point(lane.right[0].tolist(), False))
    etree.SubElement(sign, "virtual").text = "true"
    return sign


def _point(place: Iterable[float], height: bool) -> etree._Element:
    element = etree.Element("point")
    for tag, value in zip("xyz" if height else "xy", place, strict=False):
        etree.SubElement(element, tag).text = f"{value:.6f}".rstrip("0").rstrip(".")
    return element


def read(path: Path) -> LaneMap:
    """The lanes of a file.

    Raises:
        InvalidFile: it is no CommonRoad file, has no lanelets, or malformed ones; names file and
            line.
    """
    root = parse(path).getroot()
    if root.tag != "commonRoad":
        raise invalid(root, "the root element of a CommonRoad file is commonRoad")
    everything = lanelets(root)
    if not everything:
        raise invalid(root, "there is no lanelet")
    # Crosswalks are lanelets here; in a map of these alone they are its lanes.
    found = [one for one in everything if _CROSSWALK not in one.types] or everything
    elements = {element.get("id") or "": element for element in root.iterchildren("lanelet")}
    lanes = {one.id: _map_lane(one, elements[one.id]) for one in found}
    # Files may declare a link on one side only.
    for one in found:
        for before in one.predecessors:
            if before in lanes and one.id not in lanes[before].successors:
                lanes[before].successors.append(one.id)
    held: dict[str, list[str]] = {}
    for name, element in elements.items():
        for ref in element.iterchildren("trafficLightRef"):
            held.setdefault(ref.get("ref") or "", []).append(name)
    lights = []
    for light in root.iterchildren("trafficLight"):
        if light.get("id") in held:
            place = light.find("position/point")
            x, y = (number(place, axis) for axis in "xy") if place is not None else (0.0, 0.0)
            what = ("1000001", "-1", "OpenDRIVE", None, "")
            lights.append(
                MapSignal(
                    str(light.get("id")),
                    "light",
                    what,
                    (x, y, 0.0),
                    0.0,
                    tuple(held[str(light.get("id"))]),
                )
            )
    transformation = root.find("location/geoTransformation")
    projection = transformation.findtext("geoReference") if transformation is not None else None
    numbers = [0.0, 0.0, 0.0]
    if transformation is not None and projection:
        more = transformation.find("additionalTransformation")
        if more is not None:
            numbers = [number(more, tag) for tag in ("xTranslation", "yTranslation", "zRotation")]
    offset = (numbers[0], numbers[1], 0.0, numbers[2])
    notes = [] if projection else ["the map says nothing of its projection"]
    areas, left_out = with_area(
        _area(one, elements[one.id]) for one in everything if one.id not in lanes
    )
    notes += left_out
    return LaneMap(
        path.stem, lanes, lights, projection or None, offset, notes=notes, crosswalks=areas,
        stop_lines=_stop_lines(lanes, elements), poles=_poles(root),
    )  # fmt: skip


def _stop_lines(
    lanes: dict[str, MapLane], elements: dict[str, etree._Element]
) -> list[MapStopLine]:
    """The stop lines of lanelets: across the end of the lanelet where there are no points; one for
    lanelets with the same line."""
    found: dict[tuple[tuple[float, ...], ...], list[str]] = {}
    for name, lane in lanes.items():
        for element in elements[name].iterchildren("stopLine"):
            points = list(element.iterchildren("point"))
            ends = [lane.left[-1].tolist(), lane.right[-1].tolist()]
            # Without points the line is where the lanelet ends (CommonRoad 2020a).
            if len(points) == 2:
                ends = [[number(p, "x"), number(p, "y"), _height(p)] for p in points]
            found.setdefault(tuple(map(tuple, ends)), []).append(name)
    return [MapStopLine(names[0], np.array(ends), tuple(names)) for ends, names in found.items()]


def _poles(root: etree._Element) -> list[MapPole]:
    found = []
    for element in root.iterchildren("environmentObstacle"):
        center = element.find("shape/circle/center")
        if element.findtext("type", "").strip() == "pillar" and center is not None:
            place = number(center, "x"), number(center, "y"), 0.0
            found.append(MapPole(element.get("id") or "", place, 0.0))
    return found


def _height(point: etree._Element) -> float:
    return number(point, "z") if point.findtext("z") else 0.0


def _area(one: CommonRoadLanelet, element: etree._Element) -> MapCrosswalk:
    left, right = (
        _with_heights(line, element, tag)
        for line, tag in ((one.left, "leftBound"), (one.right, "rightBound"))
    )
    return MapCrosswalk(one.id, np.vstack([left, right[::-1]]))


def _map_lane(one: CommonRoadLanelet, element: etree._Element) -> MapLane:
    marks = []
    for tag in ("leftBound", "rightBound"):
        text = (element.findtext(f"{tag}/lineMarking") or "").strip()
        marks.append((_MARKS_OF.get(text, "none"), "standard", None))
    road_type = next((_ROAD_TYPES[kind] for kind in one.types if kind in _ROAD_TYPES), "unknown")
    beside = [
        (neighbour.id, neighbour.same_direction) if neighbour is not None else None
        for neighbour in (one.beside_left, one.beside_right)
    ]
    left, right = (
        _with_heights(line, element, tag)
        for line, tag in ((one.left, "leftBound"), (one.right, "rightBound"))
    )
    return MapLane(
        one.id, left, right, lane_type(one.types), road_type,
        None if math.isinf(one.limit) else one.limit,
        (marks[0], marks[1]), "intersection" in one.types, list(one.successors),
        (beside[0], beside[1]),
    )  # fmt: skip


def _with_heights(line: FloatArray, element: etree._Element, tag: str) -> FloatArray:
    heights = [_height(point) for point in child(element, tag).iterchildren("point")]
    return np.column_stack([line, heights])
