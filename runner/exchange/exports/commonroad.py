"""Target `commonroad`: the run as a CommonRoad 2020a scenario, with lanelets, obstacles and the
ego's planning problem.

Source: CommonRoad "XML Format" 2020a, and its scheme of benchmark ids. Positions are those of the
bounding box's centre. The ego is the planning problem: it starts as it did, and its goal is where
it ended, or was before its first contact, so that its own way up to there solves the problem; that
way is not in the file, those of all others are.

Coordinates are those of the roads: the projected ones, turned and shifted as `geoTransformation`
says, in the sense of OpenDRIVE's header (projected = turned by `zRotation`, then shifted by the
translation). Heights, pitch and roll are written where there are some; commonroad-io reads those of
states, and not those of lanelets.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import count, groupby
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from lxml import etree

from runner.engine.worlds.sumo_translation import GREEN, OFF, RED, RED_YELLOW, YELLOW, YIELD
from runner.exchange.exports.moments import (
    box_centre,
    date,
    decimal,
    fixed_point,
    rate,
    stands,
    unsupported,
    wrapped,
)
from runner.exchange.exports.osi_signals import VehicleLights, link_at
from runner.recording import signal_states
from schemas.common.errors import ToolchainError
from schemas.common.fates import changed, kept, lost
from xodr.formats.commonroad import LANELET_TYPES, LINE_MARKINGS, ROAD_LANELETS
from xodr.lookup.geo import GeoReference
from xodr.lookup.lanelets import ExportedLanelet, Key, lanelets
from xodr.lookup.signals import SignalPlace, arrow, signal_places, speed_of
from xosc.writing.versions import with_recent

if TYPE_CHECKING:
    from runner.judging.result import RunResult
    from runner.recording import Track
    from xodr import RoadNetwork
    from xosc.exports.draft import Folder

TARGETS = {"commonroad": "CommonRoad 2020a XML: lanelets, obstacles, planning problem"}
_NO_NAMES, _SCENARIO = "participants have numbers", "a scenario is what may be driven, not what was"
_CENTRE = "positions are box centres; the shift of the box is lost"
FATES = {
    "name": lost(_NO_NAMES), "kind": changed("`type` of the obstacle: car, truck, bus, bicycle, …"),
    "category": changed("`type` of the obstacle: car, truck, bus, bicycle, …"),
    "role": changed("ambulance, fire and police are priorityVehicle; others are lost"),
    "length and width": kept("`rectangle`"), "height of the box": lost("shapes are flat"),
    "box about the reference point": lost(_CENTRE), "front axle": lost("no attribute"),
    "mass": lost("no attribute"),
    "ego": kept("`planningProblem`"), "time": kept("`time`"),
    "position": changed("box centres; the ego has its start and its goal, its way is the solution"),
    "height": changed("`positionZ` of all but the ego, where roads are not flat"),
    "heading": kept("`orientation`"),
    "pitch": changed("`pitchAngle`, `rollAngle` of all but the ego, where roads are not flat"),
    "roll": changed("`pitchAngle`, `rollAngle` of all but the ego, where roads are not flat"),
    "speed": kept("`velocity`"),
    "acceleration": kept("`acceleration`"),
    "place on the road": lost("lanelets are found by position"),
    "lights": changed("indicators, warning, brake and blue lights: lit or not"),
    "events": lost(_SCENARIO),
    "verdict": lost(_SCENARIO), "criticality": lost(_SCENARIO), "tags": lost(_SCENARIO),
    "projection": kept("`geoReference`"), "offset": kept("`additionalTransformation`"),
    "lane borders": kept("bounds"),
    "road heights": kept("z of points"), "lane heights": kept("z of points"),
    "lane types": changed("`laneletType`: what both have; others have the type of their road"),
    "speed limits": kept("sign 274"),
    "road marks": changed("types that CommonRoad has; colours and widths are lost"),
    "lane links": kept("`successor`"), "neighbours": kept("`adjacentLeft`, `adjacentRight`"),
    "junctions": changed("their lanelets have the type intersection"),
    "signs": changed("those with a number that CommonRoad has, without heights"),
    "traffic lights": kept("`trafficLight`"), "light states": kept("`cycle`"),
    "objects": lost("no element for things beside the road"),
}  # fmt: skip
"""Fates of `runner.exchange.exports.RUN_FIELDS`"""
_OBSTACLES = with_recent({
    "car": "car", "van": "car", "truck": "truck", "trailer": "truck", "semitrailer": "truck",
    "bus": "bus",
    "motorbike": "motorcycle", "bicycle": "bicycle", "train": "train", "tram": "train",
    "pedestrian": "pedestrian",
})  # fmt: skip
"""CommonRoad's types by OpenSCENARIO category; everything else is `unknown`."""
_PRIORITY = {"ambulance", "fire", "police"}
"""Roles of obstacles of type priorityVehicle."""
_UNKNOWN_PLACE = {"geoNameId": "-999", "gpsLatitude": "999", "gpsLongitude": "999"}
"""Location of CommonRoad scenarios without a geographic position."""
_FACING = 0.25
"""rad to either side by which one may face otherwise at the goal"""


def export(result: RunResult, name: str, folder: Folder) -> list[str]:
    """Write the scenario of a run.

    Raises:
        Unsupported: there are no roads or no ego, or a participant appears later than at the
            beginning.
        UsageError: a file is in the way.
    """
    remarks: list[str] = []
    root = scenario(result, name, remarks)
    etree.indent(root)
    folder.write(
        f"{name}.xml", etree.tostring(root, xml_declaration=True, encoding="UTF-8") + b"\n"
    )
    return remarks


def scenario(result: RunResult, name: str, remarks: list[str]) -> etree._Element:
    """The element commonRoad of a run; arguments and errors as in `export`.

    Args:
        remarks: gets what is left out.
    """
    network, tracks = result.recording.network, result.recording.tracks
    if network is None:
        raise unsupported(
            result, None, "CommonRoad scenarios are on lanelets, and this one has no roads"
        )
    if result.ego is None or result.ego not in tracks:
        raise unsupported(
            result,
            None,
            "CommonRoad scenarios have a planning problem, and this one has no ego to plan for",
        )
    # Obstacles of CommonRoad are there from the first step on.
    for track in tracks.values():
        if track.columns["time"][0] > 0.0:
            raise unsupported(
                result,
                track.name,
                f"{track.name!r} appears at {track.columns['time'][0]:g} s, but obstacles of "
                "CommonRoad start at 0 s",
            )
    numbers = count(1)
    root = etree.Element("commonRoad", _header(result, name))
    root.append(_location(network, remarks))
    etree.SubElement(etree.SubElement(root, "scenarioTags"), "simulated")
    root.extend(
        map_elements(list(lanelets(network).values()), numbers, _signals(result, network, remarks))
    )
    lights = VehicleLights(result.events)
    others = [track for track in tracks.values() if track.name != result.ego]
    standing = [track for track in others if stands(track)]
    # CommonRoad's schema has static obstacles before dynamic ones.
    for track in (*standing, *(track for track in others if track not in standing)):
        element = _obstacle(track, track in standing, next(numbers), result.recording.timestep)
        if track not in standing:
            _add_lights(element, track, lights)
        root.append(element)
    root.append(
        _problem(tracks[result.ego], next(numbers), result.recording.timestep, _goal_row(result))
    )
    return root


def _location(network: RoadNetwork, remarks: list[str]) -> etree._Element:
    """Return the place of the roads' origin on Earth, and the projection of coordinates."""
    location = etree.Element("location")
    values = dict(_UNKNOWN_PLACE)
    transformation = None
    if network.geo_reference is not None:
        try:
            origin = GeoReference(network).to_geodetic(0.0, 0.0)
        except ToolchainError as error:
            remarks.append(f"the place on Earth is left out: {error.message}")
        else:
            values |= {
                "gpsLatitude": f"{origin.latitude:.10f}",
                "gpsLongitude": f"{origin.longitude:.10f}",
            }
            transformation = etree.Element("geoTransformation")
            etree.SubElement(transformation, "geoReference").text = network.geo_reference
            more = etree.SubElement(transformation, "additionalTransformation")
            x, y, _, heading = network.header.offset
            parts = {"xTranslation": x, "yTranslation": y, "zRotation": heading, "scaling": 1.0}
            for tag, value in parts.items():
                etree.SubElement(more, tag).text = f"{value:.10f}"
    for tag, text in values.items():
        etree.SubElement(location, tag).text = text
    if transformation is not None:
        location.append(transformation)
    return location


def _header(result: RunResult, name: str) -> dict[str, str]:
    return {
        "timeStepSize": decimal(result.recording.timestep), "commonRoadVersion": "2020a",
        "author": "xosc-toolchain",
        "affiliation": "xosc-toolchain", "source": result.scenario.name,
        "benchmarkID": benchmark_id(name),
        "date": date(result)[:10],
    }  # fmt: skip


def benchmark_id(name: str) -> str:
    """The benchmark id of a run: country, scene, number of the map and the configuration, kind and
    number of the prediction.

    A set of parameters of a distribution (`NAME~000003`) is a configuration of its own, as
    CommonRoad counts: from 1.
    """
    stem, _, number = name.partition("~")
    if not number.isdecimal():
        stem, number = name, "0"
    scene = "".join(c for c in stem.title() if c.isascii() and c.isalnum())
    return f"ZAM_{scene or 'Run'}-1_{int(number) + 1}_T-1"


def _obstacle(track: Track, standing: bool, number: int, step: float) -> etree._Element:
    element = etree.Element("staticObstacle" if standing else "dynamicObstacle", id=str(number))
    etree.SubElement(element, "type").text = "unknown" if standing else _kind(track)
    etree.SubElement(element, "shape").append(_rectangle(track))
    first, *more = _states(track, step)
    element.append(first)
    if not standing:
        way = etree.SubElement(element, "trajectory")
        way.extend(more or _waiting(first))
    return element


def _kind(track: Track) -> str:
    return (
        "priorityVehicle" if track.role in _PRIORITY else _OBSTACLES.get(track.category, "unknown")
    )


def _states(track: Track, step: float) -> list[etree._Element]:
    columns, centre, ground = (
        track.columns,
        box_centre(track),
        fixed_point(track, track.box.x, track.box.y, 0.0),
    )
    # commonroad-io reads heights where they are written: flat scenes go without.
    tilts = any(bool(np.any(columns[name])) for name in ("z", "pitch", "roll"))
    times = np.rint(columns["time"] / step).astype(int)
    # Unwrapped: a jump from π to -π would be a rate.
    turning = rate(np.unwrap(columns["h"].astype(float)), columns["time"])
    rows = zip(
        centre,
        wrapped(columns["h"]),
        times,
        columns["speed"],
        columns["acceleration"],
        turning,
        strict=True,
    )
    states = []
    for number, (place, h, time, speed, acceleration, turn) in enumerate(rows):
        state = etree.Element("state" if number else "initialState")
        etree.SubElement(state, "position").append(point(place))
        _exact(
            state,
            {
                "orientation": h,
                "time": int(time),
                "velocity": speed,
                "acceleration": acceleration,
                "yawRate": turn,
            },
        )
        if tilts:
            values = {
                "positionZ": ground[number, 2],
                "pitchAngle": columns["pitch"][number],
                "rollAngle": columns["roll"][number],
            }
            _exact(state, values)
        states.append(state)
    return states


_LIGHTS = {
    "indicatorLeft": "indicatorLeft", "indicatorRight": "indicatorRight",
    "brakingLights": "brakeLights",
    "hazardWarningLights": "warningLights", "flashingBlueLights": "specialPurposeLights",
}  # fmt: skip
"""OpenSCENARIO's lights by those that CommonRoad has."""


def _add_lights(obstacle: etree._Element, track: Track, lights: VehicleLights) -> None:
    """The states of an obstacle's lights at each step, where the scenario sets one."""
    modes = [lights.at(track.name, float(time)) for time in track.columns["time"]]
    if not any(modes):
        return
    series = etree.Element("signalSeries")
    for number, lit in enumerate(modes):
        state = etree.Element("signalState" if number else "initialSignalState")
        etree.SubElement(etree.SubElement(state, "time"), "exact").text = str(number)
        for tag, light in _LIGHTS.items():
            etree.SubElement(state, tag).text = (
                "true" if lit.get(light, "off") != "off" else "false"
            )
        if number:
            series.append(state)
        else:
            start = obstacle.find("initialState")
            assert start is not None
            start.addnext(state)
    if len(series):
        obstacle.append(series)


def _waiting(first: etree._Element) -> Iterable[etree._Element]:
    """Return the single state of an entity present at one step only: CommonRoad requires one after
    the first."""
    second = etree.fromstring(etree.tostring(first))
    second.tag = "state"
    time = second.find("time/exact")
    assert time is not None
    time.text = "1"
    return [second]


def _goal_row(result: RunResult) -> int:
    """Row of the ego's track with its goal: the last one, or the last before its first contact."""
    times = result.recording.tracks[str(result.ego)].columns["time"]
    contacts = [event for event in result.events if event.kind == "collision"]
    touched = [
        contact.time
        for contact in contacts
        if contact.subject == result.ego or contact.text == f"touches {result.ego}"
    ]
    # A whole step before the contact: at its instant the goal would be taken.
    before = np.flatnonzero(times < min(touched, default=np.inf) - result.recording.timestep / 2)
    return int(before[-1]) if len(before) else len(times) - 1


def _problem(track: Track, number: int, step: float, goal_row: int) -> etree._Element:
    """The ego's planning problem: to come, by the end of the run, to where it came, facing as it
    did."""
    problem = etree.Element("planningProblem", id=str(number))
    columns, centre = track.columns, box_centre(track)
    start = etree.SubElement(problem, "initialState")
    etree.SubElement(start, "position").append(point(centre[0]))
    turning = rate(np.unwrap(columns["h"].astype(float)), columns["time"])[0]
    values = {
        "velocity": columns["speed"][0],
        "orientation": wrapped(columns["h"])[0],
        "yawRate": turning,
        "slipAngle": 0.0,
    }
    _exact(start, {**values, "time": 0, "acceleration": columns["acceleration"][0]})
    goal = etree.SubElement(problem, "goalState")
    time = etree.SubElement(goal, "time")
    etree.SubElement(time, "intervalStart").text = "0"
    etree.SubElement(time, "intervalEnd").text = str(
        # An interval of no length can't be reached.
        max(round(float(columns["time"][-1]) / step), 1)
    )
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
        etree.SubElement(etree.SubElement(state, tag), "exact").text = (
            str(value) if isinstance(value, int) else decimal(value)
        )


# the map: lanelets, signs and lights -----------------------------------------------------------

_SPEED_LIMIT = "274"
"""Number of the sign (German, and that of CommonRoad's land Zamunda)."""


_SIGNS = {
    "101", "102", "114", "123", "124", "125", "131", "138", "201", "205", "206", "208", "209",
    "215", "237", "239", "240", "245", "250", "251", "253", "254", "255", "259", "260", "261",
    "267", "274", "274.1", "274.2", "275", "276", "277", "278", "280", "281", "282", "301", "306",
    "308", "310", "311", "314", "325.1", "325.2", "327", "330.1", "330.2", "331.1", "331.2", "350",
    "354", "356", "357",
}  # fmt: skip
"""Numbers of signs that CommonRoad has."""
_WITH_SPEED = {"274", "274.1", "274.2", "275", "278"}
_GERMAN = {"", "OPENDRIVE", "DE", "DEU", "GERMANY"}
_COLOURS = {
    RED: "red",
    RED_YELLOW: "redYellow",
    YELLOW: "yellow",
    YIELD: "yellow",
    GREEN: "green",
    OFF: "inactive",
}


class MapSignals(NamedTuple):
    """Signs with their numbers, and lights with their phases: number of steps and colour."""

    signs: tuple[tuple[SignalPlace, str], ...] = ()
    lights: tuple[tuple[SignalPlace, tuple[tuple[int, str], ...]], ...] = ()


def _signals(result: RunResult, network: RoadNetwork, remarks: list[str]) -> MapSignals:
    """Signs and lights of the roads; lights with their states during a run."""
    places = signal_places(network)
    numbered = [(place, place.signal.type) for place in places if not place.signal.dynamic]
    signs = [
        (place, kind)
        for place, kind in numbered
        if kind in _SIGNS and place.signal.country.upper() in _GERMAN
    ]
    if len(signs) < len(numbered):
        remarks.append(
            f"{len(numbered) - len(signs)} signs have no number in CommonRoad and are left out"
        )
    history = signal_states(result.events)
    steps = round(result.end_time / result.recording.timestep) + 1
    lights = []
    for place in places:
        if not place.signal.dynamic:
            continue
        changes = history.get(place.signal.id, [])
        links = [link_at(changes, step * result.recording.timestep) for step in range(steps)]
        # Without a state a light is inactive: CommonRoad has no unknown colour.
        colours = [_COLOURS[OFF if link is None else link] for link in links]
        lights.append(
            (place, tuple((len(list(same)), colour) for colour, same in groupby(colours)))
        )
    return MapSignals(tuple(signs), tuple(lights))


def map_elements(
    lanes: Sequence[ExportedLanelet], numbers: count[int], signals: MapSignals
) -> list[etree._Element]:
    """The lanelets, one sign for each speed limit, and signs and lights that stand at the roads;
    lanelets refer to them.

    Args:
        numbers: gives the ids, which are unique in a scenario.
        signals: of the roads.
    """
    ids = {lanelet.key: str(next(numbers)) for lanelet in lanes}
    limits = sorted({lanelet.limit for lanelet in lanes if lanelet.limit is not None})
    limit_ids = {limit: str(next(numbers)) for limit in limits}
    signs = [(str(next(numbers)), *sign) for sign in signals.signs]
    lights = [(str(next(numbers)), *light) for light in signals.lights]
    sign_refs, light_refs = _refs(signs), _refs(lights)
    heights = any(
        bool(np.any(lanelet.left[:, 2])) or bool(np.any(lanelet.right[:, 2])) for lanelet in lanes
    )
    made = []
    for lanelet in lanes:
        element = etree.Element("lanelet", id=ids[lanelet.key])
        for tag, points, mark in zip(
            ("leftBound", "rightBound"), (lanelet.left, lanelet.right), lanelet.marks, strict=True
        ):
            bound = etree.SubElement(element, tag)
            bound.extend(point(place, heights) for place in points)
            etree.SubElement(bound, "lineMarking").text = LINE_MARKINGS.get(mark, "unknown")
        for tag, keys in (("predecessor", lanelet.predecessors), ("successor", lanelet.successors)):
            element.extend(etree.Element(tag, ref=ids[key]) for key in keys)
        for tag, beside in zip(("adjacentLeft", "adjacentRight"), lanelet.beside, strict=True):
            if beside is not None:
                etree.SubElement(
                    element, tag, ref=ids[beside[0]], drivingDir="same" if beside[1] else "opposite"
                )
        for kind in _types(lanelet):
            etree.SubElement(element, "laneletType").text = kind
        if lanelet.limit is not None:
            etree.SubElement(element, "trafficSignRef", ref=limit_ids[lanelet.limit])
        element.extend(
            etree.Element("trafficSignRef", ref=ref) for ref in sign_refs.get(lanelet.key, ())
        )
        element.extend(
            etree.Element("trafficLightRef", ref=ref) for ref in light_refs.get(lanelet.key, ())
        )
        made.append(element)
    # A limit of OpenDRIVE has no sign: a virtual one stands at its first lanelet.
    first = {
        limit: next(lanelet for lanelet in lanes if lanelet.limit == limit) for limit in limits
    }
    made += [_limit_sign(limit_ids[limit], limit, first[limit]) for limit in limits]
    made += [_sign(number, place, kind) for number, place, kind in signs]
    return made + [_light(number, place, phases) for number, place, phases in lights]


def _refs(numbered: Iterable[tuple[str, SignalPlace, object]]) -> dict[Key, list[str]]:
    """Numbers of the signals that hold on each lane."""
    refs: dict[Key, list[str]] = {}
    for number, place, _ in numbered:
        for key in place.lanes:
            refs.setdefault(key, []).append(number)
    return refs


def _sign(number: str, place: SignalPlace, kind: str) -> etree._Element:
    sign = etree.Element("trafficSign", id=number)
    element = etree.SubElement(sign, "trafficSignElement")
    etree.SubElement(element, "trafficSignID").text = kind
    speed = speed_of(place.signal) if kind in _WITH_SPEED else None
    if speed is not None:
        etree.SubElement(element, "additionalValue").text = decimal(speed)
    etree.SubElement(sign, "position").append(point((place.x, place.y)))
    etree.SubElement(sign, "virtual").text = "false"
    return sign


def _light(number: str, place: SignalPlace, phases: Sequence[tuple[int, str]]) -> etree._Element:
    light = etree.Element("trafficLight", id=number)
    cycle = etree.SubElement(light, "cycle")
    for steps, colour in phases:
        phase = etree.SubElement(cycle, "cycleElement")
        etree.SubElement(phase, "duration").text = str(steps)
        etree.SubElement(phase, "color").text = colour
    etree.SubElement(light, "position").append(point((place.x, place.y)))
    etree.SubElement(light, "direction").text = arrow(place.signal) or "all"
    etree.SubElement(light, "active").text = (
        "true" if any(colour != "inactive" for _, colour in phases) else "false"
    )
    return light


def _types(lanelet: ExportedLanelet) -> list[str]:
    own = LANELET_TYPES.get(lanelet.lane_type) or ROAD_LANELETS.get(lanelet.road_type, "unknown")
    return [own, *(["intersection"] if lanelet.in_junction else [])]


def _limit_sign(number: str, limit: float, lanelet: ExportedLanelet) -> etree._Element:
    sign = etree.Element("trafficSign", id=number)
    element = etree.SubElement(sign, "trafficSignElement")
    etree.SubElement(element, "trafficSignID").text = _SPEED_LIMIT
    etree.SubElement(element, "additionalValue").text = decimal(limit)
    etree.SubElement(sign, "position").append(point(lanelet.right[0]))
    etree.SubElement(sign, "virtual").text = "true"
    return sign


def point(place: Sequence[float], height: bool = False) -> etree._Element:
    """The element point of a place, m; without its height unless asked for."""
    element = etree.Element("point")
    for tag, value in zip("xyz" if height else "xy", place, strict=False):
        etree.SubElement(element, tag).text = decimal(value)
    return element
