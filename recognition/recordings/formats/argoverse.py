"""Argoverse 2: motion forecasting scenarios, and sensor logs with annotated boxes; each with its
own map.

Source: Wilson et al., "Argoverse 2: Next Generation Datasets for Self-Driving Perception and
Forecasting" (NeurIPS 2021), and the schemas of the public av2 API. A scenario is
`scenario_ID.parquet` beside `log_map_archive_ID.json`: tracks at 10 Hz in coordinates of the city,
without sizes; the recording vehicle is the track AV. A log is a folder with `annotations.feather`
(or `annotations_with_ego.feather`: boxes in the frame of the recording vehicle at times in ns),
`city_SE3_egovehicle.feather` (its poses, quaternions w x y z, origin at the middle of the rear
axle) and `map/log_map_archive_*.json`. Lane segments have bounds, marks, neighbours and successors;
cities have right-hand traffic.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from recognition.recordings.intake import Exclusion, Report
from recognition.recordings.motion.smoothing import smoothed
from recognition.recordings.road_sources import drawn
from recognition.recordings.rows import (
    Clock,
    categories,
    changes,
    check_sizes,
    columns_of,
    cut,
    in_order,
    rate,
)
from recognition.recordings.source import SiteRoad, Source, TrackParticipant, participant
from recognition.recordings.table import (
    PARQUET,
    WHOLE_TURN,
    Kind,
    Table,
    column_names,
    named,
    points,
    read_table,
    value,
)
from runner.recording import Recording
from schemas.common.array_types import FloatArray, IntArray
from schemas.common.errors import InvalidFile
from schemas.common.storage import read_object

FORMAT = "Argoverse 2"
TITLE = "Argoverse 2"
BY_CONTENT = False
EGO = "AV"
"""Name of the recording vehicle."""
_STEP = 0.1
_SCENARIO, _MAP = "scenario_", "log_map_archive_"
_LOGS = ("annotations.feather", "annotations_with_ego.feather")
_POSES = "city_SE3_egovehicle.feather"
_TRACKS: dict[str, Kind] = {
    "track_id": "text", "timestep": "whole", "object_type": "text", "position_x": "number",
    "position_y": "number",
    "heading": "number", "velocity_x": "number", "velocity_y": "number", "city": "text",
}  # fmt: skip
_QUATERNION = ("qw", "qx", "qy", "qz")
_POSE: dict[str, Kind] = {
    "timestamp_ns": "stamp", **dict.fromkeys(_QUATERNION, "number"),
    **dict.fromkeys(("tx_m", "ty_m", "tz_m"), "number"),
}  # fmt: skip
_SIZES = ("length_m", "width_m")
_BOXES: dict[str, Kind] = {
    "track_uuid": "text",
    "category": "text",
    **_POSE,
    **dict.fromkeys(_SIZES, "number"),
}
_TYPES = {
    "vehicle": "car", "bus": "bus", "motorcyclist": "motorbike", "cyclist": "bicycle",
    "pedestrian": "pedestrian",
    "static": "obstacle", "background": "obstacle", "construction": "obstacle",
    "riderless_bicycle": "obstacle",
    "unknown": "obstacle",
}  # fmt: skip
_RIDERS = ("bicyclist", "motorcyclist", "wheeled_rider")
_CATEGORIES = {
    "regular_vehicle": "car", "large_vehicle": "van", "box_truck": "truck", "truck": "truck",
    "truck_cab": "truck",
    "bus": "bus", "school_bus": "bus", "articulated_bus": "bus", "railed_vehicle": "tram",
    "vehicular_trailer": "trailer",
    "message_board_trailer": "trailer", "traffic_light_trailer": "trailer",
    "motorcycle": "motorbike", "bicycle": "bicycle",
    "wheeled_device": "bicycle", "pedestrian": "pedestrian", "official_signaler": "pedestrian",
    "stroller": "pedestrian",
    "wheelchair": "pedestrian", "animal": "obstacle", "dog": "obstacle", "bollard": "obstacle",
    "construction_barrel": "obstacle", "construction_cone": "obstacle",
    "mobile_pedestrian_crossing_sign": "obstacle",
    "sign": "obstacle", "stop_sign": "obstacle", "ego_vehicle": "car",
    **dict.fromkeys(_RIDERS, "pedestrian"),
}  # fmt: skip
_EGO_SIZE = (4.877, 2.0)
"""Length and width of the recording vehicles (m), as logs that list them have it"""
_NANOSECONDS = 1e9
_UNSTEADY = 0.3
"""Sweeps may be this share of a step off the clock"""


def claims(path: Path) -> bool:
    """Whether a file is a scenario or the annotations of a log, by its name and columns."""
    if path.name.startswith(_SCENARIO) and path.suffix == PARQUET:
        return {"track_id", "timestep", "object_type"} <= set(column_names(path))
    return path.name == _LOGS[0] or (
        path.name == _LOGS[1] and not path.with_name(_LOGS[0]).is_file()
    )


def sources(path: Path, roads: Path) -> list[Source]:
    """The recording of a scenario or log, which is a site of its own.

    Raises:
        InvalidFile: several maps are there.
    """
    log = path.name in _LOGS
    name = path.parent.resolve().name if log else path.stem.removeprefix(_SCENARIO)
    folder, read = (path.parent / "map", _read_log) if log else (path.parent, _read_scenario)
    maps = sorted(folder.glob(f"{_MAP}{'' if log else name}*.json"))
    if len(maps) > 1:
        raise InvalidFile(
            f"{maps[0].name} and {maps[1].name} are both maps of it, one is expected", path=path
        )
    road = partial(_road, maps[0] if maps else folder / f"{_MAP}{name}.json", name)
    return [
        Source(
            name,
            name,
            FORMAT,
            path,
            partial(read, path),
            maps[0] if maps else None,
            road=road,
            ego=lambda: EGO,
        )
    ]


# tracks -------------------------------------------------------------------------------------


def _read_scenario(path: Path) -> tuple[Recording, Report]:
    table = read_table(path, _TRACKS)
    keys, track = np.unique(table["track_id"].astype(str), return_inverse=True)
    if EGO not in keys:
        raise InvalidFile(
            f"no track is {EGO}, which the recording vehicle is called",
            path=path,
            element="column track_id",
        )
    rows = in_order(
        table,
        track,
        Clock("timestep", table["timestep"], 1.0 / _STEP, _STEP),
        names=keys.tolist(),
        sort=True,
    )
    kinds = categories(table, "object_type", _TYPES)
    who = [
        participant(name, str(kinds[row]))
        for name, row in zip(keys.tolist(), rows.heads, strict=True)
    ]
    report = rows.report(keys.tolist())
    report.remarks += changes(table, rows, keys.tolist(), ["object_type"])
    report.remarks.append(
        "participants have the usual sizes of their kinds, as scenarios give none"
    )
    report.remarks.append("accelerations are derived from the speeds")
    wrong = np.flatnonzero(np.abs(table["heading"]) > WHOLE_TURN)
    if len(wrong):
        raise table.fault(
            int(wrong[0]), "heading", f"{table['heading'][wrong[0]]:g} is no angle in rad"
        )
    names = ("position_x", "position_y", "heading", "velocity_x", "velocity_y")
    x, y, h, vx, vy = (table[name][rows.order] for name in names)
    speed = vx * np.cos(h) + vy * np.sin(h)
    columns = columns_of(rows, who, x, y, h, speed, rate(speed, rows))
    return Recording(cut(*smoothed(rows, who, columns, report)), _STEP, None), report


def _read_log(path: Path) -> tuple[Recording, Report]:
    boxes = read_table(path, _BOXES)
    kinds = categories(boxes, "category", _CATEGORIES)
    check_sizes(boxes, _SIZES)
    frames, frame = _frames(boxes)
    ego = _poses(path.with_name(_POSES), frames)
    # Riders have boxes of their own inside that of their vehicle: they would collide with it.
    riders = np.isin(np.char.lower(boxes["category"].astype(str)), _RIDERS)
    kept = ~riders & (np.char.lower(boxes["category"].astype(str)) != "ego_vehicle")
    # Boxes are in the frame of the recording vehicle: its pose at the time of each box turns them.
    x, y, h = _in_city(boxes, frame, ego)
    own = participant(EGO, "car", *_EGO_SIZE)
    keys, track = np.unique(boxes["track_uuid"][kept].astype(str), return_inverse=True)
    names = [*_short(keys.tolist()), EGO]
    heading = np.arctan2(ego[1][:, 1, 0], ego[1][:, 0, 0])
    whole = Table(
        path, {"timestamp_ns": np.append(frame[kept], np.arange(len(frames)))}, lines=False
    )
    tracks = np.append(track, np.full(len(frames), len(keys)))
    rows = in_order(
        whole,
        tracks,
        Clock("timestamp_ns", whole["timestamp_ns"], 1.0 / _STEP, _STEP),
        names=names,
        sort=True,
    )
    place = np.flatnonzero(kept)
    # The last track is that of the recording vehicle: its rows are poses, no boxes.
    firsts = [int(place[row]) for row in rows.heads[:-1]]
    who = [
        *(
            _sized(boxes, row, name, str(kinds[row]))
            for name, row in zip(names, firsts, strict=False)
        ),
        own,
    ]
    report = rows.report(names)
    left_out = Counter(
        zip(boxes["track_uuid"][riders].tolist(), boxes["category"][riders].tolist(), strict=True)
    )
    report.exclusions += [
        Exclusion(f"{kind} {name}", count, "a rider, on a vehicle with a track of its own")
        for (name, kind), count in left_out.items()
    ]
    report.remarks.append(
        "sweeps are put on a clock of 10 Hz; speeds and accelerations are "
        "derived from the positions"
    )
    # Poses are of the rear axle, `columns_of` takes centres.
    x = np.append(x[kept], ego[0][:, 0] + own.box.x * np.cos(heading))[rows.order]
    y = np.append(y[kept], ego[0][:, 1] + own.box.x * np.sin(heading))[rows.order]
    h = np.append(h[kept], heading)[rows.order]
    speed = rate(x, rows) * np.cos(h) + rate(y, rows) * np.sin(h)
    columns = columns_of(rows, who, x, y, h, speed, rate(speed, rows))
    return Recording(cut(*smoothed(rows, who, columns, report)), _STEP, None), report


def _sized(boxes: Table, row: int, name: str, category: str) -> TrackParticipant:
    return participant(name, category, *(float(boxes[side][row]) for side in _SIZES))


def _short(keys: list[str]) -> list[str]:
    """Names of tracks: the first parts of their ids, where these differ."""
    first = [key.partition("-")[0] for key in keys]
    return first if len(set(first)) == len(keys) and EGO not in first else keys


def _frames(boxes: Table) -> tuple[IntArray, IntArray]:
    """Time (ns) of each frame from the first to the last one, those without boxes included, and the
    frame of each row.

    Raises:
        InvalidFile: frames don't follow each other at 10 Hz.
    """
    stamps, of_row = np.unique(boxes["timestamp_ns"], return_inverse=True)
    if len(stamps) < 2:
        raise InvalidFile(
            "all boxes are of one time, frames at 10 Hz are expected", path=boxes.path
        )
    counts = np.diff(stamps) / (_STEP * _NANOSECONDS)
    wrong = np.flatnonzero((np.abs(counts - np.round(counts)) > _UNSTEADY) | (counts < 0.5))
    if len(wrong):
        row = int(np.flatnonzero(of_row == wrong[0] + 1)[0])
        apart = f"{counts[wrong[0]] * _STEP:.4g} s after the frame before"
        raise boxes.fault(
            row,
            "timestamp_ns",
            f"{stamps[wrong[0] + 1]} is {apart}, 0.1 s (times in ns) is expected",
        )
    # Sweeps jitter: each is given the nearest frame of a clock at 10 Hz.
    number = np.append(0, np.cumsum(np.round(counts).astype(np.int64)))
    return np.interp(np.arange(number[-1] + 1), number, stamps - stamps[0]).astype(
        np.int64
    ) + stamps[0], number[of_row]


def _poses(path: Path, frames: IntArray) -> tuple[FloatArray, FloatArray]:
    """Positions (n, 3) and rotations (n, 3, 3) of the recording vehicle at the times of frames,
    between poses interpolated.

    Raises:
        InvalidFile: times go back, a quaternion is none, or the poses begin after the frames or end
            before them.
    """
    if not path.is_file():
        raise InvalidFile(
            "the file with the poses of the recording vehicle is not there", path=path
        )
    table = read_table(path, _POSE)
    stamps = table["timestamp_ns"]
    back = np.flatnonzero(np.diff(stamps) < 0)
    if len(back):
        row = int(back[0]) + 1
        raise table.fault(row, "timestamp_ns", f"{stamps[row]} comes after {stamps[row - 1]}")
    if stamps[0] > frames[0] or stamps[-1] < frames[-1]:
        raise InvalidFile(
            "the poses don't cover the time of the annotations",
            path=path,
            element="column timestamp_ns",
        )
    quaternions = np.stack([table[name] for name in _QUATERNION], axis=1)
    _check_quaternions(table, quaternions)
    # q and -q are one rotation: signs are made to agree, so that the mean of two lies between them.
    turns = np.sign((quaternions[1:] * quaternions[:-1]).sum(axis=1))
    quaternions[1:] *= np.cumprod(np.where(turns < 0.0, -1.0, 1.0))[:, None]
    at, since = (frames - stamps[0]) / _NANOSECONDS, (stamps - stamps[0]) / _NANOSECONDS
    between = np.stack([np.interp(at, since, column) for column in quaternions.T], axis=1)
    place = np.stack(
        [np.interp(at, since, table[name]) for name in ("tx_m", "ty_m", "tz_m")], axis=1
    )
    return place, _rotations(between)


def _check_quaternions(table: Table, quaternions: FloatArray) -> None:
    wrong = np.flatnonzero(np.abs((quaternions**2).sum(axis=1) - 1.0) > 0.01)
    if len(wrong):
        raise table.fault(int(wrong[0]), "qw", "the quaternion has not the length 1")


def _rotations(quaternions: FloatArray) -> FloatArray:
    """Rotation matrices (n, 3, 3) of quaternions w, x, y, z (n, 4)."""
    w, x, y, z = (quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)).T
    rows = (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )
    return np.moveaxis(np.array(rows), -1, 0)


def _in_city(
    boxes: Table, frame: IntArray, ego: tuple[FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """x, y (m) of the middles of boxes, and their headings (rad), from the frame of the recording
    vehicle."""
    quaternions = np.stack([boxes[name] for name in _QUATERNION], axis=1)
    _check_quaternions(boxes, quaternions)
    middle = np.stack([boxes[name] for name in ("tx_m", "ty_m", "tz_m")], axis=1)
    place = ego[0][frame] + np.einsum("nij,nj->ni", ego[1][frame], middle)
    ahead = np.einsum("nij,nj->ni", ego[1][frame], _rotations(quaternions)[:, :, 0])
    return place[:, 0], place[:, 1], np.arctan2(ahead[:, 1], ahead[:, 0])


# the road -----------------------------------------------------------------------------------

_LANES = {"VEHICLE": "driving", "BUS": "bus", "BIKE": "biking"}
_MARKS = {
    "DOUBLE_SOLID": "solid solid",
    "DOUBLE_DASH": "broken broken",
    "SOLID_DASH": "solid broken",
    "DASH_SOLID": "broken solid",
}
_SHORTEST = 0.1
"""Bounds of lanes are longer, m"""


def _road(path: Path, site: str, _recording: Recording, folder: Path) -> SiteRoad:
    """The road of the lane segments of a map.

    Raises:
        InvalidFile: the map has no lane segments, or malformed ones.
    """
    from xodr.formats.lanelet2 import Lanelet, LaneletNeighbour
    from xodr.formats.lanelet2.lanelet import lengths
    from xodr.formats.lanelet2.reader import Crosswalk

    if not path.is_file():
        raise InvalidFile(
            "this map is not there, so the roads are unknown; --road names another one", path=path
        )
    document = read_object(path)
    segments = named(document, "lane_segments", path, "map of Argoverse 2")
    if not segments:
        raise InvalidFile(
            "there is no lane segment, so the roads are unknown", path=path, element="lane_segments"
        )
    bounds = {name: _bounds(one, path, name) for name, one in segments.items()}
    short = [
        name
        for name, lines in bounds.items()
        if min(len(line) and lengths(line)[-1] for line in lines) < _SHORTEST
    ]
    known = bounds.keys() - set(short)
    if not known:
        raise InvalidFile("no lane segment has a length", path=path, element="lane_segments")
    # Directions of segments, by both bounds: opposite for neighbours with oncoming traffic.
    chords = {name: sum(line[-1] - line[0] for line in bounds[name]) for name in known}

    def beside(name: str, side: str) -> LaneletNeighbour | None:
        other = segments[name].get(f"{side}_neighbor_id")
        if other is None or str(other) not in known:
            return None
        return LaneletNeighbour(str(other), bool(chords[name] @ chords[str(other)] > 0.0))

    def links(name: str, key: str) -> tuple[str, ...]:
        refs = value(segments[name], key, list, path, f"lane segment {name}")
        return tuple(
            dict.fromkeys(str(ref) for ref in refs if str(ref) in known and str(ref) != name)
        )

    lanelets = [
        Lanelet(
            name, *bounds[name], links(name, "predecessors"), links(name, "successors"),
            beside(name, "left"), beside(name, "right"), _LANES[one["lane_type"]], "town", math.inf,
            _mark(one.get("left_lane_mark_type")), _mark(one.get("right_lane_mark_type")),
        )
        for name, one in segments.items() if name in known
    ]  # fmt: skip
    crosswalks = [
        Crosswalk(
            name,
            np.concatenate(
                [points(one, "edge1", path, name), points(one, "edge2", path, name)[::-1]]
            ),
        )
        for name, one in named(
            document, "pedestrian_crossings", path, "map of Argoverse 2", optional=True
        ).items()
    ]
    notes = [
        "the map gives no speed limits; its roads are taken for those of a town",
        (
            "the map has no traffic lights: whether its junctions have some is not known, they "
            "count as some without"
        ),
    ]
    notes += [f"lane segments without a length are left out: {' '.join(short)}"] if short else []
    return drawn(lanelets, site, folder, crosswalks, notes)


def _bounds(segment: Mapping[str, Any], path: Path, name: str) -> tuple[FloatArray, FloatArray]:
    """Left and right bound of a lane segment, of a known type."""
    element = f"lane segment {name}"
    kind = value(segment, "lane_type", str, path, element)
    if kind not in _LANES:
        raise InvalidFile(
            f"lane_type {kind!r} is none of {', '.join(_LANES)}", path=path, element=element
        )
    left, right = (
        points(segment, f"{side}_lane_boundary", path, element) for side in ("left", "right")
    )
    return left, right


def _mark(kind: object) -> str:
    """The road mark of OpenDRIVE for a kind of lane mark."""
    name = str(kind)
    # Marks of two lines first: SOLID_DASH begins with SOLID too.
    found = next((mark for words, mark in _MARKS.items() if name.startswith(words)), None)
    return found or (
        "broken" if name.startswith("DASHED") else "solid" if name.startswith("SOLID") else "none"
    )
