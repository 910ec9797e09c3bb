"""Waymo Open Motion scenes of 91 steps (or 20 s) at 10 Hz: the data set's own TFRecord files of
Scenarios, and GPUDrive's (and Nocturne's) JSON files, one scene a file.

Source: Ettinger et al., "Large Scale Interactive Motion Forecasting for Autonomous Driving: The
Waymo Open Motion Dataset" (ICCV 2021); Kazemkhani et al., "GPUDrive" (ICLR 2025), and its public
converter. `objects` have a type, a size, and lists of positions (middles of boxes, m), headings
(rad) and velocities (m/s), which count where `valid` is true. `metadata.sdc_track_index` is the
index of the recording vehicle. `roads` are lines: centre lines of lanes, marks, edges, crosswalks;
`map_element_id` tells freeways. Which lanes follow each other is in TFRecord files only, as are
speed limits. `tl_states` has the states of traffic lights by the ids of the
lanes that they are for.

Nocturne's older files have no `metadata`, ids or `map_element_id`, and headings in degrees: objects
are named by their number, no vehicle is the recording one, and all lanes are of streets.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from recognition.recordings.formats import waymo_records
from recognition.recordings.intake import Exclusion, Report
from recognition.recordings.motion.smoothing import smoothed
from recognition.recordings.road_sources import drawn
from recognition.recordings.rows import Clock, columns_of, cut, in_order, rate
from recognition.recordings.source import (
    LightStates,
    SiteRoad,
    Source,
    TrackParticipant,
    participant,
    wrong_size,
)
from recognition.recordings.table import GREATEST, WHOLE_TURN, Table, points, records, value
from runner.recording import Recording
from schemas.common.array_types import FloatArray, IntArray
from schemas.common.errors import InvalidFile
from schemas.common.storage import read_object

FORMAT = "Waymo"
TITLE = "Waymo Open Motion (TFRecord, GPUDrive's JSON)"
BY_CONTENT = True
_STEP = 0.1
_HEAD = 4096
_RECORDS = ".tfrecord"
"""Part of the names of files of records, `training.tfrecord-00000-of-01000` among them"""
_CATEGORIES = {
    "vehicle": "car",
    "pedestrian": "pedestrian",
    "cyclist": "bicycle",
    "other": "obstacle",
    "unset": "obstacle",
}
_LONG = 7.0
"""Vehicles longer than this (m) are trucks"""
_OLDER = "names no recording vehicle"
"""Key that marks a scene of Nocturne's"""
_FREEWAY, _STREET, _BIKE_LANE = 1, 2, 3
"""`map_element_id` of lanes"""
_LANE_TYPES = (0, _FREEWAY, _STREET, _BIKE_LANE)
_EDGES = ("road_line", "road_edge")
_SHORTEST = 1.0
"""Shorter centre lines are no lanes, m"""


def claims(path: Path) -> bool:
    """Whether a file has scenes, by the first keys of its object or its first record."""
    if _RECORDS in path.name:
        return waymo_records.is_scenario(path)
    if path.suffix != ".json":
        return False
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD)
    except OSError:
        return False
    # By the beginning alone: scenes have megabytes, and folders thousands of them.
    return b'"name"' in head and b'"objects"' in head and b'"position"' in head


class SceneFile(NamedTuple):
    """A scene: its file, the name of the recording and of its site, and a function that reads its
    objects, as GPUDrive has them."""

    path: Path
    name: str
    read: Callable[[], Mapping[str, Any]]


def sources(path: Path, roads: Path) -> list[Source]:
    """The recordings of the scenes of a file, each of which is a site of its own.

    Raises:
        InvalidFile: a file of records is cut short.
    """
    if _RECORDS not in path.name:
        return [source_of(SceneFile(path, path.stem, partial(_document, path)), FORMAT)]
    return [
        source_of(
            SceneFile(
                path, f"{path.name}_{number:04d}", partial(waymo_records.scene, path, number)
            ),
            FORMAT,
        )
        for number in range(len(waymo_records.places(path)))
    ]


def _document(path: Path) -> Mapping[str, Any]:
    """A scene of a JSON file, as GPUDrive has them."""
    document = read_object(path)
    listed = document.get("objects")
    if "metadata" in document or not isinstance(listed, list) or any("id" in one for one in listed):
        return document
    objects = [
        {"id": str(number), **one, "heading": _in_radians(one.get("heading"))}
        for number, one in enumerate(listed)
        if isinstance(one, dict)
    ]
    lanes = [
        {"map_element_id": _STREET, **one} for one in records(document, "roads", path, "scene")
    ]
    unsized = [one["id"] for one in objects if 0 in (one.get("length"), one.get("width"))]
    told = ["the recording vehicle is not named, and headings are taken as degrees (Nocturne)"]
    if unsized:
        told.append(f"objects {', '.join(unsized)} have no size: they are left out")
    kept = [one for one in objects if one["id"] not in unsized]
    return {**document, "objects": kept, "roads": lanes, "remarks": told, _OLDER: True}


def _in_radians(headings: Any) -> Any:
    """Headings in degrees in rad; anything else as it is."""
    if not isinstance(headings, list) or not all(type(one) in (int, float) for one in headings):
        return headings
    return [math.remainder(math.radians(one), math.tau) for one in headings]


def source_of(scene: SceneFile, form: str) -> Source:
    """The recording of a scene."""
    return Source(
        scene.name,
        scene.name,
        form,
        scene.path,
        partial(_read, scene),
        scene.path,
        road=partial(_road, scene),
        ego=partial(_ego, scene),
        lights=partial(_lights, scene),
    )


class _SceneObject(NamedTuple):
    """A participant, and its values in each valid step: step, x, y, heading, velocity along x and
    y."""

    who: TrackParticipant
    values: FloatArray


def _ego(scene: SceneFile) -> str | None:
    """Name of the recording vehicle of a scene; None where it has none."""
    return _name_of_ego(scene.read(), scene.path)


def _name_of_ego(document: Mapping[str, Any], path: Path) -> str | None:
    objects = records(document, "objects", path, "scene")
    if document.get(_OLDER):
        return None
    index = value(
        value(document, "metadata", dict, path, "scene"), "sdc_track_index", int, path, "metadata"
    )
    if not 0 <= index < len(objects):
        raise InvalidFile(
            f"sdc_track_index {index} is none of the {len(objects)} objects",
            path=path,
            element="metadata",
        )
    return str(objects[index].get("id"))


def _read(scene: SceneFile) -> tuple[Recording, Report]:
    document, path = scene.read(), scene.path
    ego = _name_of_ego(document, path)
    objects, exclusions, oversized = [], [], []
    for number, one in enumerate(document["objects"], 1):
        found = _object(one, path, f"object {number}", ego)
        if isinstance(found, Exclusion):
            oversized.append(found)
        elif len(found.values):
            objects.append(found)
        else:
            exclusions.append(Exclusion(f"object {found.who.name}", 0, "it has no valid step"))
    # A unit is wrong, not an object.
    if oversized and len(oversized) >= len(objects):
        raise InvalidFile(
            f"most objects are too large, such as {oversized[0].what}: {oversized[0].reason}",
            path=path,
        )
    exclusions += oversized
    names = [recorded.who.name for recorded in objects]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InvalidFile(f"two objects have the id {twice}", path=path, element="objects")
    if ego is not None and ego not in names:
        raise InvalidFile(
            f"object {ego}, the recording vehicle, has no valid step", path=path, element="metadata"
        )
    step, x, y, h, vx, vy = np.concatenate([recorded.values for recorded in objects]).T
    track: IntArray = np.repeat(
        np.arange(len(objects)), [len(recorded.values) for recorded in objects]
    )
    table = Table(path, {"step": step.astype(np.int64)}, lines=False)
    apart = _step(document)
    rows = in_order(table, track, Clock("step", table["step"], 1.0 / apart, apart), names=names)
    report = rows.report(names)
    report.exclusions += exclusions
    who = [recorded.who for recorded in objects]
    speed = vx * np.cos(h) + vy * np.sin(h)
    report.remarks.append("accelerations are derived from the speeds")
    report.remarks.append(f"vehicles longer than {_LONG:g} m are taken for trucks")
    report.remarks += [*_on_lights(document, path), *document.get("remarks", [])]
    columns = columns_of(rows, who, x, y, h, speed, rate(speed, rows))
    return Recording(cut(*smoothed(rows, who, columns, report)), apart, None), report


def _step(document: Mapping[str, Any]) -> float:
    """Time between steps, s; GPUDrive's files do not state it."""
    return float(document.get("step", _STEP))


def _on_lights(document: Mapping[str, Any], path: Path) -> list[str]:
    """A remark on states of traffic lights."""
    count = len(_lit_lanes(document, path))
    if not count:
        return [
            "the scene has no states of traffic lights: its junctions are taken for some without"
        ]
    return [f"{count} lanes have traffic lights"]


def _lights(scene: SceneFile) -> LightStates | None:
    """States of the traffic lights of a scene; None without any.

    Raises:
        InvalidFile: a light has other numbers of states than of places or steps, or a place is no
            number.
    """
    path, document = scene.path, scene.read()
    lights, x, y, steps = [], [], [], 0
    for lane, one in _lit_lanes(document, path).items():
        element = f"traffic light of lane {lane}"
        if not isinstance(one, dict):
            raise InvalidFile("an object is expected", path=path, element=element)
        states, index = (
            value(one, "state", list, path, element),
            value(one, "time_index", list, path, element),
        )
        places = [value(one, axis, list, path, element) for axis in "xy"]
        if not states or len({len(states), len(index), *map(len, places)}) > 1:
            raise InvalidFile(
                "state, x, y and time_index have different lengths, or none",
                path=path,
                element=element,
            )
        if not all(type(step) is int and step >= 0 for step in index):
            raise InvalidFile("time_index holds numbers of steps", path=path, element=element)
        at = _numbers([place[0] for place in places], "x or y", path, element)
        lights.append(dict(zip(index, map(str, states), strict=True)))
        x.append(float(at[0]))
        y.append(float(at[1]))
        steps = max(steps, 1 + max(index))
    if not lights:
        return None
    states_of = tuple(
        tuple(light.get(step, "unknown") for step in range(steps)) for light in lights
    )
    time = _step(document) * np.arange(steps, dtype=np.float64)
    return LightStates(np.array(x), np.array(y), time, states_of)


def _lit_lanes(document: Mapping[str, Any], path: Path) -> dict[str, Any]:
    """States of traffic lights by lanes."""
    return value(document, "tl_states", dict, path, "scene") if document.get("tl_states") else {}


def _object(
    one: Mapping[str, Any], path: Path, element: str, ego: str | None
) -> _SceneObject | Exclusion:
    """A participant; an exclusion if its box is larger than any vehicle, such as the box of a group
    of them."""
    kind = value(one, "type", str, path, element)
    if kind not in _CATEGORIES:
        raise InvalidFile(
            f"type {kind!r} is none of {', '.join(_CATEGORIES)}", path=path, element=element
        )
    valid = value(one, "valid", list, path, element)
    if "id" not in one or not all(isinstance(flag, bool) for flag in valid):
        raise InvalidFile(
            "there is no id, or valid has other values than true and false",
            path=path,
            element=element,
        )
    steps = np.flatnonzero(valid)
    place, velocity = (
        _vectors(one, key, steps, len(valid), path, element) for key in ("position", "velocity")
    )
    headings = value(one, "heading", list, path, element)
    if len(headings) != len(valid):
        raise InvalidFile(
            f"{len(headings)} headings of {len(valid)} steps", path=path, element=element
        )
    turns = _numbers([headings[step] for step in steps], "heading", path, element)
    if (np.abs(turns) > WHOLE_TURN).any():
        raise InvalidFile(
            f"heading {turns[np.abs(turns).argmax()]:g} is no angle in rad",
            path=path,
            element=element,
        )
    size = _numbers([one.get("length"), one.get("width")], "length or width", path, element)
    if len(steps) and not (size > 0.0).all():
        raise InvalidFile(f"{size.min():g} is no size", path=path, element=element)
    category = "truck" if kind == "vehicle" and size[0] > _LONG else _CATEGORIES[kind]
    wrong = wrong_size(category, *size.tolist())
    # The recording vehicle can't be left out: `participant` refuses its size.
    if wrong and str(one["id"]) != ego:
        return Exclusion(f"object {one['id']}", len(steps), wrong)
    who = participant(str(one["id"]), category, *size.tolist())
    return _SceneObject(who, np.column_stack([steps, place, turns, velocity]))


def _vectors(
    one: Mapping[str, Any], key: str, steps: IntArray, count: int, path: Path, element: str
) -> FloatArray:
    """x and y (n, 2) of a vector in the valid steps."""
    listed = value(one, key, list, path, element)
    if len(listed) != count:
        raise InvalidFile(
            f"{key} has {len(listed)} values for {count} steps", path=path, element=element
        )
    chosen = [listed[step] for step in steps]
    if not all(isinstance(vector, dict) for vector in chosen):
        raise InvalidFile(f"{key} is no list of x and y", path=path, element=element)
    return _numbers(
        [vector.get(axis) for vector in chosen for axis in "xy"], key, path, element
    ).reshape(-1, 2)


def _numbers(values: list[Any], what: str, path: Path, element: str) -> FloatArray:
    # The exact type: to isinstance, true is a number.
    wrong = next(
        (
            value
            for value in values
            if type(value) not in (int, float) or not abs(value) <= GREATEST
        ),
        None,
    )
    if wrong is not None or None in values:
        raise InvalidFile(
            f"{what}: {str(wrong)[:40]} is no measured value", path=path, element=element
        )
    return np.array(values, np.float64)


# the road -----------------------------------------------------------------------------------


def _elements(
    document: Mapping[str, Any], path: Path
) -> Iterator[tuple[str, str, Mapping[str, Any]]]:
    """Id, type and values of each element of the map."""
    for number, one in enumerate(records(document, "roads", path, "scene"), 1):
        yield str(one.get("id", f"r{number}")), value(one, "type", str, path, f"road {number}"), one


def _road(scene: SceneFile, _recording: Recording, folder: Path) -> SiteRoad:
    """The road of a scene's lines: neighbours and widths of its lanes are inferred, and successors
    where the scene does not give them.

    Raises:
        InvalidFile: there is no lane, or a line is malformed.
    """
    from xodr.formats.lanelet2.centre_lines import CentreLine, lanelets_of
    from xodr.formats.lanelet2.lanelet import lengths
    from xodr.formats.lanelet2.reader import Crosswalk

    document, path = scene.read(), scene.path
    lit = {*_lit_lanes(document, path)}
    lanes, edges, crosswalks, short = [], [], [], []
    for name, kind, one in _elements(document, path):
        element = f"{kind} {name}"
        if kind in _EDGES:
            edges.append(points(one, "geometry", path, element))
        elif kind == "crosswalk":
            crosswalks.append(Crosswalk(name, points(one, "geometry", path, element)))
        elif kind == "lane":
            line, number = points(one, "geometry", path, element), one.get("map_element_id")
            if number not in _LANE_TYPES:
                raise InvalidFile(
                    f"map_element_id {number!r} is no lane's", path=path, element=element
                )
            if len(line) < 2 or lengths(line)[-1] < _SHORTEST:
                short.append(name)
                continue
            types = (
                "biking" if number == _BIKE_LANE else "driving",
                "motorway" if number == _FREEWAY else "town",
            )
            limit, exits = float(one.get("speed_limit", math.inf)), one.get("exits")
            successors = None if exits is None else tuple(exits)
            lanes.append(
                CentreLine(name, line, *types, limit, successors, (name,) if name in lit else ())
            )
    if not lanes:
        raise InvalidFile(
            "the scene has no lanes, so its roads are unknown", path=path, element="roads"
        )
    # No link may lead to a lane that was left out.
    known = {lane.id for lane in lanes}
    lanes = [
        lane
        if lane.successors is None
        else replace(lane, successors=tuple(one for one in lane.successors if one in known))
        for lane in lanes
    ]
    lanelets, inferred = lanelets_of(lanes, edges)
    notes = ["freeways are taken for motorways, other roads for those of a town"]
    if all(math.isinf(lane.speed_limit) for lane in lanes):
        notes.insert(0, "the map gives no speed limits")
    notes += (
        [f"lanes of less than {_SHORTEST:g} m are left out: {' '.join(short)}"] if short else []
    )
    return drawn(
        lanelets,
        scene.name,
        folder,
        [crosswalk for crosswalk in crosswalks if len(crosswalk.outline) > 2],
        [*notes, *inferred],
    )
