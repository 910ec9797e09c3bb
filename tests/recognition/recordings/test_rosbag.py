"""ROS bags: Autoware's tracked objects, other lists, odometry, damaged bags, and objects without
ids."""

from __future__ import annotations

import math
import sqlite3
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recognition import recordings as datasets
from recognition.recordings.formats.rosbag import _store
from schemas.common.errors import InvalidFile, ToolchainError, Unsupported
from tests.recognition.traffic import read

rosbag2 = pytest.importorskip("rosbags.rosbag2", reason="the extra `ros` is not installed")
rosbag1 = pytest.importorskip("rosbags.rosbag1")
typesys = pytest.importorskip("rosbags.typesys")

STORE = _store()
_LINE = "=" * 80
for name, text in {
    "derived_object_msgs/msg/ObjectArray": (
        f"std_msgs/Header header\nObject[] objects\n{_LINE}\nMSG: derived_object_msgs/Object\n"
        "uint32 id\nuint8 classification\ngeometry_msgs/Pose pose\ngeometry_msgs/Twist twist\n"
        "shape_msgs/SolidPrimitive shape"
    ),
    "vision_msgs/msg/Detection3DArray": (
        f"std_msgs/Header header\nDetection3D[] detections\n{_LINE}\nMSG: vision_msgs/Detection3D\n"
        "ObjectHypothesisWithPose[] results\nBoundingBox3D bbox\nstring id\n"
        f"{_LINE}\nMSG: vision_msgs/BoundingBox3D\ngeometry_msgs/Pose center\n"
        "geometry_msgs/Vector3 size\n"
        f"{_LINE}\nMSG: vision_msgs/ObjectHypothesisWithPose\nObjectHypothesis hypothesis\n"
        f"{_LINE}\nMSG: vision_msgs/ObjectHypothesis\nstring class_id\nfloat64 score"
    ),
}.items():
    STORE.register(typesys.get_types_from_msg(text, name))
T = STORE.types
TRACKED = "autoware_perception_msgs/msg/TrackedObjects"
ODOMETRY = "nav_msgs/msg/Odometry"
EPOCH = 1_700_000_000
FRAMES = 40


def header(time: float, frame: str) -> Any:
    seconds, part = divmod(round(time * 1e9), 1_000_000_000)
    stamp = T["builtin_interfaces/msg/Time"](sec=EPOCH + seconds, nanosec=part)
    return T["std_msgs/msg/Header"](stamp=stamp, frame_id=frame)


def vector(x: float = 0.0, y: float = 0.0, z: float = 0.0, kind: str = "Vector3") -> Any:
    return T[f"geometry_msgs/msg/{kind}"](x=x, y=y, z=z)


def pose(x: float, y: float, h: float) -> Any:
    turn = T["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=math.sin(h / 2), w=math.cos(h / 2))
    place = vector(x, y, 0.75, "Point")
    return T["geometry_msgs/msg/Pose"](position=place, orientation=turn)


def twist(vx: float, vy: float = 0.0) -> Any:
    return T["geometry_msgs/msg/Twist"](linear=vector(vx, vy), angular=vector())


def with_covariance(kind: str, value: Any) -> Any:
    name = f"geometry_msgs/msg/{kind}WithCovariance"
    return T[name](**{kind.lower(): value}, covariance=np.zeros(36))


def tracked(
    time: float, objects: Iterable[tuple[int, int, float, float, float, float]], frame: str = "map"
) -> Any:
    """TrackedObjects: id, label, x, y, heading, speed of each."""
    package = "autoware_perception_msgs/msg/"
    made = []
    for key, label, x, y, h, v in objects:
        uuid = np.full(16, key, np.uint8)
        acceleration = T["geometry_msgs/msg/Accel"](linear=vector(), angular=vector())
        motion = T[package + "TrackedObjectKinematics"](
            pose_with_covariance=with_covariance("Pose", pose(x, y, h)),
            twist_with_covariance=with_covariance("Twist", twist(v)),
            acceleration_with_covariance=with_covariance("Accel", acceleration),
            orientation_availability=1,
            is_stationary=False,
        )
        outline = T["geometry_msgs/msg/Polygon"](points=[])
        shape = T[package + "Shape"](type=0, footprint=outline, dimensions=vector(4.0, 2.0, 1.5))
        made.append(
            T[package + "TrackedObject"](
                object_id=T["unique_identifier_msgs/msg/UUID"](uuid=uuid),
                existence_probability=1.0,
                classification=[T[package + "ObjectClassification"](label=label, probability=0.9)],
                kinematics=motion,
                shape=shape,
            )
        )
    return T[TRACKED](header=header(time, frame), objects=made)


def odometry(time: float, x: float, y: float, h: float, v: float) -> Any:
    return T[ODOMETRY](
        header=header(time, "map"),
        child_frame_id="base_link",
        pose=with_covariance("Pose", pose(x, y, h)),
        twist=with_covariance("Twist", twist(v)),
    )


Message = tuple[str, str, float, Any]
"""Topic, type, time and message"""


def write(folder: Path, messages: Iterable[Message], storage: str = "MCAP") -> Path:
    """Write a ROS 2 bag."""
    plugin = rosbag2.StoragePlugin[storage]
    with rosbag2.Writer(folder, version=9, storage_plugin=plugin) as writer:
        connections: dict[str, Any] = {}
        for topic, kind, time, message in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=STORE)
            data = STORE.serialize_cdr(message, kind)
            writer.write(connections[topic], round((EPOCH + time) * 1e9), data)
    return folder


def two_cars(frame: str = "map", ego: bool = False) -> list[Message]:
    """A car eastwards at 10 m/s, and a truck whose stated heading is against its motion."""
    messages: list[Message] = []
    for k in range(FRAMES):
        t = 0.1 * k
        # Where the frame moves with the ego, which drives at 5 m/s, so do the places in it.
        off = 5.0 * t if frame == "base_link" else 0.0
        objects = [
            (1, 1, 10.0 * t - off, 4.0, 0.0, 10.0),
            (2, 2, 30.0 + 8.0 * t - off, 0.0, math.pi, -8.0),
        ]
        messages.append(("/tracked", TRACKED, t, tracked(t, objects, frame)))
        if ego:
            for part in (0.0, 0.02, 0.04, 0.06, 0.08):
                own = odometry(t + part, 5.0 * (t + part), -4.0, 0.0, 5.0)
                messages.append(("/odometry", ODOMETRY, t + part, own))
    return messages


def without_definitions(folder: Path) -> Path:
    """The bag, without the table of definitions, as older recorders write it."""
    for file in folder.glob("*.db3"):
        with sqlite3.connect(file) as database:
            database.execute("DELETE FROM message_definitions")
    return folder


@pytest.mark.parametrize("storage", ["MCAP", "SQLITE3", "without definitions"])
def test_tracked_objects_are_a_recording(storage: str, tmp_path: Path) -> None:
    folder = write(tmp_path / "drive", two_cars(), "MCAP" if storage == "MCAP" else "SQLITE3")
    if storage == "without definitions":
        without_definitions(folder)
    found = datasets.open(tmp_path)
    (source,) = found.sources
    assert (source.name, source.format, found.skipped) == ("drive", "ROS", [])
    recording, report = read(folder)
    assert (report.verdict, round(recording.timestep, 6)) == ("fit", 0.1)
    car, truck = recording.tracks.values()
    assert (car.name, car.category, truck.category) == ("01010101", "car", "truck")
    assert car.columns["speed"] == pytest.approx(10.0, abs=0.05)
    assert car.columns["x"][0] == pytest.approx(-0.3 * 4.0, abs=0.05)
    # The sign of the heading is unknown: that of the motion counts.
    assert truck.columns["h"] == pytest.approx(0.0, abs=0.01)
    assert truck.columns["speed"] == pytest.approx(8.0, abs=0.05)
    assert any("'map' is taken as fixed" in remark for remark in report.remarks)


def test_a_single_file_of_ros_2_is_read(tmp_path: Path) -> None:
    (file,) = write(tmp_path / "bag", two_cars()).glob("*.mcap")
    file.rename(tmp_path / "drive.mcap")
    recording, report = read(tmp_path / "drive.mcap")
    assert (len(recording.tracks), report.verdict) == (2, "fit")


@pytest.mark.parametrize("frame", ["map", "base_link"])
def test_odometry_is_the_ego_and_places_objects_of_its_frame(frame: str, tmp_path: Path) -> None:
    recording, report = read(write(tmp_path / "drive", two_cars(frame, ego=True)))
    ego = recording.tracks["ego"]
    assert len(ego.columns["time"]) == FRAMES
    assert ego.columns["speed"] == pytest.approx(5.0, abs=0.05)
    assert ego.columns["x"] == pytest.approx(5.0 * ego.columns["time"], abs=0.05)
    car = recording.tracks["01010101"]
    assert car.columns["x"] == pytest.approx(10.0 * car.columns["time"] - 1.2, abs=0.05)
    assert car.columns["y"] == pytest.approx(4.0 - 4.0 * (frame == "base_link"), abs=0.05)
    assert report.verdict == "fit"
    (source,) = datasets.open(tmp_path).sources
    assert source.ego() == "ego"


def derived(time: float) -> Any:
    box = T["shape_msgs/msg/SolidPrimitive"](
        type=1, dimensions=np.array([4.0, 2.0, 1.5]), polygon=T["geometry_msgs/msg/Polygon"]([])
    )
    one = T["derived_object_msgs/msg/Object"](
        id=7, classification=6, pose=pose(0.0, -10.0 * time, -math.pi / 2),
        twist=twist(0.0, -10.0), shape=box,
    )  # fmt: skip
    return T["derived_object_msgs/msg/ObjectArray"](header(time, "map"), [one])


def detected(time: float, name: str = "7") -> Any:
    best = T["vision_msgs/msg/ObjectHypothesis"](class_id="car", score=0.9)
    box = T["vision_msgs/msg/BoundingBox3D"](
        pose(0.0, -10.0 * time, -math.pi / 2), vector(4.0, 2.0, 1.5)
    )
    one = T["vision_msgs/msg/Detection3D"](
        [T["vision_msgs/msg/ObjectHypothesisWithPose"](best)], box, name
    )
    return T["vision_msgs/msg/Detection3DArray"](header(time, "map"), [one])


@pytest.mark.parametrize(
    ("kind", "make"),
    [
        ("derived_object_msgs/msg/ObjectArray", derived),
        ("vision_msgs/msg/Detection3DArray", detected),
    ],
)
def test_other_lists_of_objects_are_read(
    kind: str, make: Callable[[float], Any], tmp_path: Path
) -> None:
    messages = [("/objects", kind, 0.1 * k, make(0.1 * k)) for k in range(FRAMES)]
    recording, report = read(write(tmp_path / "drive", messages))
    (car,) = recording.tracks.values()
    assert (car.name, car.category, report.verdict) == ("7", "car", "fit")
    assert car.columns["speed"] == pytest.approx(10.0, abs=0.05)
    assert car.columns["h"] == pytest.approx(-math.pi / 2, abs=0.01)


def test_a_bag_of_ros_1_is_read(tmp_path: Path) -> None:
    path, kind = tmp_path / "drive.bag", "derived_object_msgs/msg/ObjectArray"
    store = typesys.get_typestore(typesys.Stores.ROS1_NOETIC)
    text, _ = STORE.generate_msgdef(kind, ros_version=2)
    found = typesys.get_types_from_msg(text, kind)
    store.register({name: value for name, value in found.items() if name not in store.fielddefs})
    with rosbag1.Writer(path) as writer:
        connection = writer.add_connection("/objects", kind, typestore=store)
        for k in range(FRAMES):
            message = derived(0.1 * k)
            message.header = store.types["std_msgs/msg/Header"](
                seq=k, stamp=message.header.stamp, frame_id="map"
            )
            data = store.serialize_ros1(message, kind)
            writer.write(connection, round((EPOCH + 0.1 * k) * 1e9), data)
    recording, report = read(path)
    assert (list(recording.tracks), report.verdict) == (["7"], "fit")


def no_ids(folder: Path) -> None:
    kind = "vision_msgs/msg/Detection3DArray"
    write(folder, [("/objects", kind, 0.1 * k, detected(0.1 * k, "")) for k in range(4)])


def no_objects(folder: Path) -> None:
    write(folder, [("/odometry", ODOMETRY, 0.1, odometry(0.1, 0.0, 0.0, 0.0, 0.0))])


def empty_lists(folder: Path) -> None:
    write(folder, [("/tracked", TRACKED, 0.1, tracked(0.1, []))])


def one_time(folder: Path) -> None:
    write(folder, two_cars()[:1])


def two_frames(folder: Path) -> None:
    write(folder, [*two_cars("map")[:20], *two_cars("odom")[20:]])


def no_number(folder: Path) -> None:
    messages = two_cars()
    messages[3] = ("/tracked", TRACKED, 0.3, tracked(0.3, [(1, 1, math.nan, 0.0, 0.0, 1.0)]))
    write(folder, messages)


def cut_short(folder: Path) -> None:
    write(folder, two_cars())
    (file,) = folder.glob("*.mcap")
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])


def absent(folder: Path) -> None:
    write(folder, two_cars())
    (file,) = folder.glob("*.mcap")
    file.unlink()


def other_metadata(folder: Path) -> None:
    write(folder, two_cars())
    (folder / "metadata.yaml").write_text("rosbag2_bagfile_information: [1]\n")


@pytest.mark.parametrize(
    ("make", "kind", "told"),
    [
        (no_ids, Unsupported, "objects of /objects have no ids: they are detections"),
        (no_objects, Unsupported, "no list of objects in this bag: it has nav_msgs/msg/Odometry"),
        (empty_lists, InvalidFile, "the lists of /tracked are empty"),
        (one_time, InvalidFile, "/tracked has lists of one time only"),
        (two_frames, Unsupported, "objects of /tracked are in several frames: map, odom"),
        (
            no_number,
            InvalidFile,
            "object '01010101010101010101010101010101' has a value that is no",
        ),
        (cut_short, InvalidFile, "not readable as a ROS bag"),
        (absent, InvalidFile, "not readable as a ROS bag: Some database files are missing"),
        (other_metadata, InvalidFile, "not readable as a ROS bag"),
    ],
)
def test_a_bad_bag_is_refused(
    make: Callable[[Path], None], kind: type[ToolchainError], told: str, tmp_path: Path
) -> None:
    make(tmp_path / "drive")
    (source,) = datasets.open(tmp_path).sources
    with pytest.raises(kind) as raised:
        source.load()
    assert told in raised.value.message
