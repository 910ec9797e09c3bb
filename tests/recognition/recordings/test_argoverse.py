"""Argoverse 2: scenarios and logs with their maps, and damaged ones."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from pyarrow import feather

from recognition import recordings as datasets
from recognition.scenes import site_of
from runner.recording import Recording
from schemas.common.errors import InvalidFile

STEPS = 40
Lines = list[tuple[float, float]]


def segment(name: int, left: Lines, right: Lines, **more: Any) -> dict[str, Any]:
    """A lane segment of a map."""
    bounds = {
        f"{side}_lane_boundary": [{"x": x, "y": y, "z": 0.0} for x, y in line]
        for side, line in (("left", left), ("right", right))
    }
    links: dict[str, Any] = {
        "successors": [],
        "predecessors": [],
        "left_neighbor_id": None,
        "right_neighbor_id": None,
    }
    marks = {"left_lane_mark_type": "DASHED_WHITE", "right_lane_mark_type": "SOLID_WHITE"}
    return {
        "id": name,
        "lane_type": "VEHICLE",
        "is_intersection": False,
        **bounds,
        **links,
        **marks,
        **more,
    }


def write_map(folder: Path, name: str) -> Path:
    """Two lanes to the east from x = 0 to 100 m that continue as one, and one
    lane to the west on their left.
    """
    segments = [
        segment(
            1,
            [(0, 3.5), (100, 3.5)],
            [(0, 0), (100, 0)],
            left_neighbor_id=3,
            right_neighbor_id=2,
            successors=[4, 99],
        ),
        segment(2, [(0, 0), (100, 0)], [(0, -3.5), (100, -3.5)], left_neighbor_id=1),
        segment(3, [(100, 3.5), (0, 3.5)], [(100, 7), (0, 7)], left_neighbor_id=1),
        segment(4, [(100, 3.5), (150, 3.5)], [(100, 0), (150, 0)], predecessors=[1]),
    ]
    edges = [[{"x": x, "y": y, "z": 0.0} for y in (-3.5, 7.0)] for x in (60.0, 63.0)]
    crossing = {"id": 7, "edge1": edges[0], "edge2": edges[1]}
    document = {
        "lane_segments": {str(one["id"]): one for one in segments},
        "pedestrian_crossings": {"7": crossing},
    }
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"log_map_archive_{name}.json"
    path.write_text(json.dumps(document))
    return path


def write_scenario(
    folder: Path, change: Callable[[dict[str, Any]], None] = lambda row: None
) -> Path:
    """AV at 10 m/s on the right lane, behind a car at 8 m/s, and a pedestrian beside the road."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = [
        {"track_id": name, "object_type": kind, "timestep": k, "position_x": x + 0.1 * v * k,
            "position_y": y, "heading": 0.0,
         "velocity_x": v, "velocity_y": 0.0, "city": "austin"}
        for name, kind, x, y, v in (("AV", "vehicle", 5.0, -1.75, 10.0),
            ("12", "vehicle", 30.0, -1.75, 8.0),
                                    ("13", "pedestrian", 40.0, -6.0, 1.0))
        for k in range(STEPS)
    ]  # fmt: skip
    for row in rows:
        change(row)
    write_map(folder, "s1")
    pq.write_table(pa.Table.from_pylist(rows), folder / "scenario_s1.parquet")
    return folder


def write_log(folder: Path, change: Callable[[dict[str, Any]], None] = lambda row: None) -> Path:
    """The recording vehicle drives to the east at 10 m/s; a car is 20 m ahead of
    it, and a cyclist with a bicycle.
    """
    folder.mkdir(parents=True, exist_ok=True)
    turned = {"qw": math.cos(0.15), "qx": 0.0, "qy": 0.0, "qz": math.sin(0.15)}
    poses = [
        {"timestamp_ns": 315 * 10**15 + 50_000_000 * k, "qw": 1.0, "qx": 0.0, "qy": 0.0, "qz": 0.0,
            "tx_m": 5.0 + 0.5 * k,
         "ty_m": -1.75, "tz_m": 1.0}
        for k in range(2 * STEPS)
    ]  # fmt: skip
    boxes = [
        {"timestamp_ns": 315 * 10**15 + 100_000_000 * k, "track_uuid": name, "category": kind,
            "length_m": 4.0, "width_m": 1.8,
         **turned, "tx_m": 20.0, "ty_m": 0.0, "tz_m": 0.0}
        for name, kind in (("a1-x", "REGULAR_VEHICLE"), ("b2-x", "BICYCLE"), ("c3-x", "BICYCLIST"))
        for k in range(STEPS)
    ]  # fmt: skip
    for row in boxes:
        change(row)
    write_map(folder / "map", "log____PIT_city_1")
    feather.write_feather(pa.Table.from_pylist(boxes), folder / "annotations.feather")
    feather.write_feather(pa.Table.from_pylist(poses), folder / "city_SE3_egovehicle.feather")
    return folder


def load(folder: Path) -> tuple[datasets.Source, Recording]:
    (source,) = datasets.open(folder).sources
    return source, source.load()


def test_a_scenario_has_its_tracks_and_names_the_recording_vehicle(tmp_path: Path) -> None:
    source, recording = load(write_scenario(tmp_path))
    assert (source.name, source.format, source.ego()) == ("s1", "Argoverse 2", "AV")
    assert {name: track.kind for name, track in recording.tracks.items()} == {
        "AV": "vehicle",
        "12": "vehicle",
        "13": "pedestrian",
    }
    own = recording.tracks["AV"]
    assert np.allclose(own.columns["speed"], 10.0, atol=0.1)
    assert np.allclose(own.columns["x"] + own.box.x, 5.0 + own.columns["time"] * 10.0, atol=0.05)
    assert source.report is not None and any(
        "usual sizes" in remark for remark in source.report.remarks
    )


def test_boxes_of_a_log_are_placed_by_the_poses(tmp_path: Path) -> None:
    source, recording = load(write_log(tmp_path / "log1"))
    assert source.name == "log1" and list(recording.tracks) == ["a1", "b2", "AV"]
    car, own = recording.tracks["a1"], recording.tracks["AV"]
    assert np.allclose(own.columns["x"], 5.0 + own.columns["time"] * 10.0, atol=0.05)
    assert np.allclose(own.columns["y"], -1.75, atol=0.05)
    raw = car.columns["raw_x"] + car.box.x * np.cos(0.3)
    assert np.allclose(raw, 25.0 + car.columns["time"] * 10.0) and np.allclose(
        car.columns["raw_h"], 0.3
    )
    assert car.box.length == 4.0
    assert source.report is not None and [each.what for each in source.report.exclusions] == [
        "BICYCLIST c3-x"
    ]


@pytest.mark.parametrize("write", [write_scenario, write_log])
def test_the_road_has_the_lanes_of_the_map(write: Callable[[Path], Path], tmp_path: Path) -> None:
    source, recording = load(write(tmp_path / "one"))
    network = site_of(source, recording, tmp_path / "roads").network
    both, third = network.locate(50.0, -1.75), network.locate(50.0, 5.25, None, math.pi)
    assert both.lane_id == -2 and third.road_id != both.road_id
    onward = network.locate(120.0, 1.75)
    assert network.links(both.road_id, -1, True)[0].road_id == onward.road_id
    assert sum(len(road.objects) for road in network.roads.values()) == 1
    assert source.report is not None and any(
        "no speed limits" in remark for remark in source.report.remarks
    )


def _put(key: str, value: object) -> Callable[[dict[str, Any]], None]:
    return lambda row: row.update({key: value})


def _last(key: str, value: object) -> Callable[[dict[str, Any]], None]:
    """Set a value in the last row of the first track."""
    return lambda row: (
        row.update({key: value})
        if row.get("timestep") == STEPS - 1 and row["track_id"] == "AV"
        else None
    )


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (
            lambda row: row.update(track_id=row["track_id"].replace("AV", "9")),
            "no track is AV, which the recording vehicle",
        ),
        (_last("timestep", 3), "row 40: 3 of track AV is there twice"),
        (_put("position_x", math.nan), "column position_x: row 1: 'nan' is no value"),
        (_put("object_type", "tank"), "column object_type: row 1: 'tank' is none of vehicle"),
        (_put("heading", 180.0), "column heading: row 1: 180 is no angle in rad"),
        (_put("position_y", "north"), "column position_y: row 1: 'north' is not a number"),
    ],
)
def test_a_damaged_scenario_is_refused(
    change: Callable[[dict[str, Any]], None], complaint: str, tmp_path: Path
) -> None:
    with pytest.raises(InvalidFile, match=complaint):
        load(write_scenario(tmp_path, change))


def _in_milliseconds(row: dict[str, Any]) -> None:
    row["timestamp_ns"] //= 10**6


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (
            _in_milliseconds,
            (
                r"timestamp_ns: row 2: .* 1e-07 s after the frame before, 0\.1 s "
                r"\(times in ns\) is expected"
            ),
        ),
        (_put("qw", 0.0), "column qw: row 1: the quaternion has not the length 1"),
        (_put("length_m", 0.0), "column length_m: row 1: 0 is no size"),
        (_put("timestamp_ns", 0), "all boxes are of one time"),
    ],
)
def test_a_damaged_log_is_refused(
    change: Callable[[dict[str, Any]], None], complaint: str, tmp_path: Path
) -> None:
    with pytest.raises(InvalidFile, match=complaint):
        load(write_log(tmp_path, change))


def test_poses_that_lack_or_go_back_are_refused(tmp_path: Path) -> None:
    path = write_log(tmp_path) / "city_SE3_egovehicle.feather"
    poses = feather.read_table(path)
    feather.write_feather(poses.slice(0, STEPS), path)
    with pytest.raises(
        InvalidFile, match=r"city_SE3.*the poses don't cover the time of the annotations"
    ):
        load(tmp_path)
    feather.write_feather(pa.concat_tables([poses.slice(1), poses.slice(0, 1)]), path)
    with pytest.raises(InvalidFile, match=r"city_SE3.*row 80: \d+ comes after \d+"):
        load(tmp_path)
    path.write_bytes(path.read_bytes()[:300])
    with pytest.raises(InvalidFile, match="can't be read"):
        load(tmp_path)
    path.unlink()
    with pytest.raises(InvalidFile, match="poses of the recording vehicle is not there"):
        load(tmp_path)


def _without(key: str) -> Callable[[dict[str, Any]], None]:
    return lambda document: document["lane_segments"]["2"].pop(key)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (
            lambda document: document.pop("lane_segments"),
            "map of Argoverse 2: there is no lane_segments",
        ),
        (lambda document: document["lane_segments"].clear(), "there is no lane segment"),
        (_without("lane_type"), "lane segment 2: there is no lane_type"),
        (_without("left_lane_boundary"), "lane segment 2: there is no left_lane_boundary"),
        (
            lambda document: document["lane_segments"]["2"].update(lane_type="TRAM"),
            "lane_type 'TRAM' is none of VEHICLE",
        ),
        (
            lambda document: document["lane_segments"]["2"]["left_lane_boundary"][0].update(
                x=math.nan
            ),
            "lane segment 2: left_lane_boundary has a point that is no place in m",
        ),
    ],
)
def test_a_damaged_map_is_refused(
    change: Callable[[dict[str, Any]], Any], complaint: str, tmp_path: Path
) -> None:
    source, recording = load(write_scenario(tmp_path))
    path = tmp_path / "log_map_archive_s1.json"
    document = json.loads(path.read_text())
    change(document)
    path.write_text(json.dumps(document))
    with pytest.raises(InvalidFile, match=complaint):
        site_of(source, recording, tmp_path / "roads")


def test_a_missing_map_is_named(tmp_path: Path) -> None:
    (write_scenario(tmp_path) / "log_map_archive_s1.json").unlink()
    source, recording = load(tmp_path)
    with pytest.raises(
        InvalidFile, match=r"log_map_archive_s1\.json.*this map is not there.*--road"
    ):
        site_of(source, recording, tmp_path / "roads")
