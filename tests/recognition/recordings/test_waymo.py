"""Scenes of Waymo Open Motion in GPUDrive's JSON, on both sides of the road, and damaged ones."""

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
from recognition.scenes import Site, site_of
from runner.recording import Recording
from schemas.common.errors import InvalidFile
from tests.recognition.traffic import read

STEPS = 91


def geometry(*places: tuple[float, float]) -> list[dict[str, float]]:
    return [{"x": x, "y": y, "z": 0.0} for x, y in places]


def track(
    name: int, x: float, y: Callable[[float], float], speed: float, **more: Any
) -> dict[str, Any]:
    """A participant that drives to the east; `y` gives its place across the road at each time."""
    time = np.arange(STEPS) / 10.0
    across = [y(each) for each in time.tolist()]
    slope = np.gradient(across, 0.1)
    return {
        "id": name, "type": "vehicle", "length": 4.5, "width": 1.9, "height": 1.5,
        "valid": [True] * STEPS,
        "position": [{"x": x + speed * t, "y": there, "z": 0.0} for t,
            there in zip(time.tolist(), across, strict=True)],
        "heading": np.arctan2(slope, speed).tolist(),
        "velocity": [{"x": speed, "y": each} for each in slope.tolist()],
        "goalPosition": {"x": 0.0, "y": 0.0, "z": 0.0}, **more,
    }  # fmt: skip


def scene() -> dict[str, Any]:
    """A freeway with three lanes to the east, of which the right one begins at 100 m, one to the
    west, and three vehicles.
    """

    def lane(name: str, *places: tuple[float, float]) -> dict[str, Any]:
        return {"id": name, "type": "lane", "map_element_id": 1, "geometry": geometry(*places)}

    changing = track(7, 60.0, lambda t: 5.25 - 3.5 / (1.0 + math.exp(-2.0 * (t - 5.0))), 20.0)
    return {
        "name": "scene.json",
        "objects": [track(5, 20.0, lambda t: 1.75, 20.0), changing,
            track(9, 150.0, lambda t: 1.75, 22.0, valid=[False] * STEPS)],
        "roads": [
            {"id": "1", "type": "road_edge", "map_element_id": 15,
                "geometry": geometry((0.0, 7.2), (400.0, 7.2))},
            {"id": "2", "type": "road_line", "map_element_id": 7,
                "geometry": geometry((0.0, -0.1), (100.0, -0.1))},
            {"id": "3", "type": "crosswalk", "map_element_id": 18,
             "geometry": geometry((380.0, 0.0), (383.0, 0.0), (383.0, 7.0), (380.0, 7.0))},
            lane("10", (0.0, 5.25), (200.0, 5.25)), lane("11", (200.0, 5.25), (400.0, 5.25)),
            lane("12", (0.0, 1.75), (400.0, 1.75)), lane("13", (100.0, -1.75), (400.0, -1.75)),
            lane("14", (400.0, 9.0), (0.0, 9.0)),
        ],
        "tl_states": {},
        "metadata": {"sdc_track_index": 0, "objects_of_interest": [], "tracks_to_predict": []},
    }  # fmt: skip


def mirrored(document: dict[str, Any]) -> dict[str, Any]:
    """The same scene with left-hand traffic: everything has the opposite y."""
    for one in document["objects"]:
        one["position"] = [each | {"y": -each["y"]} for each in one["position"]]
        one["velocity"] = [each | {"y": -each["y"]} for each in one["velocity"]]
        one["heading"] = [-each for each in one["heading"]]
    for one in document["roads"]:
        one["geometry"] = [each | {"y": -each["y"]} for each in one["geometry"]]
    return document


def load(folder: Path, document: dict[str, Any]) -> tuple[datasets.Source, Recording, Site]:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "scene.json").write_text(json.dumps(document))
    (source,) = datasets.open(folder / "scene.json").sources
    recording = source.load()
    return source, recording, site_of(source, recording, folder / "roads")


def test_a_scene_has_its_vehicles_and_names_the_recording_one(tmp_path: Path) -> None:
    source, recording, _ = load(tmp_path, scene())
    assert (source.format, source.ego(), list(recording.tracks)) == ("Waymo", "5", ["5", "7"])
    own = recording.tracks["5"]
    assert np.allclose(own.columns["speed"], 20.0, atol=0.1) and own.box.length == 4.5
    assert source.report is not None and [each.what for each in source.report.exclusions] == [
        "object 9"
    ]


def test_a_box_that_is_no_vehicle_is_left_out_by_name(tmp_path: Path) -> None:
    document = scene()
    document["objects"].append(document["objects"][1] | {"id": 11, "length": 14.1, "width": 11.1})
    source, recording, _ = load(tmp_path, document)
    assert list(recording.tracks) == ["5", "7"] and source.report is not None
    what, rows, reason = source.report.exclusions[-1]
    assert (what, rows, reason) == ("object 11", STEPS, "14.1 m by 11.1 m is no size of a truck")
    for one in document["objects"][1:]:
        one.update(length=450.0, width=190.0)  # cm
    with pytest.raises(
        InvalidFile, match="most objects are too large, such as object 7: 450 m by 190 m"
    ):
        load(tmp_path, document)


def test_lanes_are_inferred_from_centre_lines(tmp_path: Path) -> None:
    source, _, site = load(tmp_path, scene())
    network = site.network
    beside = [network.locate(50.0, y) for y in (5.25, 1.75)]
    assert beside[0].road_id == beside[1].road_id and [each.lane_id for each in beside] == [-1, -2]
    three = [network.locate(150.0, y) for y in (5.25, 1.75, -1.75)]
    assert len({each.road_id for each in three}) == 1 and [each.lane_id for each in three] == [
        -1,
        -2,
        -3,
    ]
    assert [link.road_id for link in network.links(beside[0].road_id, -1, True)] == [
        three[0].road_id
    ]
    road = network.roads[beside[0].road_id]
    assert road.lane_width(50.0, -1) == pytest.approx(
        1.95 + 1.75, abs=0.1
    )  # from the edge to half-way between the lanes
    assert road.road_type(50.0) == "motorway"
    assert network.locate(50.0, 9.0, None, math.pi).road_id not in {
        three[0].road_id,
        beside[0].road_id,
    }
    assert source.report is not None and any(
        "is inferred: those whose centre lines" in note for note in source.report.remarks
    )


@pytest.mark.parametrize(
    "change", [lambda document: document, mirrored], ids=["right-hand", "left-hand"]
)
def test_a_cut_in_is_found_on_either_side_of_the_road(
    change: Callable[[dict[str, Any]], dict[str, Any]], tmp_path: Path
) -> None:
    _, recording, site = load(tmp_path, change(scene()))
    side = (
        Label.LANE_CHANGE_RIGHT
        if change(scene())["objects"][1]["position"][-1]["y"] > 0.0
        else Label.LANE_CHANGE_LEFT
    )
    found = {(event.label, event.ego) for event in label(recording, site, "scene")}
    assert {(Label.CUT_IN, "5"), (side, "7")} <= found


def test_lanes_with_lights_have_lights(tmp_path: Path) -> None:
    document = scene()
    document["tl_states"] = {
        "11": {"state": ["stop"], "x": [0.0], "y": [0.0], "z": [0.0], "time_index": [0]}
    }
    source, _, site = load(tmp_path, document)
    signals = [signal for road in site.network.roads.values() for signal in road.signals]
    assert len(signals) == 1
    assert source.report is not None and any(
        "1 lanes have traffic lights" in note for note in source.report.remarks
    )


def test_states_of_lights_are_those_of_the_stop_line_that_a_vehicle_passes(tmp_path: Path) -> None:
    document = scene()
    steps = len(document["objects"][0]["valid"])
    place = document["objects"][0]["position"][steps // 2]

    def light(x: float, y: float, states: list[str]) -> dict[str, Any]:
        return {
            "state": states,
            "x": [x] * steps,
            "y": [y] * steps,
            "z": [0.0] * steps,
            "time_index": list(range(steps)),
        }

    half = ["stop"] * (steps // 2) + ["go"] * (steps - steps // 2)
    document["tl_states"] = {
        "11": light(place["x"], place["y"] + 1.0, half),
        "12": light(place["x"], place["y"] + 40.0, ["caution"] * steps),
    }
    source, recording, _ = load(tmp_path, document)
    lights, track = source.lights(), recording.tracks[str(document["objects"][0]["id"])]
    assert lights is not None
    middle = 0.1 * (steps // 2)
    assert (lights.ahead(track, middle - 1.0), lights.ahead(track, middle + 1.0)) == ("stop", "go")
    assert lights.ahead(track, middle + 100.0) is None
    assert lights._replace(y=lights.y + 10.0).ahead(track, middle) is None, (
        "nothing is within 3 m of its way"
    )


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (
            {"state": []},
            "traffic light of lane 11: state, x, y and time_index have different lengths, or none",
        ),
        (
            {"x": [0.0, 1.0]},
            "traffic light of lane 11: state, x, y and time_index have different lengths, or none",
        ),
        ({"x": [float("nan")]}, "traffic light of lane 11: x or y: nan is no measured value"),
        ({"time_index": ["0"]}, "traffic light of lane 11: time_index holds numbers of steps"),
    ],
)
def test_malformed_states_of_lights_are_refused(
    change: dict[str, Any], complaint: str, tmp_path: Path
) -> None:
    document = scene()
    document["tl_states"] = {
        "11": {"state": ["stop"], "x": [0.0], "y": [0.0], "time_index": [0]} | change
    }
    source, _, _ = load(tmp_path, document)
    with pytest.raises(InvalidFile, match=complaint):
        source.lights()


def _first(key: str, value: object) -> Callable[[dict[str, Any]], Any]:
    return lambda document: document["objects"][0].update({key: value})


def _lane(key: str, value: object) -> Callable[[dict[str, Any]], Any]:
    return lambda document: document["roads"][3].update({key: value})


def _faster(document: dict[str, Any]) -> None:
    for one in document["objects"]:
        one["velocity"] = [
            {axis: 3.6 * value for axis, value in each.items()} for each in one["velocity"]
        ]


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda document: document.pop("metadata"), "scene: there is no metadata"),
        (
            lambda document: document["metadata"].update(sdc_track_index=8),
            "sdc_track_index 8 is none of the 3 objects",
        ),
        (
            lambda document: document["metadata"].update(sdc_track_index=2),
            "object 9, the recording vehicle, has no valid step",
        ),
        (
            lambda document: document.update(objects={"position": 1}),
            "objects is .*, a list is expected",
        ),
        (lambda document: document["objects"][1].update(id=5), "two objects have the id 5"),
        (_first("type", "tank"), "object 1: type 'tank' is none of vehicle"),
        (_first("heading", [0.0]), "object 1: 1 headings of 91 steps"),
        (_first("heading", [math.nan] * STEPS), "object 1: heading: nan is no measured value"),
        (_first("heading", [90.0] * STEPS), "object 1: heading 90 is no angle in rad"),
        (_first("length", 0.0), "object 1: 0 is no size"),
        (_first("length", 450.0), "participant 5: 450 m by 1.9 m is no size of a truck"),
        (
            _faster,
            (
                r"the places move at 0\.28 times the stated speeds: the speeds may be "
                r"in km/h, or a step of"
            ),
        ),
        (
            _first("valid", [1] * STEPS),
            "object 1: there is no id, or valid has other values than true and false",
        ),
        (_first("position", [[0.0, 0.0]] * STEPS), "object 1: position is no list of x and y"),
        (lambda document: document["roads"].clear(), "the scene has no lanes"),
        (_lane("map_element_id", 77), "lane 10: map_element_id 77 is no lane's"),
        (
            _lane("geometry", geometry((0.0, math.inf))),
            "lane 10: geometry has a point that is no place",
        ),
    ],
)
def test_a_damaged_scene_is_refused(
    change: Callable[[dict[str, Any]], Any], complaint: str, tmp_path: Path
) -> None:
    document = scene()
    change(document)
    with pytest.raises(InvalidFile, match=complaint):
        load(tmp_path, document)


def test_a_truncated_scene_is_refused(tmp_path: Path) -> None:
    (tmp_path / "scene.json").write_text(json.dumps(scene())[:5000])
    (source,) = datasets.open(tmp_path).sources
    with pytest.raises(InvalidFile, match=r"scene\.json.*not readable as JSON"):
        source.load()


def test_older_files_have_headings_in_degrees_and_no_recording_vehicle(tmp_path: Path) -> None:
    older = scene()
    del older["metadata"]
    for one in older["objects"]:
        del one["id"]
        one["heading"] = [math.degrees(heading) for heading in one["heading"]]
    for road in older["roads"]:
        road.pop("map_element_id", None)
        road.pop("id", None)
    older["objects"].append({**older["objects"][0], "width": 0})
    path = tmp_path / "scene.json"
    path.write_text(json.dumps(older))
    recording, report = read(path)
    (source,) = datasets.open(path).sources
    newer = tmp_path / "new" / "scene.json"
    newer.parent.mkdir()
    newer.write_text(json.dumps(scene()))
    expected, _ = read(newer)
    assert source.ego() is None
    for one, other in zip(recording.tracks.values(), expected.tracks.values(), strict=True):
        assert np.allclose(one.columns["h"], other.columns["h"])
    last = len(older["objects"]) - 1
    assert f"objects {last} have no size: they are left out" in report.remarks
    assert site_of(source, recording, tmp_path / "roads").network.roads
