"""ScenarioNet's pickles: scenes, exchanged sizes, lights, and pickles that name functions."""

from __future__ import annotations

import math
import pickle
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recognition import recordings as datasets
from recognition.scenes import site_of
from schemas.common.errors import InvalidFile, ToolchainError, Unsupported
from tests.recognition.traffic import read

STEPS = 60


def track(x: float, y: float, speed: float, kind: str = "VEHICLE", **more: Any) -> dict[str, Any]:
    """A track eastwards, one axis more than needed for sizes, as converters write them."""
    way = x + speed * 0.1 * np.arange(STEPS)
    zero, one = np.zeros(STEPS), np.ones((STEPS, 1))
    state = {
        "position": np.stack([way, y + zero, zero], axis=1),
        "velocity": np.stack([speed + zero, zero], axis=1).astype(np.float32),
        "heading": zero,
        "valid": np.ones(STEPS),
        "length": 4.0 * one,
        "width": 2.0 * one,
    } | more
    return {"type": kind, "state": state, "metadata": {"type": kind}}


def lane(y: float) -> dict[str, Any]:
    line = np.stack([np.arange(-20.0, 220.0, 2.0), np.full(120, y)], axis=1)
    return {"type": "LANE_SURFACE_STREET", "polyline": line, "speed_limit_kmh": 50.0}


def scene() -> dict[str, Any]:
    return {
        "id": "scene",
        "version": "test",
        "length": STEPS,
        "metadata": {
            "metadrive_processed": False,
            "sdc_id": "ego",
            "ts": 0.1 * np.arange(STEPS),
            "object_summary": defaultdict(dict),
        },
        "tracks": {
            "ego": track(0.0, 0.0, 10.0, length=2.0 + np.zeros(STEPS), width=np.full(STEPS, 4.0)),
            "abcdef0123456789": track(30.0, 3.5, 8.0),
            "abcdefff": track(50.0, 8.0, 1.0, "PEDESTRIAN"),
            "cone": track(60.0, 8.0, 0.0, "TRAFFIC_CONE"),
        },
        "dynamic_map_states": {
            "a": {
                "type": "TRAFFIC_LIGHT",
                "state": {"object_state": ["TRAFFIC_LIGHT_RED"] * STEPS},
                "stop_point": np.array([100.0, 0.0, 0.0]),
            }
        },
        "map_features": {
            "a": lane(0.0),
            "b": lane(3.5),
            "edge": {"type": "ROAD_EDGE_BOUNDARY", "polyline": lane(-1.75)["polyline"]},
            "area": {"type": "LANE_SURFACE_UNSTRUCTURE", "polygon": np.zeros((4, 2))},
        },
    }


def write(folder: Path, found: object) -> Path:
    path = folder / "sd_test_1.pkl"
    path.write_bytes(pickle.dumps(found))
    (folder / "dataset_summary.pkl").write_bytes(pickle.dumps({}))
    return path


def test_a_scene_is_a_recording_with_roads_and_lights(tmp_path: Path) -> None:
    write(tmp_path, scene())
    found = datasets.open(tmp_path)
    (source,) = found.sources
    assert (source.name, source.format, found.skipped) == ("sd_test_1", "ScenarioNet", [])
    recording = source.load()
    assert {name: track.category for name, track in recording.tracks.items()} == {
        "ego": "car", "abcdef01": "car", "abcdefff": "pedestrian", "cone": "obstacle"
    }  # fmt: skip
    ego = recording.tracks["ego"]
    assert (ego.box.length, ego.box.width) == (4.0, 2.0)
    assert ego.columns["speed"] == pytest.approx(10.0, abs=0.05)
    assert source.report is not None and source.ego() == "ego"
    told = "length and width of ego are exchanged: no vehicle is wider than long"
    assert told in source.report.remarks
    lights = source.lights()
    assert lights is not None and lights.states == (("TRAFFIC_LIGHT_RED",) * STEPS,)
    site = site_of(source, recording, tmp_path / "roads")
    assert site.network.roads


def test_scenes_without_their_name_are_known_by_their_metadata(tmp_path: Path) -> None:
    write(tmp_path, scene()).rename(tmp_path / "0.pkl")
    recording, report = read(tmp_path / "0.pkl")
    assert (report.verdict, round(recording.timestep, 6)) == ("fit", 0.1)


class Harmful:
    """Calls a function when it is loaded."""

    def __init__(self, function: Callable[..., Any], *arguments: Any) -> None:
        self.call = function, arguments

    def __reduce__(self) -> Any:
        return self.call


def test_a_pickle_that_names_a_function_is_refused_before_it_is_called(tmp_path: Path) -> None:
    mark = tmp_path / "called"
    path = write(tmp_path, {**scene(), "id": Harmful(open, str(mark), "w")})
    with pytest.raises(Unsupported, match=r"this pickle names \w+\.open: only arrays"):
        read(path)
    assert not mark.exists()


def changed(**parts: Any) -> dict[str, Any]:
    return scene() | parts


def with_state(**state: Any) -> dict[str, Any]:
    tracks = scene()["tracks"]
    tracks["cone"]["state"] |= state
    return changed(tracks=tracks)


@pytest.mark.parametrize(
    ("found", "told"),
    [
        ([1], "this pickle is no object with tracks and a map"),
        ({"metadata": {}}, "no tracks"),
        (changed(metadata={"sdc_id": "x", "ts": np.arange(3.0)}), "sdc_id 'x' is none of the 4"),
        (changed(metadata={"sdc_id": "ego", "ts": np.zeros(3)}), "ts is no list of times"),
        (with_state(heading=np.zeros(3)), "track cone: position, velocity, heading and valid have"),
        (with_state(heading="east"), "track cone: heading is no array of numbers"),
        (with_state(heading=np.full(STEPS, math.nan)), "object 4: heading: nan is no measured"),
        (with_state(position=np.zeros(STEPS)), "track cone: position has the shape (60,), 2 axes"),
        (changed(map_features={"a": 1}), "map feature a: an object is expected"),
        (changed(dynamic_map_states={"a": {"state": {}}}), "traffic light of lane a: object_state"),
    ],
)
def test_a_bad_scene_is_named(found: object, told: str, tmp_path: Path) -> None:
    with pytest.raises(ToolchainError) as raised:
        read(write(tmp_path, found))
    assert told in str(raised.value)


def test_a_cut_pickle_is_named(tmp_path: Path) -> None:
    path = write(tmp_path, scene())
    path.write_bytes(path.read_bytes()[:-500])
    with pytest.raises(InvalidFile, match="this is no pickle of a scene"):
        read(path)
