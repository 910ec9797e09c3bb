"""Scenes of nuScenes on a map of Singapore's kind, with left-hand traffic, and damaged ones."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recognition import recordings as datasets
from recognition.labels import Label, label
from recognition.scenes import site_of
from schemas.common.errors import InvalidFile

START, SAMPLES = 1_532_402_927_000_000, 21
Tables = dict[str, list[dict[str, Any]]]


def quaternion(heading: float) -> list[float]:
    return [math.cos(heading / 2.0), 0.0, 0.0, math.sin(heading / 2.0)]


def tables() -> Tables:
    """Ten seconds: ego at 10 m/s to the east, a car that changes into its lane
    from the right, a pedestrian, a cone.
    """
    found: Tables = {
        "log": [{"token": "l", "location": "singapore-onenorth"}],
        "scene": [{"token": "s", "name": "scene-0001", "log_token": "l"}],
        "sample": [{"token": f"k{k}", "timestamp": START + 500_000 * k,
            "scene_token": "s"} for k in range(SAMPLES)],
        "category": [{"token": "c", "name": "vehicle.car"},
            {"token": "p", "name": "human.pedestrian.adult"},
                     {"token": "t", "name": "movable_object.trafficcone"}],
        "instance": [{"token": f"{'abc'[n]}" * 32, "category_token": kind} for n,
            kind in enumerate("cpt")],
        "ego_pose": [{"token": f"e{k}", "timestamp": START + 50_000 * k,
            "translation": [1000.0 + 0.5 * k, 500.0, 0.0],
                      "rotation": quaternion(0.0)} for k in range(10 * (SAMPLES - 1) + 1)],
        "sample_annotation": [],
    }  # fmt: skip
    for k in range(SAMPLES):
        aside = 500.0 - 3.5 / (1.0 + math.exp(2.0 * (0.5 * k - 5.0)))
        slope = 3.5 * 2.0 / 4.0 / math.cosh(0.5 * k - 5.0) ** 2 / 10.0
        places = [
            (1025.0 + 5.0 * k, aside, math.atan(slope)),
            (1040.0, 510.0 - 0.4 * k, -math.pi / 2.0),
            (1060.0, 508.0, 0.0),
        ]
        for token, (x, y, h) in zip(("a" * 32, "b" * 32, "c" * 32), places, strict=True):
            box = {"translation": [x, y, 0.0], "size": [1.8, 4.5, 1.5], "rotation": quaternion(h)}
            found["sample_annotation"].append(
                {"token": f"{token}{k}", "sample_token": f"k{k}", "instance_token": token, **box}
            )
    return found


def arc(
    x: float, y: float, heading: float, *lengths: float, shape: str = "LSR", radius: float = 999.0
) -> dict[str, Any]:
    return {
        "start_pose": [x, y, heading],
        "shape": shape,
        "radius": radius,
        "segment_length": list(lengths),
    }


def expansion() -> dict[str, Any]:
    """Two lanes to the east, the left one going on round a bend to the left, and
    one to the west on their right.
    """
    nodes = [(950.0, 501.8), (1150.0, 501.8), (1150.0, 498.2), (950.0, 498.2)]
    return {
        "version": "1.3",
        "node": [{"token": f"n{k}", "x": x, "y": y} for k, (x, y) in enumerate(nodes)],
        "polygon": [{"token": "q", "exterior_node_tokens": [f"n{k}" for k in range(4)],
            "holes": []}],
        "line": [],
        "lane": [{"token": "one", "polygon_token": "q", "lane_type": "CAR"}],
        "lane_connector": [{"token": "turn", "polygon_token": "q"}],
        "lane_divider": [], "road_divider": [], "traffic_light": [],
        "arcline_path_3": {
            "one": [arc(950.0, 500.0, 0.0, 0.0, 200.0, 0.0)],
            "two": [arc(950.0, 496.5, 0.0, 0.0, 200.0, 0.0)],
            "turn": [arc(1150.0, 500.0, 0.0, 15.0 * math.pi / 2.0, 10.0, 0.0, radius=15.0)],
            "back": [arc(1150.0, 493.0, math.pi, 0.0, 200.0, 0.0)],
            "far": [arc(5000.0, 0.0, 0.0, 0.0, 50.0, 0.0)],
        },
        "connectivity": {"one": {"incoming": [], "outgoing": ["turn"]},
            "turn": {"incoming": ["one"], "outgoing": ["gone"]}},
    }  # fmt: skip


def write(
    folder: Path, found: Tables | None = None, map_: dict[str, Any] | None = None
) -> datasets.Source:
    """The tables in `v1.0-mini` and the map in `maps/expansion`, as the data set has them."""
    for name, rows in (found or tables()).items():
        (folder / "v1.0-mini").mkdir(exist_ok=True, parents=True)
        (folder / "v1.0-mini" / f"{name}.json").write_text(json.dumps(rows))
    (folder / "maps" / "expansion").mkdir(parents=True)
    (folder / "maps" / "expansion" / "singapore-onenorth.json").write_text(
        json.dumps(map_ or expansion())
    )
    (source,) = datasets.open(folder).sources
    return source


def test_boxes_at_2_hz_become_tracks_at_10_hz(tmp_path: Path) -> None:
    source = write(tmp_path)
    assert (source.name, source.site, source.format, source.ego()) == (
        "scene-0001",
        "singapore-onenorth",
        "nuScenes",
        "ego",
    )
    recording = source.load()
    kinds = {name: track.kind for name, track in recording.tracks.items()}
    assert kinds == {
        "a" * 8: "vehicle",
        "b" * 8: "pedestrian",
        "c" * 8: "miscellaneous",
        "ego": "vehicle",
    }
    own, car = recording.tracks["ego"], recording.tracks["a" * 8]
    assert np.allclose(np.diff(own.columns["time"]), 0.1) and len(own.columns["time"]) == 101
    assert np.allclose(own.columns["x"], 1000.0 + 10.0 * own.columns["time"], atol=0.05)
    assert np.allclose(car.columns["speed"], 10.0, atol=0.3) and car.box.length == 4.5
    assert source.report is not None and any(
        "at 2 Hz" in remark for remark in source.report.remarks
    )


def test_a_cut_in_from_the_right_is_found_in_left_hand_traffic(tmp_path: Path) -> None:
    source = write(tmp_path)
    recording = source.load()
    site = site_of(source, recording, tmp_path / "roads")
    beside = [site.network.locate(1040.0, y) for y in (500.0, 496.5)]
    assert beside[0].road_id == beside[1].road_id and [each.lane_id for each in beside] == [-1, -2]
    end = site.network.locate(1165.0, 520.0, None, math.pi / 2.0)
    assert abs(end.offset) < 0.2 and end.road_id != beside[0].road_id
    assert all(road.line.at(0.0)[0] < 4000.0 for road in site.network.roads.values())
    found = {(event.label, event.ego) for event in label(recording, site, "scene")}
    assert (Label.LANE_CHANGE_LEFT, "a" * 8) in found


def _row(table: str, key: str, there: object) -> Callable[[Tables], Any]:
    return lambda found: found[table][0].update({key: there})


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (
            _row("sample_annotation", "translation", [math.nan, 0.0, 0.0]),
            r"column translation\.0: row 1: 'nan' is no value",
        ),
        (
            _row("sample_annotation", "translation", "here"),
            r"column translation\.0: row 1: a value is missing",
        ),
        (
            _row("sample_annotation", "rotation", [0.0] * 4),
            "row 1: the quaternion has not the length 1",
        ),
        (
            _row("sample_annotation", "size", [0.0, 1.0, 1.0]),
            r"column size\.0: row 1: 0 is no size",
        ),
        (_row("sample_annotation", "instance_token", "x"), "x is not in instance.json"),
        (_row("sample_annotation", "sample_token", "k1"), "has two boxes in this sample"),
        (_row("category", "name", "spaceship"), "'spaceship' begins with none of vehicle.car"),
        (_row("instance", "category_token", "z"), "row 1: it is not in category.json"),
        (
            lambda found: found["ego_pose"].__delitem__(slice(1, None)),
            "no poses of the recording vehicle",
        ),
        (lambda found: found["sample"].__delitem__(slice(1, None)), "the scene has 1 samples"),
    ],
)
def test_damaged_tables_are_refused(
    change: Callable[[Tables], Any], complaint: str, tmp_path: Path
) -> None:
    found = tables()
    change(found)
    with pytest.raises(InvalidFile, match=complaint):
        write(tmp_path, found).load()


def test_truncated_and_missing_tables_are_refused(tmp_path: Path) -> None:
    source = write(tmp_path)
    path = tmp_path / "v1.0-mini" / "instance.json"
    path.write_text(path.read_text()[:40])
    with pytest.raises(InvalidFile, match=r"instance\.json:1: not readable as JSON"):
        source.load()
    path.unlink()
    with pytest.raises(InvalidFile, match=r"instance\.json"):
        source.load()


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (
            lambda found: found.update(version="1.2"),
            "version 1.2 of the map expansion, 1.3 or later is read",
        ),
        (lambda found: found.pop("arcline_path_3"), "map: there is no arcline_path_3"),
        (lambda found: found["arcline_path_3"].clear(), "no lane is where vehicles were"),
        (
            lambda found: found["arcline_path_3"]["one"][0].update(shape="LQR"),
            "arcline_path_3 one: this is no list of arcs",
        ),
        (lambda found: found["polygon"].clear(), "lane one: its polygon_token is of no polygon"),
        (lambda found: found["node"].pop(), "lane one: its polygon has an unknown node"),
    ],
)
def test_damaged_maps_are_refused(
    change: Callable[[dict[str, Any]], Any], complaint: str, tmp_path: Path
) -> None:
    found = expansion()
    change(found)
    source = write(tmp_path, None, found)
    with pytest.raises(InvalidFile, match=complaint):
        site_of(source, source.load(), tmp_path / "roads")


def test_a_missing_map_is_named(tmp_path: Path) -> None:
    source = write(tmp_path)
    (tmp_path / "maps" / "expansion" / "singapore-onenorth.json").unlink()
    (source,) = datasets.open(tmp_path).sources
    with pytest.raises(InvalidFile, match=r"singapore-onenorth\.json.*map expansion is not there"):
        site_of(source, source.load(), tmp_path / "roads")
