"""Scenarios of Waymo Open Motion in TFRecord files, written by Google's
protobuf, and damaged ones.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recognition import recordings as datasets
from recognition.recordings.formats import waymo_records
from recognition.scenes import site_of
from schemas.common.errors import InvalidFile
from tests.recognition.recordings.test_waymo import scene

NAME = "training.tfrecord-00003-of-01000"
_LABELS = {"": 1, "*": 3}
_TYPES = {"double": 1, "float": 2, "int64": 3, "int32": 5, "bool": 8, "string": 9}
MESSAGES = {
    "ObjectState": "double center_x 2, double center_y 3, double center_z 4, float length 5, float width 6, "
    "float height 7,"
    "float heading 8, float velocity_x 9, float velocity_y 10, bool valid 11",
    "Track": "int32 id 1, int32 object_type 2, ObjectState* states 3",
    "MapPoint": "double x 1, double y 2, double z 3",
    "LaneCenter": "double speed_limit_mph 1, int32 type 2, bool interpolating 3, MapPoint* polyline 8, "
    "int64* entry_lanes 9,"
    "int64* exit_lanes 10",
    "RoadLine": "int32 type 1, MapPoint* polyline 2",
    "Crosswalk": "MapPoint* polygon 1",
    "MapFeature": (
        "int64 id 1, LaneCenter lane 3, RoadLine road_line 4, RoadLine road_edge 5, "
        "Crosswalk crosswalk 8"
    ),
    "LaneState": "int64 lane 1, int32 state 2, MapPoint stop_point 3",
    "DynamicMapState": "LaneState* lane_states 1",
    "Scenario": "double* timestamps_seconds 1, Track* tracks 2, int32* objects_of_interest 4, string "
    "scenario_id 5,"
    "int32 sdc_track_index 6, DynamicMapState* dynamic_map_states 7, MapFeature* map_features 8, "
    "int32 current_time_index 10,"
    "string* laser 12",
}
"""Fields of the messages with their numbers, as in the data set's proto files"""


def classes(packed: bool) -> dict[str, Any]:
    """Classes of the messages, made by protobuf from their fields."""
    descriptors = pytest.importorskip("google.protobuf.descriptor_pb2")
    from google.protobuf import descriptor_pool, message_factory

    file = descriptors.FileDescriptorProto(name="scene.proto", package="w", syntax="proto2")
    for name, fields in MESSAGES.items():
        message = file.message_type.add(name=name)
        for text in fields.split(","):
            kind, field, number = text.split()
            repeated, kind = kind.endswith("*"), kind.rstrip("*")
            made = message.field.add(name=field, number=int(number), label=3 if repeated else 1)
            if kind in _TYPES:
                made.type = _TYPES[kind]
                made.options.packed = packed and repeated and kind not in ("string",)
            else:
                made.type, made.type_name = 11, f".w.{kind}"
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return {
        name: message_factory.GetMessageClass(pool.FindMessageTypeByName(f"w.{name}"))
        for name in MESSAGES
    }


def crc(data: bytes) -> int:
    """Masked CRC-32C, bit by bit."""
    found = 0xFFFFFFFF
    for byte in data:
        found ^= byte
        for _ in range(8):
            found = (found >> 1) ^ (0x82F63B78 if found & 1 else 0)
    found ^= 0xFFFFFFFF
    return (((found >> 15) | (found << 17)) + 0xA282EAD8) & 0xFFFFFFFF


def framed(content: bytes) -> bytes:
    length = struct.pack("<Q", len(content))
    return length + struct.pack("<I", crc(length)) + content + struct.pack("<I", crc(content))


def serialised(document: dict[str, Any], *, packed: bool = False, lights: bool = True) -> Any:
    """A Scenario of the same content as a scene in GPUDrive's JSON."""
    made = classes(packed)
    found = made["Scenario"](scenario_id="a1b2", sdc_track_index=0, current_time_index=10)
    steps = len(document["objects"][0]["valid"])
    found.timestamps_seconds.extend([0.1 * step for step in range(steps)])
    found.laser.append("x" * 1000)
    for one in document["objects"]:
        track = found.tracks.add(id=one["id"], object_type=1)
        for step in range(steps):
            there = one["valid"][step]
            place, velocity = one["position"][step], one["velocity"][step]
            state = track.states.add(valid=there)
            if there:
                state.center_x, state.center_y, state.center_z = place["x"], place["y"], 2.0
                state.length, state.width, state.height = one["length"], one["width"], 1.5
                state.heading = one["heading"][step]
                state.velocity_x, state.velocity_y = velocity["x"], velocity["y"]
    for road in document["roads"]:
        feature = found.map_features.add(id=int(road["id"]))
        points = [{"x": point["x"], "y": point["y"], "z": 0.5} for point in road["geometry"]]
        if road["type"] == "lane":
            feature.lane.type, feature.lane.speed_limit_mph = road["map_element_id"], 65.0
            for point in points:
                feature.lane.polyline.add(**point)
            if road["id"] == "10":
                feature.lane.exit_lanes.extend([11, 999])
        elif road["type"] == "crosswalk":
            for point in points:
                feature.crosswalk.polygon.add(**point)
        else:
            for point in points:
                getattr(feature, road["type"]).polyline.add(**point)
    for step in range(steps if lights else 0):
        moment = found.dynamic_map_states.add()
        light = moment.lane_states.add(lane=12, state=4 if step < 50 else 6)
        light.stop_point.x, light.stop_point.y = 380.0, 1.75
    return found


@pytest.fixture(scope="module")
def content() -> bytes:
    return bytes(serialised(scene()).SerializeToString())


def write(folder: Path, *contents: bytes) -> Path:
    path = folder / NAME
    path.write_bytes(b"".join(framed(one) for one in contents))
    return path


@pytest.mark.parametrize("packed", [False, True])
def test_records_give_the_recording_of_the_same_scene_in_json(packed: bool, tmp_path: Path) -> None:
    (tmp_path / "json").mkdir()
    (tmp_path / "json" / "scene.json").write_text(json.dumps(scene()))
    message = serialised(scene(), packed=packed).SerializeToString()
    write(tmp_path, message, message)
    first, second = datasets.open(tmp_path / NAME).sources
    (other,) = datasets.open(tmp_path / "json").sources
    assert (first.name, second.name) == (f"{NAME}_0000", f"{NAME}_0001")
    assert first.ego() == other.ego() == "5"
    recordings = first.load(), second.load(), other.load()
    assert [sorted(recording.tracks) for recording in recordings] == [["5", "7"]] * 3
    for name in "57":
        columns = [recording.tracks[name].columns for recording in recordings]
        for key in ("x", "y", "h", "speed"):
            assert np.allclose(columns[0][key], columns[2][key], atol=2e-3)
            assert np.array_equal(columns[0][key], columns[1][key])


def test_lanes_have_their_limits_and_successors_and_lights_their_states(
    content: bytes, tmp_path: Path
) -> None:
    (source,) = datasets.open(write(tmp_path, content)).sources
    site = site_of(source, source.load(), tmp_path / "roads")
    assert {round(float(limit), 1) for limit in site.lanes.speed_limit} == {29.1}
    lights = source.lights()
    assert lights is not None and lights.x.tolist() == [380.0]
    assert lights.states[0][49:51] == ("stop", "go") and len(lights.states[0]) == 91
    (lane,) = [one for one in waymo_records.scene(source.path, 0)["roads"] if one["id"] == "10"]
    assert lane["exits"] == ["11", "999"]


@pytest.mark.parametrize("length", [0, 1, 3, 4, 5, 4095, 4096, 4097, 9001])
def test_checksums_are_those_of_the_definition(length: int) -> None:
    data = np.random.default_rng(length).integers(0, 256, length, np.uint8).tobytes()
    assert waymo_records._masked(data) == crc(data)


def cut(found: bytes) -> bytes:
    return found[:-10]


def flipped(found: bytes) -> bytes:
    return found[:500] + bytes([found[500] ^ 1]) + found[501:]


def wrong_length(found: bytes) -> bytes:
    return b"\x01" + found[1:]


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (cut, "it is cut short"),
        (flipped, "its content has another checksum"),
        (wrong_length, "its length has another checksum"),
    ],
)
def test_damaged_files_are_refused(
    damage: Callable[[bytes], bytes], message: str, content: bytes, tmp_path: Path
) -> None:
    path = write(tmp_path, content, content)
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(InvalidFile) as caught:
        waymo_records.scene(path, 0)
    assert NAME in str(caught.value) and "record" in str(caught.value)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda found: found.timestamps_seconds.__delitem__(slice(0, 5)), "91 states for 86 times"),
        (lambda found: found.timestamps_seconds.__setitem__(slice(None),
            [k / 5 for k in range(91)]), "steps last 0.2 s"),
        (lambda found: found.ClearField("sdc_track_index"), "no recording"),
        (lambda found: found.tracks.__delitem__(slice(None)), "no recording"),
    ],
)  # fmt: skip
def test_records_that_are_no_such_scene_are_refused(
    spoil: Callable[[Any], Any], message: str, tmp_path: Path
) -> None:
    found = serialised(scene(), lights=False)
    spoil(found)
    write(tmp_path, found.SerializeToString())
    with pytest.raises(InvalidFile, match=message):
        datasets.open(tmp_path).sources[0].load()


def test_a_message_within_another_one_is_checked_too(content: bytes, tmp_path: Path) -> None:
    """A track that says it is longer than it is, with right checksums."""
    at = 9 * 91  # behind the times
    assert content[at] == 0x12
    path = write(tmp_path, content[:at] + b"\x12\xff\xff\xff\x7f" + content[at + 1 :])
    with pytest.raises(InvalidFile, match=r"record 0.*longer than its message"):
        waymo_records.scene(path, 0)


def test_other_records_are_no_scenes(tmp_path: Path) -> None:
    (tmp_path / NAME).write_bytes(framed(b"\x0a\x03abc\x10\x05"))
    with pytest.raises(InvalidFile, match="no recording of a known format"):
        _ = datasets.open(tmp_path).sources
