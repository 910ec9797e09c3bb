"""ScenarioNet's (and MetaDrive's) scenario descriptions: one pickle a scene.

Source: Li et al., "ScenarioNet: Open-Source Platform for Large-Scale Traffic Scenario Simulation
and Modeling" (NeurIPS 2023), and its description of the format. A scene has `tracks` (states in
arrays, which count where `valid` is true), `map_features` (lines and polygons),
`dynamic_map_states` (lights by lane) and `metadata` with the times of the steps. It is read as the
scenes of `recognition.recordings.formats.waymo` are. The converter of nuScenes has the ego's length
and width in each other's place: no vehicle is wider than long, so they are exchanged.

A pickle names functions that loading calls. Here it may only name those of numpy's arrays and of
plain containers: any other name is refused before it is looked up.
"""

from __future__ import annotations

import io
import pickle
from collections import Counter, OrderedDict, defaultdict
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from recognition.recordings.formats.waymo import SceneFile, source_of
from recognition.recordings.source import Source
from recognition.recordings.table import value
from schemas.common.errors import InvalidFile, ToolchainError, Unsupported, reason
from schemas.common.storage import read_bytes

FORMAT = "ScenarioNet"
TITLE = "ScenarioNet's pickles"
BY_CONTENT = True
_ENDS = 65536
_MARK = b"metadrive_processed"
"""Key of the metadata, which are the first or last part of a scene"""
_ARRAYS = ("numpy.core.multiarray", "numpy._core.multiarray")
_PLAIN: dict[tuple[str, str], Any] = {
    ("numpy", "ndarray"): np.ndarray,
    ("numpy", "dtype"): np.dtype,
    **{(module, "_reconstruct"): np._core.multiarray._reconstruct for module in _ARRAYS},  # type: ignore[attr-defined]
    **{(module, "scalar"): np._core.multiarray.scalar for module in _ARRAYS},  # type: ignore[attr-defined]
    ("collections", "OrderedDict"): OrderedDict,
    ("collections", "defaultdict"): defaultdict,
    **{("builtins", kind.__name__): kind for kind in (dict, list, set, int, float, str, tuple)},
}
"""Names that a pickle may use"""
_TYPES = {"VEHICLE": "vehicle", "PEDESTRIAN": "pedestrian", "CYCLIST": "cyclist"}
"""Types of participants in GPUDrive's words; all others are obstacles"""
_LANES = {"LANE_FREEWAY": 1, "LANE_SURFACE_STREET": 2, "LANE_BIKE_LANE": 3}
_LINES = ("ROAD_LINE", "ROAD_EDGE", "UNKNOWN_LINE")
_METRES_PER_SECOND = {"speed_limit_kmh": 1.0 / 3.6, "speed_limit_mph": 0.44704}
_SHORT = 8
"""Digits of ids that name tracks, where they tell them apart"""
_GREATEST_STEP = 1.0
"""Greatest time between steps, s"""


class _Reader(pickle.Unpickler):
    """Reads a pickle of arrays and plain containers."""

    def find_class(self, module: str, name: str) -> Any:
        """One of the names that are allowed.

        Raises:
            Unsupported: it is another one; nothing of it has been loaded or called.
        """
        if (module, name) not in _PLAIN:
            told = (
                f"this pickle names {module}.{name}: only arrays and plain containers are read, "
                "since loading others executes code"
            )
            raise Unsupported(told)
        return _PLAIN[module, name]


def claims(path: Path) -> bool:
    """Whether a file is the description of a scene, by its name or its metadata."""
    if path.suffix != ".pkl":
        return False
    if path.name.startswith("sd_"):
        return True
    with path.open("rb") as file:
        head = file.read(_ENDS)
        file.seek(max(path.stat().st_size - _ENDS, 0))
        return _MARK in head or _MARK in file.read(_ENDS)


def sources(path: Path, roads: Path) -> list[Source]:
    """The recording of a scene, which is a site of its own."""
    return [source_of(SceneFile(path, path.stem, partial(_scene, path)), FORMAT)]


def _loaded(path: Path) -> Mapping[str, Any]:
    content = read_bytes(path)
    try:
        found = _Reader(io.BytesIO(content)).load()
    except ToolchainError as error:
        error.path = error.path or str(path)
        raise
    except Exception as error:  # what a damaged pickle raises is of any kind
        raise InvalidFile(f"this is no pickle of a scene: {reason(error)}", path=path) from None
    if not isinstance(found, dict):
        raise InvalidFile("this pickle is no object with tracks and a map", path=path)
    return found


def _scene(path: Path) -> Mapping[str, Any]:
    """A scene as GPUDrive has them.

    Raises:
        InvalidFile: parts are missing or have other shapes; names the part.
        Unsupported: the pickle names other things than arrays.
    """
    found = _loaded(path)
    tracks, features, metadata, lights = (
        value(found, name, dict, path, "scene")
        for name in ("tracks", "map_features", "metadata", "dynamic_map_states")
    )
    ego = str(metadata.get("sdc_id"))
    if ego not in map(str, tracks):
        told = f"sdc_id {ego[:40]!r} is none of the {len(tracks)} tracks"
        raise InvalidFile(told, path=path, element="metadata")
    names = _names(map(str, tracks))
    objects = [_object(path, names[str(key)], one) for key, one in tracks.items()]
    wide = [one["id"] for one in objects if _is_wide(one)]
    for one in objects:
        if one["id"] in wide:
            one["length"], one["width"] = one["width"], one["length"]
    told = f"length and width of {', '.join(wide)} are exchanged: no vehicle is wider than long"
    return {
        "name": path.stem,
        "remarks": [told] if wide else [],
        "step": _step(path, metadata),
        "metadata": {"sdc_track_index": [*map(str, tracks)].index(ego)},
        "objects": objects,
        "roads": [part for key, one in features.items() if (part := _part(path, str(key), one))],
        "tl_states": {str(key): _light(path, str(key), one) for key, one in lights.items()},
    }


def _is_wide(one: Mapping[str, Any]) -> bool:
    return one["type"] == "vehicle" and one.get("width", 0.0) > one.get("length", 0.0)


def _names(keys: Any) -> dict[str, str]:
    """Short names of tracks: the first 8 of the 32 digits of a nuScenes id, where they suffice."""
    listed = [*keys]
    counts = Counter(key[:_SHORT] for key in listed)
    return {key: key[:_SHORT] if counts[key[:_SHORT]] == 1 else key for key in listed}


def _step(path: Path, metadata: Mapping[str, Any]) -> float:
    time = _array(path, "metadata", metadata, "ts", 1)
    steps = np.diff(time)
    if not len(steps) or not (0.0 < float(np.median(steps)) <= _GREATEST_STEP):
        raise InvalidFile("ts is no list of times, s", path=path, element="metadata")
    return round(float(np.median(steps)), 6)


def _array(path: Path, element: str, values: Mapping[str, Any], name: str, axes: int) -> Any:
    """An array of numbers with so many axes; more are cut off where they have one entry."""
    if name not in values:
        raise InvalidFile(f"no {name}", path=path, element=element)
    try:
        array = np.asarray(values[name], dtype=np.float64)
    except (TypeError, ValueError):
        raise InvalidFile(f"{name} is no array of numbers", path=path, element=element) from None
    if array.ndim == axes + 1 and array.shape[-1] == 1:
        array = array[..., 0]
    if array.ndim != axes:
        told = f"{name} has the shape {array.shape}, {axes} axes are expected"
        raise InvalidFile(told, path=path, element=element)
    return array


def _object(path: Path, name: str, track: Any) -> dict[str, Any]:
    element = f"track {name}"
    state = value(track, "state", dict, path, element) if isinstance(track, dict) else {}
    place, velocity = (_array(path, element, state, key, 2) for key in ("position", "velocity"))
    heading, valid = (_array(path, element, state, key, 1) for key in ("heading", "valid"))
    sizes = {key: np.atleast_1d(_size(path, element, state, key)) for key in ("length", "width")}
    lengths = {len(place), len(velocity), len(heading), len(valid)}
    if len(lengths) > 1 or place.shape[1] < 2 or velocity.shape[1] < 2:
        told = "position, velocity, heading and valid have different numbers of steps"
        raise InvalidFile(told, path=path, element=element)
    flags = valid > 0.5
    known = {
        key: float(np.median(size[flags] if len(size) == len(flags) else size))
        for key, size in sizes.items()
        if flags.any()
    }
    return {
        "id": name,
        "type": _TYPES.get(str(track.get("type")), "other"),
        "position": [{"x": x, "y": y} for x, y in place[:, :2].tolist()],
        "velocity": [{"x": x, "y": y} for x, y in velocity[:, :2].tolist()],
        "heading": heading.tolist(),
        "valid": flags.tolist(),
        **known,
    }


def _size(path: Path, element: str, state: Mapping[str, Any], name: str) -> Any:
    """Sizes of a track, one a step or one in all."""
    scalar = isinstance(state.get(name), float | int)
    return float(state[name]) if scalar else _array(path, element, state, name, 1)


def _part(path: Path, name: str, feature: Any) -> dict[str, Any] | None:
    """A lane, line or crosswalk of the map; None for anything else."""
    if not isinstance(feature, dict):
        raise InvalidFile("an object is expected", path=path, element=f"map feature {name}")
    kind = str(feature.get("type"))
    if kind in _LANES and "polyline" in feature:
        limit = next(
            (
                factor * float(feature[key])
                for key, factor in _METRES_PER_SECOND.items()
                if isinstance(feature.get(key), float | int) and feature[key] > 0.0
            ),
            None,
        )
        return {
            **_line(path, name, "lane", feature, "polyline"),
            "map_element_id": _LANES[kind],
            **({} if limit is None else {"speed_limit": limit}),
            **({"exits": [*map(str, exits)]} if (exits := feature.get("exit_lanes")) else {}),
        }
    if kind.startswith(_LINES) and "polyline" in feature:
        return _line(path, name, "road_line", feature, "polyline")
    if kind == "CROSSWALK" and "polygon" in feature:
        return _line(path, name, "crosswalk", feature, "polygon")
    return None


def _line(path: Path, name: str, kind: str, feature: Any, key: str) -> dict[str, Any]:
    places = _array(path, f"map feature {name}", feature, key, 2)
    geometry = [{"x": x, "y": y} for x, y in places[:, :2].tolist()]
    return {"id": name, "type": kind, "geometry": geometry}


def _light(path: Path, name: str, light: Any) -> dict[str, Any]:
    """States of a light, at the place of its stop line."""
    element = f"traffic light of lane {name}"
    if not isinstance(light, dict):
        raise InvalidFile("an object is expected", path=path, element=element)
    states = value(light, "state", dict, path, element).get("object_state")
    place = np.atleast_2d(np.asarray(light.get("stop_point"), dtype=np.float64))
    if not isinstance(states, list | tuple | np.ndarray) or place.shape[-1] < 2:
        told = "object_state and stop_point of a light are expected"
        raise InvalidFile(told, path=path, element=element)
    words = [str(state) for state in states]
    x, y = (float(place[0, axis]) for axis in (0, 1))
    count = len(words)
    return {
        "state": words,
        "x": [x] * count,
        "y": [y] * count,
        "time_index": [*range(count)],
    }
