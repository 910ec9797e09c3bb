"""Target `openlabel`: ASAM OpenLABEL JSON with the scenario's tags, and the box and speed of everyone in every frame.

Source: ASAM OpenLABEL 1.0.0, chapters 7 (multi-sensor data labelling) and 8 (scenario tagging). Cuboids are those of the
bounding boxes: centre (m) and Euler angles about x, y and z (rad) in the world frame, length, width and height (m).
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from runner.exports.moments import box_centre, moments, wrapped
from xosc.tags import openlabel, tags_of

if TYPE_CHECKING:
    from runner.interpreter.result import RunResult
    from runner.recording import Track
    from xosc.exports.draft import Folder

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
    told["coordinate_systems"] = {_WORLD: {"type": "scene_cs", "parent": "", "children": []}}
    told["frames"] = frames = {}
    seen: dict[int, list[int]] = {}
    for number, (time, there) in enumerate(moments(result.recording)):
        objects = {}
        for index, row in there:
            seen.setdefault(index, []).append(number)
            speed = round(float(tracks[index].columns["speed"][row]), _DIGITS)
            cuboid = {"name": "box", "val": cuboids[index][row], "coordinate_system": _WORLD}
            objects[str(index)] = {"object_data": {"cuboid": [cuboid], "num": [{"name": "speed", "val": speed}]}}
        frames[str(number)] = {"frame_properties": {"timestamp": round(time, 9)}, "objects": objects}
    told["frame_intervals"] = _intervals(list(range(len(frames))))
    told["objects"] = {
        str(index): {"name": track.name, "type": track.category, "frame_intervals": _intervals(seen.get(index, []))}
        for index, track in enumerate(tracks)
    }
    return content


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
