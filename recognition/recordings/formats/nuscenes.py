"""nuScenes: a folder of JSON tables with scenes of 20 s, boxes at 2 Hz, on maps of the map
expansion (1.3 or later).

Source: Caesar et al., "nuScenes: A multimodal dataset for autonomous driving" (CVPR 2020), and the
schemas of the public devkit. Read are `scene`, `log`, `sample`, `sample_annotation`, `instance`,
`category` and `ego_pose`, and `sample_data` if present: it tells which poses are of a scene. Times
are µs, places m in the map's frame, rotations quaternions w x y z, sizes width and length. The pose
of the recording vehicle is that of the middle of its rear axle. Maps are `expansion/LOCATION.json`
or `maps/expansion/LOCATION.json` at the tables or above: centre lines of lanes and connectors as
arcs, with what leads to what. Singapore has left-hand traffic.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache, partial
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from recognition.recordings.conditions import UNKNOWN, OddConditions
from recognition.recordings.intake import Report
from recognition.recordings.motion.smoothing import smoothed
from recognition.recordings.road_sources import drawn
from recognition.recordings.rows import Clock, check_sizes, columns_of, cut, in_order, rate
from recognition.recordings.source import SiteRoad, Source, TrackParticipant, participant
from recognition.recordings.table import GREATEST, Kind, Table, named, read_records, records, value
from runner.recording import Recording
from schemas.common.array_types import FloatArray, IntArray
from schemas.common.errors import InvalidFile
from schemas.common.storage import read_object
from xodr.formats.lanelet2.centre_lines import CentreLine

FORMAT = "nuScenes"
TITLE = "nuScenes"
BY_CONTENT = False
EGO = "ego"
"""Name of the recording vehicle."""
_STEP = 0.1
_MICROSECONDS = 1e6
_MISSING = 1.1
"""Keyframes farther apart than this (s) have others between them, which are missing: 2 Hz is usual
"""
_EGO_SIZE = (4.084, 1.73)
"""Length and width of the recording vehicles, Renault Zoe, m"""
_LEVELS = 2
_AROUND = 80.0
"""The road has the lanes that are no farther than this from where vehicles were, m"""
_SCENES: dict[str, Kind] = {"token": "text", "name": "text", "log_token": "text"}
_SAMPLES: dict[str, Kind] = {"token": "text", "timestamp": "stamp", "scene_token": "text"}
_PLACE: dict[str, Kind] = {f"translation.{axis}": "number" for axis in range(2)}
_POSE: dict[str, Kind] = _PLACE | {f"rotation.{part}": "number" for part in range(4)}
_BOXES: dict[str, Kind] = {
    "sample_token": "text",
    "instance_token": "text",
    "size.0": "number",
    "size.1": "number",
    **_POSE,
}
_CATEGORIES = {
    "vehicle.car": "car", "vehicle.emergency": "car", "vehicle.truck": "truck",
    "vehicle.construction": "truck",
    "vehicle.bus": "bus", "vehicle.trailer": "trailer", "vehicle.motorcycle": "motorbike",
    "vehicle.bicycle": "bicycle",
    "human.pedestrian": "pedestrian", "animal": "obstacle", "movable_object": "obstacle",
    "static_object": "obstacle",
}  # fmt: skip
"""Category by the beginning of nuScenes's name"""


def claims(path: Path) -> bool:
    """Whether a file is the table of scenes beside one of boxes."""
    return path.name == "scene.json" and path.with_name("sample_annotation.json").is_file()


def sources(path: Path, roads: Path) -> list[Source]:
    """The recording of each scene; those of one location have one site.

    Raises:
        InvalidFile: the tables of scenes or logs are malformed, or a scene is of no log.
    """
    scenes = read_records(path, _SCENES)
    logs = read_records(path.with_name("log.json"), {"token": "text", "location": "text"})
    location = dict(zip(logs["token"], logs["location"], strict=True))
    recordings = []
    for row, (token, name, log) in enumerate(zip(*(scenes[key] for key in _SCENES), strict=True)):
        if log not in location:
            raise scenes.fault(row, "log_token", f"{log} is not in log.json")
        site = location[log]
        map_ = _map(path, site)
        road = partial(_road, map_ or path.parent / "maps" / "expansion" / f"{site}.json", name)
        recordings.append(
            Source(
                name,
                site,
                FORMAT,
                path,
                partial(_read, path, token),
                map_,
                road=road,
                ego=lambda: EGO,
                odd=partial(_conditions, path, row),
            )
        )
    return recordings


def _conditions(path: Path, row: int) -> OddConditions:
    """Rain and night, which descriptions of scenes name."""
    try:
        text = str(read_records(path, {"description": "text"})["description"][row])
    except InvalidFile:  # a table of scenes without descriptions states nothing
        return OddConditions()
    words = set(re.findall(r"[a-z]+", text.lower()))
    return OddConditions(
        "rain" if words & {"rain", "rainy", "raining"} else UNKNOWN,
        "night" if "night" in words else UNKNOWN,
    )


def _map(path: Path, location: str) -> Path | None:
    folders = [
        parent / where
        for parent in list(path.parents)[:_LEVELS]
        for where in ("maps/expansion", "expansion")
    ]
    return next(
        (file for folder in folders if (file := folder / f"{location}.json").is_file()), None
    )


# tracks -------------------------------------------------------------------------------------


@lru_cache(maxsize=4)
def _table(path: Path, kinds: tuple[tuple[str, Kind], ...], _version: int) -> Table:
    """A table, kept for the scenes that are read one after the other."""
    return read_records(path, dict(kinds))


def _beside(path: Path, name: str, kinds: Mapping[str, Kind]) -> Table:
    file = path.with_name(f"{name}.json")
    return _table(file, tuple(kinds.items()), file.stat().st_mtime_ns if file.is_file() else 0)


class _Keyframes(NamedTuple):
    """Places of a participant at its times (s), ascending: x, y, heading."""

    who: TrackParticipant
    time: FloatArray
    values: FloatArray


def _read(path: Path, scene: str) -> tuple[Recording, Report]:
    samples = _beside(path, "sample", _SAMPLES)
    own = samples.where(samples["scene_token"] == scene)
    if len(own) < 2:
        raise InvalidFile(
            f"the scene has {len(own)} samples in sample.json, two or more are needed", path=path
        )
    zero = int(own["timestamp"].min())
    at = {
        token: (int(stamp) - zero) / _MICROSECONDS
        for token, stamp in zip(own["token"], own["timestamp"], strict=True)
    }
    objects = [*_objects(path, at), _ego(path, zero, at)]
    tracks = [(one.who, *_between(one.time, one.values)) for one in objects]
    counts = np.concatenate([steps for _, steps, _ in tracks])
    x, y, h = np.concatenate([values for _, _, values in tracks]).T
    names = [one.who.name for one in objects]
    table = Table(path.with_name("sample_annotation.json"), {"timestamp": counts}, lines=False)
    track = np.repeat(np.arange(len(tracks)), [len(steps) for _, steps, _ in tracks])
    rows = in_order(table, track, Clock("timestamp", counts, 1.0 / _STEP, _STEP), names=names)
    report = rows.report(names)
    report.remarks.append(
        "boxes are given at 2 Hz: rows at 10 Hz between them are interpolated, speeds "
        "are derived from them"
    )
    who = [one.who for one in objects]
    speed = rate(x, rows) * np.cos(h) + rate(y, rows) * np.sin(h)
    columns = columns_of(rows, who, x, y, h, speed, rate(speed, rows))
    return Recording(cut(*smoothed(rows, who, columns, report)), _STEP, None), report


def _objects(path: Path, at: Mapping[str, float]) -> Iterator[_Keyframes]:
    """The participants of a scene, named after their instances.

    Raises:
        InvalidFile: a box is malformed, or of an unknown instance or category.
    """
    boxes = _beside(path, "sample_annotation", _BOXES)
    boxes = boxes.where(np.isin(boxes["sample_token"], list(at)))
    if not len(boxes):
        return
    check_sizes(boxes, ("size.0", "size.1"))
    category = _categories_of(path)
    time = np.array([at[token] for token in boxes["sample_token"]])
    x, y, h = boxes["translation.0"], boxes["translation.1"], _headings(boxes)
    tokens, track = np.unique(boxes["instance_token"].astype(str), return_inverse=True)
    # Tokens have 32 hexadecimal digits: the shortest beginning that tells them apart, 8 at least.
    length = next(
        n for n in range(8, 65) if n == 64 or len({token[:n] for token in tokens}) == len(tokens)
    )
    for number, token in enumerate(tokens.tolist()):
        rows = np.flatnonzero(track == number)
        rows = rows[np.argsort(time[rows], kind="stable")]
        first = int(rows[0])
        if token not in category:
            raise boxes.fault(first, "instance_token", f"{token} is not in instance.json")
        again = np.flatnonzero(np.diff(time[rows]) <= 0.0)
        if len(again):
            raise boxes.fault(
                int(rows[again[0] + 1]),
                "sample_token",
                f"instance {token} has two boxes in this sample",
            )
        # Sizes are width, length, height.
        who = participant(
            token[:length],
            category[token],
            float(boxes["size.1"][first]),
            float(boxes["size.0"][first]),
        )
        yield _Keyframes(who, time[rows], np.column_stack([x, y, h])[rows])


def _categories_of(path: Path) -> dict[str, str]:
    """Category of each instance."""
    instances = _beside(path, "instance", {"token": "text", "category_token": "text"})
    table = _beside(path, "category", {"token": "text", "name": "text"})
    categories = {}
    for row, (token, name) in enumerate(zip(table["token"], table["name"], strict=True)):
        categories[token] = next(
            (kind for start, kind in _CATEGORIES.items() if name.startswith(start)), ""
        )
        if not categories[token]:
            raise table.fault(row, "name", f"{name!r} begins with none of {', '.join(_CATEGORIES)}")
    unknown = next(
        (row for row, token in enumerate(instances["category_token"]) if token not in categories),
        None,
    )
    if unknown is not None:
        raise instances.fault(unknown, "category_token", "it is not in category.json")
    return {
        token: categories[kind]
        for token, kind in zip(instances["token"], instances["category_token"], strict=True)
    }


def _ego(path: Path, zero: int, at: Mapping[str, float]) -> _Keyframes:
    """The recording vehicle in a scene.

    Raises:
        InvalidFile: fewer than two poses are of the time of the scene.
    """
    poses = _beside(path, "ego_pose", {"token": "text", "timestamp": "stamp", **_POSE})
    inside = np.ones(len(poses), bool)
    if path.with_name("sample_data.json").is_file():
        data = _beside(path, "sample_data", {"sample_token": "text", "ego_pose_token": "text"})
        inside = np.isin(
            poses["token"], data["ego_pose_token"][np.isin(data["sample_token"], list(at))]
        )
    time = (poses["timestamp"] - zero) / _MICROSECONDS
    chosen = np.flatnonzero(inside & (time >= -_STEP) & (time <= max(at.values()) + _STEP))
    # Sensors have poses of their own, some at the same time.
    _, first = np.unique(time[chosen], return_index=True)
    rows = chosen[first]
    if len(rows) < 2 or np.ptp(time[rows]) < _STEP:
        raise InvalidFile(
            "no poses of the recording vehicle are of the time of the scene", path=poses.path
        )
    own = participant(EGO, "car", *_EGO_SIZE)
    h = _headings(poses)[rows]
    # Poses are of the rear axle, `columns_of` takes centres.
    x = poses["translation.0"][rows] + own.box.x * np.cos(h)
    y = poses["translation.1"][rows] + own.box.x * np.sin(h)
    return _Keyframes(own, time[rows], np.column_stack([x, y, h]))


def _headings(table: Table) -> FloatArray:
    """Headings of the quaternions of a table, rad."""
    w, x, y, z = quaternion = np.stack([table[f"rotation.{part}"] for part in range(4)])
    wrong = np.flatnonzero(np.abs((quaternion**2).sum(axis=0) - 1.0) > 0.01)
    if len(wrong):
        raise table.fault(int(wrong[0]), "rotation.0", "the quaternion has not the length 1")
    return np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def _between(time: FloatArray, values: FloatArray) -> tuple[IntArray, FloatArray]:
    """Steps at 10 Hz from the first to the last keyframe, without those where keyframes are
    missing, and values in between."""
    from scipy.interpolate import PchipInterpolator

    # Headings are interpolated: a jump of 2π between keyframes would spin the vehicle.
    values = np.column_stack([values[:, :2], np.unwrap(values[:, 2])])
    steps: list[IntArray] = []
    found: list[FloatArray] = []
    for rows in np.split(np.arange(len(time)), np.flatnonzero(np.diff(time) > _MISSING) + 1):
        first, last = (
            math.ceil(time[rows[0]] / _STEP - 1e-6),
            math.floor(time[rows[-1]] / _STEP + 1e-6),
        )
        own = np.arange(max(first, 0), last + 1)
        if len(rows) == 1 or not len(own):
            own, there = np.array([max(round(time[rows[0]] / _STEP), 0)]), values[rows[:1]]
        else:
            # Monotone cubics: a standing vehicle stays in place between keyframes, where splines
            # would swing.
            there = PchipInterpolator(time[rows], values[rows])(
                np.clip(own * _STEP, time[rows[0]], time[rows[-1]])
            )
        # Pieces that round to one step would give two rows of one time.
        if not steps or own[0] > steps[-1][-1]:
            steps.append(own)
            found.append(there)
    return np.concatenate(steps), np.concatenate(found)


# the road -----------------------------------------------------------------------------------

_LEAST_VERSION = (1, 3)
_TURNS = {"L": 1.0, "S": 0.0, "R": -1.0}
_DENSE = 1.0
_SHORTEST = 1.0
"""Shorter centre lines are no lanes, m"""
_LONGEST = 2_000.0
"""Longer arcs are no pieces of lanes, m"""


def _road(path: Path, scene: str, recording: Recording, folder: Path) -> SiteRoad:
    """The road about a recording, of the lanes of its location's map.

    Raises:
        InvalidFile: the map is not there, of an older version, malformed, or has no lane near the
            recording.
    """
    from xodr.formats.lanelet2.centre_lines import lanelets_of

    if not path.is_file():
        raise InvalidFile(
            "this map of the map expansion is not there; --road names another one", path=path
        )
    document = _document(path, path.stat().st_mtime_ns)
    lanes, left_out = _lanes(document, path, _box(recording))
    if not lanes:
        raise InvalidFile("no lane is where vehicles were", path=path, element="arcline_path_3")
    outlines = [*_outlines(document, path, "lane", "polygon", "exterior_node_tokens")]
    outlines += [
        line
        for kind in ("lane_divider", "road_divider")
        for line in _outlines(document, path, kind, "line", "node_tokens")
    ]
    lanelets, inferred = lanelets_of(lanes, outlines)
    notes = [
        f"the road has the lanes within {_AROUND:g} m of where vehicles were",
        "the map gives no speed limits; its roads are taken for those of a town",
        (
            "which lanes traffic lights are for is not in the map: junctions count as some "
            "without lights"
        ),
    ]
    notes += (
        [f"{left_out} centre lines of less than {_SHORTEST:g} m are left out"] if left_out else []
    )
    return drawn(lanelets, scene, folder, (), [*notes, *inferred])


@lru_cache(maxsize=1)
def _document(path: Path, _version: int) -> dict[str, Any]:
    """A map, kept for the scenes on it."""
    document = read_object(path)
    version = str(document.get("version", "1.0"))
    numbers = tuple(int(part) if part.isdigit() else 0 for part in version.split("."))
    if numbers < _LEAST_VERSION:
        raise InvalidFile(
            f"version {version} of the map expansion, 1.3 or later is read",
            path=path,
            element="version",
        )
    return document


def _box(recording: Recording) -> tuple[float, float, float, float]:
    """Least and greatest x, and y, of places of vehicles with the surroundings, m."""
    vehicles = [track.columns for track in recording.tracks.values() if track.kind == "vehicle"]
    x, y = (np.concatenate([columns[axis] for columns in vehicles]) for axis in "xy")
    return (
        float(x.min()) - _AROUND,
        float(x.max()) + _AROUND,
        float(y.min()) - _AROUND,
        float(y.max()) + _AROUND,
    )


def _lanes(
    document: Mapping[str, Any], path: Path, box: tuple[float, float, float, float]
) -> tuple[list[CentreLine], int]:
    """Centre lines in a box, and the number of lines that are too short."""
    west, east, south, north = box
    types = {
        str(one.get("token")): one.get("lane_type")
        for one in records(document, "lane", path, "map")
    }
    links = named(document, "connectivity", path, "map")
    lanes, short = [], 0
    for token, arcs in value(document, "arcline_path_3", dict, path, "map").items():
        line = _line(arcs, path, f"arcline_path_3 {token}")
        if not (
            (line[:, 0] > west) & (line[:, 0] < east) & (line[:, 1] > south) & (line[:, 1] < north)
        ).any():
            continue
        if np.hypot(*np.diff(line, axis=0).T).sum() < _SHORTEST:
            short += 1
            continue
        after = links.get(token, {})
        outgoing = value(after, "outgoing", list, path, f"connectivity {token}") if after else []
        kind = "biking" if types.get(token) == "BIKE" else "driving"
        lanes.append(
            CentreLine(
                token,
                line,
                kind,
                successors=tuple(str(other) for other in outgoing if other != token),
            )
        )
    return lanes, short


def _line(arcs: Any, path: Path, element: str) -> FloatArray:
    """The points of a lane of arcs and straight pieces, (n, 2), m."""
    places: list[FloatArray] = []
    try:
        for arc in arcs:
            x, y, h = (float(part) for part in arc["start_pose"])
            for letter, length in zip(arc["shape"], arc["segment_length"], strict=True):
                if not 0.0 <= length <= _LONGEST:
                    raise InvalidFile(
                        f"an arc of {length:g} m is no piece of a lane", path=path, element=element
                    )
                bend = _TURNS[letter] / float(arc["radius"])
                s = np.linspace(0.0, length, max(2, math.ceil(length / _DENSE) + 1))
                turned = h + bend * s
                if bend == 0.0:
                    line = np.column_stack([x + s * math.cos(h), y + s * math.sin(h)])
                else:
                    # The integral of the direction along an arc: sine and cosine over the
                    # curvature.
                    line = np.column_stack(
                        [np.sin(turned) - math.sin(h), math.cos(h) - np.cos(turned)]
                    ) / bend + (x, y)
                places.append(line)
                (x, y), h = line[-1].tolist(), float(turned[-1])
        line = np.concatenate(places)
    except (TypeError, KeyError, ValueError, ArithmeticError):
        raise InvalidFile(
            "this is no list of arcs with start_pose, shape, radius and segment_length",
            path=path,
            element=element,
        ) from None
    if not (np.abs(line) <= GREATEST).all():
        raise InvalidFile("an arc is no place in m", path=path, element=element)
    # Pieces meet at equal points: doubles have no direction.
    return line[np.append(True, np.hypot(*np.diff(line, axis=0).T) > 1e-3)]


def _nodes(document: Mapping[str, Any], path: Path) -> dict[str, FloatArray]:
    """Places of nodes by their tokens, m."""
    found = records(document, "node", path, "map")
    try:
        places = np.array([(one["x"], one["y"]) for one in found], np.float64).reshape(-1, 2)
    except (TypeError, KeyError, ValueError, OverflowError):
        raise InvalidFile("a node has no numbers x and y", path=path, element="node") from None
    if not (np.abs(places) <= GREATEST).all():
        raise InvalidFile("a node is no place in m", path=path, element="node")
    return {str(one.get("token")): place for one, place in zip(found, places, strict=True)}


def _outlines(
    document: Mapping[str, Any], path: Path, layer: str, geometry: str, key: str
) -> Iterable[FloatArray]:
    """Lines of the records of a layer, by the nodes of their polygons or lines.

    Raises:
        InvalidFile: a record refers to a polygon, line or node that there is not.
    """
    node = _nodes(document, path)
    shapes = {str(one.get("token")): one for one in records(document, geometry, path, "map")}
    for record in records(document, layer, path, "map", optional=True):
        name = f"{layer} {record.get('token')}"
        shape = shapes.get(str(record.get(f"{geometry}_token")))
        if shape is None:
            raise InvalidFile(f"its {geometry}_token is of no {geometry}", path=path, element=name)
        tokens = (
            [str(token) for token in value(shape, key, list, path, name)] if key in shape else []
        )
        if not all(token in node for token in tokens):
            raise InvalidFile(f"its {geometry} has an unknown node", path=path, element=name)
        line = np.array([node[token] for token in tokens]).reshape(-1, 2)
        if geometry == "polygon" and len(line):
            line = np.concatenate([line, line[:1]])
        for one, other in pairwise(line) if len(line) > 1 else ():
            if (one != other).any():
                yield np.array([one, other])
