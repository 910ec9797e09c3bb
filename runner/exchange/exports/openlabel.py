"""Target `openlabel`: ASAM OpenLABEL JSON with the scenario's tags, and the box and speed of each
participant in every frame.

Source: ASAM OpenLABEL 1.0.0, chapters 7 (multi-sensor data labelling) and 8 (scenario tagging).
Cuboids are those of the bounding boxes: centre (m) and Euler angles about x, y and z (rad) in the
world frame, length, width and height (m). Where the roads have a projection, the world frame has a
parent, `geo`, with the projected coordinates of its `proj_string`. The context `run` has the
verdict, and the measures of criticality of each frame.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from runner.exchange.exports.moments import box_centre, moments, wrapped
from runner.exchange.exports.osi_signals import VehicleLights
from schemas.common.fates import kept, lost
from xosc.writing.tags import openlabel, tags_of

if TYPE_CHECKING:
    from runner.judging.result import RunResult
    from runner.recording import Track
    from xodr import RoadNetwork
    from xosc.exports.draft import Folder

_OF_ROADS = "labels are of participants; the scenario names the road file"
FATES = {
    "name": kept("`name`"), "kind": kept("`kind`"), "category": kept("`type`"),
    "role": kept("`role`"),
    "length and width": kept("`cuboid`"), "height of the box": kept("`cuboid`"),
    "box about the reference point": kept("`box_centre`"), "front axle": kept("`front_axle`"),
    "mass": kept("`mass`"),
    "ego": kept("`ego`"), "time": kept("`timestamp`"), "position": kept("`cuboid`"),
    "height": kept("`cuboid`"),
    "heading": kept("`cuboid`"), "pitch": kept("`cuboid`"), "roll": kept("`cuboid`"),
    "speed": kept("`speed`"),
    "acceleration": kept("`acceleration`"), "place on the road": kept("`road`, `lane`, `s`, `t`"),
    "lights": kept("`text`"),
    "events": kept("`events`"), "verdict": kept("`contexts`"), "criticality": kept("`contexts`"),
    "tags": kept("`tags`"), "projection": kept("`geo`"), "offset": kept("`pose_wrt_parent`"),
    **dict.fromkeys(
        ("lane borders", "road heights", "lane heights", "lane types", "speed limits", "road marks",
            "lane links", "neighbours",
         "junctions", "signs", "traffic lights", "light states", "objects"), lost(_OF_ROADS)),
}  # fmt: skip
"""Fates of `runner.exchange.exports.RUN_FIELDS`; numbers are rounded to 1e-6"""

TARGETS = {"openlabel": "ASAM OpenLABEL JSON: tags, and everyone's box in every frame"}
_WORLD = "world"
_DIGITS = 6


def export(result: RunResult, name: str, folder: Folder) -> list[str]:
    """Write the labels of a run.

    Raises:
        UsageError: a file is in the way.
        InvalidFile: the scenario's tags are not readable.
    """
    content = labels(result)
    text = json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    folder.write(f"{name}.openlabel.json", (text + "\n").encode("utf-8", "backslashreplace"))
    return []


def labels(result: RunResult) -> dict[str, Any]:
    """The JSON object of a run's OpenLABEL file."""
    tracks = list(result.recording.tracks.values())
    cuboids = [_cuboids(track) for track in tracks]
    content = openlabel(tags_of(result.scenario), result.scenario.name, "xosc-toolchain")
    told = content["openlabel"]
    told["coordinate_systems"] = _coordinate_systems(result.recording.network)
    lights = VehicleLights(result.events)
    result.recording.locate()
    measures = _measures(result)
    told["frames"] = frames = {}
    seen: dict[int, list[int]] = {}
    for number, (time, there) in enumerate(moments(result.recording)):
        objects = {}
        for index, row in there:
            seen.setdefault(index, []).append(number)
            cuboid = {"name": "box", "val": cuboids[index][row], "coordinate_system": _WORLD}
            numbers = [
                _number(name, tracks[index].columns[name][row])
                for name in ("speed", "acceleration")
            ]
            told_of: dict[str, Any] = {"cuboid": [cuboid], "num": numbers}
            road, place = _place(tracks[index], row)
            modes = lights.at(tracks[index].name, time)
            numbers += place
            if texts := [*road, *({"name": light, "val": mode} for light, mode in modes.items())]:
                told_of["text"] = texts
            objects[str(index)] = {"object_data": told_of}
        frames[str(number)] = {
            "frame_properties": {"timestamp": round(time, 9)},
            "objects": objects,
        }
        # Both are rounded to ns: sums of steps need not be equal to the last bit.
        if data := measures.get(round(time, 9)):
            frames[str(number)]["contexts"] = {"0": {"context_data": data}}
    told["contexts"] = {"0": _context(result)}
    told["events"] = _events(result)
    told["frame_intervals"] = _intervals(list(range(len(frames))))
    told["objects"] = {
        str(index): {
            "name": track.name,
            "type": track.category,
            "frame_intervals": _intervals(seen.get(index, [])),
            "object_data": _described(track, result.ego),
        }
        for index, track in enumerate(tracks)
    }
    return content


def _coordinate_systems(network: RoadNetwork | None) -> dict[str, Any]:
    world: dict[str, Any] = {"type": "scene_cs", "parent": "", "children": []}
    if network is None or network.geo_reference is None:
        return {_WORLD: world}
    x, y, z, heading = network.header.offset
    world |= {
        "parent": "geo",
        "pose_wrt_parent": {
            "euler_angles": [heading, 0.0, 0.0],
            "sequence": "ZYX",
            "translation": [x, y, z],
        },
    }
    geo = {
        "type": "geo_cs",
        "parent": "",
        "children": [_WORLD],
        "proj_string": network.geo_reference,
    }
    return {"geo": geo, _WORLD: world}


def _place(track: Track, row: int) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Return the road, and lane, s and t (m) there; nothing off the roads."""
    road, lane = track.columns["road_id"][row], track.columns["lane_id"][row]
    if not road:
        return [], []
    numbers = [_number(name, track.columns[name][row]) for name in ("s", "t")]
    return [{"name": "road", "val": str(road)}], [{"name": "lane", "val": int(lane)}, *numbers]


def _measures(result: RunResult) -> dict[float, dict[str, list[dict[str, Any]]]]:
    """Return context data of the measures of criticality that are defined, by time (s)."""
    table = result.criticality.table() if result.criticality is not None else {}
    times = table.pop("time", ())
    measures: dict[float, dict[str, list[dict[str, Any]]]] = {}
    for row, time in enumerate(times):
        data = measures.setdefault(round(float(time), 9), {})
        for name in (name for name in table if not name.endswith("_valid")):
            value = table[name][row]
            # Columns without a mask, as shares of RSS, are defined everywhere.
            if not table.get(f"{name}_valid", times)[row] and f"{name}_valid" in table:
                continue
            if isinstance(value, np.bool_ | bool):
                data.setdefault("boolean", []).append({"name": name, "val": bool(value)})
            elif isinstance(value, str):
                data.setdefault("text", []).append({"name": name, "val": value})
            elif value is not None and np.isfinite(value):
                data.setdefault("num", []).append(_number(name, value))
    return measures


def _context(result: RunResult) -> dict[str, Any]:
    """Return the run as a context: its verdict, and the reasons."""
    texts = [
        ("verdict", str(result.verdict)),
        *(("reason", text) for text in result.verdict.reasons),
    ]
    data = [{"name": name, "val": value} for name, value in texts]
    return {"name": "run", "type": "run", "context_data": {"text": data}}


def _events(result: RunResult) -> dict[str, Any]:
    """Return the entries of the event log: subject as name, kind as type, time (s) and text."""
    return {
        str(number): {
            "name": entry.subject,
            "type": entry.kind,
            "event_data": {
                "num": [{"name": "time", "val": entry.time}],
                "text": [{"name": "text", "val": entry.text}],
            },
        }
        for number, entry in enumerate(result.events)
    }


def _described(track: Track, ego: str | None) -> dict[str, Any]:
    """Return the constant properties of a participant."""
    box = track.box
    centre = {"name": "box_centre", "val": [box.x, box.y, box.z]}
    numbers = [
        _number(name, value)
        for name, value in (("front_axle", track.front_axle), ("mass", track.mass))
        if value
    ]
    texts = [
        {"name": "kind", "val": track.kind},
        *([{"name": "role", "val": track.role}] if track.role else []),
    ]
    data = {"vec": [centre], "text": texts, "boolean": [{"name": "ego", "val": track.name == ego}]}
    return {**data, "num": numbers} if numbers else data


def _number(name: str, value: float) -> dict[str, Any]:
    return {"name": name, "val": round(float(value), _DIGITS)}


def _cuboids(track: Track) -> list[list[float]]:
    columns, box = track.columns, track.box
    angles = np.column_stack([columns["roll"], columns["pitch"], columns["h"]]).astype(float)
    size = np.tile([box.length, box.width, box.height], (len(angles), 1))
    return np.round(np.hstack([box_centre(track), wrapped(angles), size]), _DIGITS).tolist()


def _intervals(frames: list[int]) -> list[dict[str, int]]:
    """Numbers of frames in ascending order as closed intervals."""
    numbers = np.array(frames, dtype=int)
    runs = np.split(numbers, np.flatnonzero(np.diff(numbers) > 1) + 1) if len(numbers) else []
    return [{"frame_start": int(run[0]), "frame_end": int(run[-1])} for run in runs]
