"""Target `commonroad`: the run as a CommonRoad 2020a scenario, with lanelets, obstacles and the ego's planning problem.

Source: CommonRoad "XML Format" 2020a, and its scheme of benchmark ids. Positions are those of the bounding box's centre. The ego
is the planning problem: it starts as it did, and its goal is where it ended, or was before its first contact, so that
its own way up to there solves the problem; that way is not in the file, those of all others are.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import count
from typing import TYPE_CHECKING

import numpy as np
from lxml import etree

from runner.exports.lanelets import ExportedLanelet, lanelets
from runner.exports.moments import box_centre, date, decimal, rate, stands, unsupported, wrapped
from xosc.versions import with_recent

if TYPE_CHECKING:
    from runner.interpreter.result import RunResult
    from runner.recording import Track
    from xosc.exports.draft import Folder

TARGETS = {"commonroad": "CommonRoad 2020a XML: lanelets, obstacles, planning problem"}
_OBSTACLES = with_recent({
    "car": "car", "van": "car", "truck": "truck", "trailer": "truck", "semitrailer": "truck", "bus": "bus",
    "motorbike": "motorcycle", "bicycle": "bicycle", "train": "train", "tram": "train", "pedestrian": "pedestrian",
})  # fmt: skip
"""CommonRoad's types by OpenSCENARIO category; everything else is `unknown`."""
_UNKNOWN_PLACE = {"geoNameId": "-999", "gpsLatitude": "999", "gpsLongitude": "999"}
"""Location of CommonRoad scenarios without a geographic position."""
_FACING = 0.25
"""rad to either side by which one may face otherwise at the goal"""


def export(result: RunResult, name: str, folder: Folder) -> list[str]:
    """Write the scenario of a run.

    Raises:
        Unsupported: there are no roads or no ego, or a participant appears later than at the beginning.
        UsageError: a file is in the way.
    """
    root = scenario(result, name)
    etree.indent(root)
    folder.write(f"{name}.xml", etree.tostring(root, xml_declaration=True, encoding="UTF-8") + b"\n")
    return []


def scenario(result: RunResult, name: str) -> etree._Element:
    """The element commonRoad of a run; arguments and errors as in `export`."""
    network, tracks = result.recording.network, result.recording.tracks
    if network is None:
        raise unsupported(result, None, "CommonRoad scenarios are on lanelets, and this one has no roads")
    if result.ego is None or result.ego not in tracks:
        raise unsupported(result, None, "CommonRoad scenarios have a planning problem, and this one has no ego to plan for")
    for track in tracks.values():
        if track.columns["time"][0] > 0.0:
            raise unsupported(
                result,
                track.name,
                f"{track.name!r} appears at {track.columns['time'][0]:g} s, but obstacles of CommonRoad start at 0 s",
            )
    numbers = count(1)
    root = etree.Element("commonRoad", _header(result, name))
    location = etree.SubElement(root, "location")
    for tag, value in _UNKNOWN_PLACE.items():
        etree.SubElement(location, tag).text = value
    etree.SubElement(etree.SubElement(root, "scenarioTags"), "simulated")
    root.extend(map_elements(list(lanelets(network).values()), numbers))
    others = [track for track in tracks.values() if track.name != result.ego]
    standing = [track for track in others if stands(track)]
    for track in (*standing, *(each for each in others if each not in standing)):
        root.append(_obstacle(track, track in standing, next(numbers), result.recording.timestep))
    root.append(_problem(tracks[result.ego], next(numbers), result.recording.timestep, _goal_row(result)))
    return root


def _header(result: RunResult, name: str) -> dict[str, str]:
    return {
        "timeStepSize": decimal(result.recording.timestep), "commonRoadVersion": "2020a", "author": "xosc-toolchain",
        "affiliation": "xosc-toolchain", "source": result.scenario.name, "benchmarkID": benchmark_id(name),
        "date": date(result)[:10],
    }  # fmt: skip


def benchmark_id(name: str) -> str:
    """The benchmark id of a run: country, scene, number of the map and the configuration, kind and number of the prediction.

    A set of parameters of a distribution (`NAME~000003`) is a configuration of its own, as CommonRoad counts: from 1.
    """
    stem, _, number = name.partition("~")
    if not number.isdecimal():
        stem, number = name, "0"
    scene = "".join(c for c in stem.title() if c.isascii() and c.isalnum())
    return f"ZAM_{scene or 'Run'}-1_{int(number) + 1}_T-1"


def _obstacle(track: Track, standing: bool, number: int, step: float) -> etree._Element:
    element = etree.Element("staticObstacle" if standing else "dynamicObstacle", id=str(number))
    etree.SubElement(element, "type").text = "unknown" if standing else _OBSTACLES.get(track.category, "unknown")
    etree.SubElement(element, "shape").append(_rectangle(track))
    first, *more = _states(track, step)
    element.append(first)
    if not standing:
        way = etree.SubElement(element, "trajectory")
        way.extend(more or _waiting(first))
    return element


def _states(track: Track, step: float) -> list[etree._Element]:
    columns, centre = track.columns, box_centre(track)
    times = np.rint(columns["time"] / step).astype(int)
    turning = rate(np.unwrap(columns["h"].astype(float)), columns["time"])
    rows = zip(centre, wrapped(columns["h"]), times, columns["speed"], columns["acceleration"], turning, strict=True)
    states = []
    for number, (place, h, time, speed, acceleration, turn) in enumerate(rows):
        state = etree.Element("state" if number else "initialState")
        etree.SubElement(state, "position").append(point(place))
        _exact(state, {"orientation": h, "time": int(time), "velocity": speed, "acceleration": acceleration, "yawRate": turn})
        states.append(state)
    return states


def _waiting(first: etree._Element) -> Iterable[etree._Element]:
    """Return the single state of an entity present at one step only: CommonRoad requires one after the first."""
    second = etree.fromstring(etree.tostring(first))
    second.tag = "state"
    time = second.find("time/exact")
    assert time is not None
    time.text = "1"
    return [second]


def _goal_row(result: RunResult) -> int:
    """Row of the ego's track with its goal: the last one, or the last before its first contact."""
    times = result.recording.tracks[str(result.ego)].columns["time"]
    contacts = [each for each in result.events if each.kind == "collision"]
    touched = [each.time for each in contacts if each.subject == result.ego or each.text == f"touches {result.ego}"]
    before = np.flatnonzero(times < min(touched, default=np.inf) - result.recording.timestep / 2)
    return int(before[-1]) if len(before) else len(times) - 1


def _problem(track: Track, number: int, step: float, goal_row: int) -> etree._Element:
    """The ego's planning problem: to come, by the end of the run, to where it came, facing as it did."""
    problem = etree.Element("planningProblem", id=str(number))
    columns, centre = track.columns, box_centre(track)
    start = etree.SubElement(problem, "initialState")
    etree.SubElement(start, "position").append(point(centre[0]))
    turning = rate(np.unwrap(columns["h"].astype(float)), columns["time"])[0]
    values = {"velocity": columns["speed"][0], "orientation": wrapped(columns["h"])[0], "yawRate": turning, "slipAngle": 0.0}
    _exact(start, {**values, "time": 0, "acceleration": columns["acceleration"][0]})
    goal = etree.SubElement(problem, "goalState")
    time = etree.SubElement(goal, "time")
    etree.SubElement(time, "intervalStart").text = "0"
    etree.SubElement(time, "intervalEnd").text = str(max(round(float(columns["time"][-1]) / step), 1))
    area = _rectangle(track)
    etree.SubElement(area, "orientation").text = decimal(wrapped(columns["h"])[goal_row])
    middle = point(centre[goal_row])
    middle.tag = "center"
    area.append(middle)
    etree.SubElement(goal, "position").append(area)
    facing, heading = etree.SubElement(goal, "orientation"), float(wrapped(columns["h"])[goal_row])
    etree.SubElement(facing, "intervalStart").text = decimal(heading - _FACING)
    etree.SubElement(facing, "intervalEnd").text = decimal(heading + _FACING)
    return problem


def _rectangle(track: Track) -> etree._Element:
    rectangle = etree.Element("rectangle")
    etree.SubElement(rectangle, "length").text = decimal(track.box.length)
    etree.SubElement(rectangle, "width").text = decimal(track.box.width)
    return rectangle


def _exact(state: etree._Element, values: dict[str, float]) -> None:
    for tag, value in values.items():
        etree.SubElement(etree.SubElement(state, tag), "exact").text = str(value) if isinstance(value, int) else decimal(value)


# the map: lanelets and signs, in the plane (heights are left out) -----------------------------

_LANES = {
    "sidewalk": "sidewalk", "walking": "sidewalk", "biking": "bicycleLane", "shoulder": "shoulder", "stop": "shoulder",
    "bus": "busLane", "exit": "exitRamp", "offRamp": "exitRamp", "entry": "accessRamp", "onRamp": "accessRamp",
    "parking": "parking", "border": "border", "restricted": "restricted",
}  # fmt: skip
"""Lanelet types by OpenDRIVE lane type; other lanes have the type of their road."""
_ROADS = {
    "motorway": "interstate", "rural": "country", "town": "urban", "townExpressway": "urban", "lowSpeed": "urban",
    "pedestrian": "sidewalk", "bicycle": "bicycleLane",
}  # fmt: skip
_MARKS = {
    "none": "no_marking", "solid": "solid", "broken": "dashed", "solid solid": "solid_solid", "broken broken": "dashed_dashed",
    "solid broken": "solid_dashed", "broken solid": "dashed_solid", "curb": "curb",
}  # fmt: skip
_SPEED_LIMIT = "274"
"""Number of the sign (German, and that of CommonRoad's land Zamunda)."""


def map_elements(lanes: Sequence[ExportedLanelet], numbers: count[int]) -> list[etree._Element]:
    """The lanelets, and one sign for each speed limit, which they refer to.

    Args:
        numbers: gives the ids, which are unique in a scenario.
    """
    ids = {lanelet.key: str(next(numbers)) for lanelet in lanes}
    limits = sorted({lanelet.limit for lanelet in lanes if lanelet.limit is not None})
    signs = {limit: str(next(numbers)) for limit in limits}
    made = []
    for lanelet in lanes:
        element = etree.Element("lanelet", id=ids[lanelet.key])
        for tag, points, mark in zip(("leftBound", "rightBound"), (lanelet.left, lanelet.right), lanelet.marks, strict=True):
            bound = etree.SubElement(element, tag)
            bound.extend(point(place) for place in points)
            etree.SubElement(bound, "lineMarking").text = _MARKS.get(mark, "unknown")
        for tag, keys in (("predecessor", lanelet.predecessors), ("successor", lanelet.successors)):
            element.extend(etree.Element(tag, ref=ids[key]) for key in keys)
        for tag, beside in zip(("adjacentLeft", "adjacentRight"), lanelet.beside, strict=True):
            if beside is not None:
                etree.SubElement(element, tag, ref=ids[beside[0]], drivingDir="same" if beside[1] else "opposite")
        for kind in _types(lanelet):
            etree.SubElement(element, "laneletType").text = kind
        if lanelet.limit is not None:
            etree.SubElement(element, "trafficSignRef", ref=signs[lanelet.limit])
        made.append(element)
    first = {limit: next(lanelet for lanelet in lanes if lanelet.limit == limit) for limit in limits}
    return made + [_sign(signs[limit], limit, first[limit]) for limit in limits]


def _types(lanelet: ExportedLanelet) -> list[str]:
    own = _LANES.get(lanelet.lane_type) or _ROADS.get(lanelet.road_type, "unknown")
    return [own, *(["intersection"] if lanelet.in_junction else [])]


def _sign(number: str, limit: float, lanelet: ExportedLanelet) -> etree._Element:
    sign = etree.Element("trafficSign", id=number)
    element = etree.SubElement(sign, "trafficSignElement")
    etree.SubElement(element, "trafficSignID").text = _SPEED_LIMIT
    etree.SubElement(element, "additionalValue").text = decimal(limit)
    etree.SubElement(sign, "position").append(point(lanelet.right[0]))
    etree.SubElement(sign, "virtual").text = "true"
    return sign


def point(place: Sequence[float]) -> etree._Element:
    """The element point of the first two coordinates of a place, m."""
    element = etree.Element("point")
    for tag, value in zip("xy", place, strict=False):
        etree.SubElement(element, tag).text = decimal(value)
    return element
