"""ROS bags with lists of tracked objects: a ROS 2 folder with `metadata.yaml`, a single `.mcap` of
ROS 2, or a ROS 1 `.bag`.

Source: ROS message definitions of `autoware_perception_msgs` (and `autoware_auto_perception_msgs`:
TrackedObjects, PredictedObjects), `derived_object_msgs` (ObjectArray), `vision_msgs`
(Detection3DArray with ids) and `nav_msgs` (Odometry). Read by the library rosbags, of the extra
`ros`. Definitions of messages are those in the bag; a bag without any is read where it has
TrackedObjects, whose layout has not changed.

Of several lists the one with most messages is read. An Odometry is the recording vehicle: it
becomes the participant `ego` at the times of the lists, with the usual size, and objects in its own
frame are put into that of the odometry. Places are middles of boxes, the odometry's that of the
rear axle. Times are those of the headers. Heights are not read.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from recognition.recordings.intake import Report
from recognition.recordings.motion.smoothing import smoothed
from recognition.recordings.rows import (
    Clock,
    Columns,
    Rows,
    columns_of,
    cut,
    heading_of_motion,
    in_order,
    rate,
)
from recognition.recordings.source import REAR_AXLE, Source, TrackParticipant, participant
from recognition.recordings.table import GREATEST, Table
from runner.recording import Recording
from schemas.common.array_types import FloatArray, IntArray
from schemas.common.errors import InvalidFile, Unsupported, reason
from schemas.common.packages import optional
from schemas.common.policy import current

FORMAT = "ROS"
TITLE = "ROS bags with object lists (Autoware's and others)"
BY_CONTENT = False
_METADATA, _BAG, _MCAP = "metadata.yaml", ".bag", ".mcap"
_KEY = b"rosbag2_bagfile_information"
_PROFILE = slice(17, 25), b"\x04\x00\x00\x00ros2"
"""Place of the profile in the header of an MCAP file, and that of ROS 2"""
EGO = "ego"
_NANO = 1_000_000_000
_HEAD = 4096
_SHORT = 8
"""Digits of a UUID that name a track, where they differ"""
_WORDS = {
    "car": "car", "van": "van", "truck": "truck", "bus": "bus", "trailer": "trailer",
    "motorcycle": "motorbike", "motorbike": "motorbike", "bicycle": "bicycle", "bike": "bicycle",
    "cyclist": "bicycle", "pedestrian": "pedestrian", "person": "pedestrian", "vehicle": "car",
}  # fmt: skip
_AUTOWARE = ("", "car", "truck", "bus", "trailer", "motorbike", "bicycle", "pedestrian")
_DERIVED = ("", "", "", "", "pedestrian", "bicycle", "car", "truck", "motorbike", "car")
"""Categories by number of the class in Autoware's and in derived messages; all others are
obstacles"""
_NO_HEADING, _NO_SIGN, _KNOWN = 0, 1, 2
"""Knowledge of an object's direction, by Autoware's numbers"""
_POLYGON = 2
"""Autoware's number of shapes by their outline"""
_BOX = 1
"""Number of boxes among ROS's primitive shapes"""
_TRACKED = """
std_msgs/Header header
TrackedObject[] objects
{line}
MSG: {package}/TrackedObject
unique_identifier_msgs/UUID object_id
float32 existence_probability
ObjectClassification[] classification
TrackedObjectKinematics kinematics
Shape shape
{line}
MSG: {package}/ObjectClassification
uint8 label
float32 probability
{line}
MSG: {package}/TrackedObjectKinematics
geometry_msgs/PoseWithCovariance pose_with_covariance
geometry_msgs/TwistWithCovariance twist_with_covariance
geometry_msgs/AccelWithCovariance acceleration_with_covariance
uint8 orientation_availability
bool is_stationary
{line}
MSG: {package}/Shape
uint8 type
geometry_msgs/Polygon footprint
geometry_msgs/Vector3 dimensions
"""
"""Layout of Autoware's tracked objects, for bags that do not say it"""
_PACKAGES = ("autoware_perception_msgs", "autoware_auto_perception_msgs")


class _Object(NamedTuple):
    """An object in a message.

    name: of its track; empty without one. place: x, y, m. heading: rad. speed: along the
    heading, m/s; NaN where none is stated. size: length and width, m; 0 where none is stated.
    known: whether the heading is known, by `_KNOWN` and others.
    """

    name: str
    category: str
    place: tuple[float, float]
    heading: float
    speed: float
    size: tuple[float, float]
    known: int = _KNOWN


def claims(path: Path) -> bool:
    """Whether a file is the metadata of a ROS 2 bag, a bag of one file, or a ROS 1 bag."""
    if path.suffix.lower() == _BAG:
        return True
    if path.name != _METADATA:
        return is_mcap(path) and not path.with_name(_METADATA).is_file()
    with path.open("rb") as file:
        return _KEY in file.read(_HEAD)


def is_mcap(path: Path) -> bool:
    """Whether a file is an MCAP file of ROS 2, by its profile."""
    if path.suffix.lower() != _MCAP:
        return False
    place, profile = _PROFILE
    with path.open("rb") as file:
        return file.read(place.stop)[place] == profile


def sources(path: Path, roads: Path) -> list[Source]:
    """The recording of a bag, which is a site of its own."""
    name = path.parent.name if path.name == _METADATA else path.stem
    return [Source(name, name, FORMAT, path, partial(_read, path), ego=lambda: EGO)]


# objects of messages ----------------------------------------------------------------------------


def _yaw(orientation: Any) -> float:
    x, y, z, w = orientation.x, orientation.y, orientation.z, orientation.w
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def _place(pose: Any) -> tuple[float, float]:
    return pose.position.x, pose.position.y


def _at(names: tuple[str, ...], number: int) -> str:
    return (names[number] if 0 <= number < len(names) else "") or "obstacle"


def _of_autoware(message: Any) -> Iterator[_Object]:
    """Yield the objects of TrackedObjects or PredictedObjects."""
    for one in message.objects:
        motion = one.kinematics
        first = "initial_" if hasattr(motion, "initial_pose_with_covariance") else ""
        pose = getattr(motion, f"{first}pose_with_covariance").pose
        twist = getattr(motion, f"{first}twist_with_covariance").twist
        best = max(one.classification, key=lambda kind: kind.probability, default=None)
        size = one.shape.dimensions.x, one.shape.dimensions.y
        if one.shape.type == _POLYGON and one.shape.footprint.points:
            corners = np.array([(point.x, point.y) for point in one.shape.footprint.points])
            length, width = np.ptp(corners, axis=0).tolist()
            size = length, width
        name = bytes(one.object_id.uuid).hex()
        category = _at(_AUTOWARE, best.label if best is not None else 0)
        known = getattr(motion, "orientation_availability", _KNOWN)
        yield _Object(
            name, category, _place(pose), _yaw(pose.orientation), twist.linear.x, size, known
        )


def _of_derived(message: Any) -> Iterator[_Object]:
    """Yield the objects of an ObjectArray, whose velocities are in its frame."""
    for one in message.objects:
        heading = _yaw(one.pose.orientation)
        speed = one.twist.linear.x * math.cos(heading) + one.twist.linear.y * math.sin(heading)
        box = one.shape.type == _BOX and len(one.shape.dimensions) > 1
        size = (
            (float(one.shape.dimensions[0]), float(one.shape.dimensions[1])) if box else (0.0, 0.0)
        )
        category = _at(_DERIVED, one.classification)
        yield _Object(str(one.id), category, _place(one.pose), heading, speed, size)


def _of_vision(message: Any) -> Iterator[_Object]:
    """Yield the objects of a Detection3DArray; it states no velocities."""
    for one in message.detections:
        best = max(one.results, key=lambda result: result.hypothesis.score, default=None)
        word = str(best.hypothesis.class_id).lower() if best is not None else ""
        category = _WORDS.get(word, "obstacle")
        pose, size = one.bbox.center, (one.bbox.size.x, one.bbox.size.y)
        name = str(getattr(one, "id", ""))
        yield _Object(name, category, _place(pose), _yaw(pose.orientation), math.nan, size)


_LISTS: dict[str, Callable[[Any], Iterator[_Object]]] = {
    **{
        f"{package}/msg/{kind}": _of_autoware
        for package in _PACKAGES
        for kind in ("TrackedObjects", "PredictedObjects")
    },
    "derived_object_msgs/msg/ObjectArray": _of_derived,
    "vision_msgs/msg/Detection3DArray": _of_vision,
}
"""Readers of objects by type of message"""
_ODOMETRY = "nav_msgs/msg/Odometry"


# bags -------------------------------------------------------------------------------------------


class _Bag(NamedTuple):
    """Contents of a bag.

    topic, frame: of the list of objects. times: of each row, ns. objects: one a row. odometry: of
    the recording vehicle: time (ns), x, y, heading, speed. fixed, moving: frames of the odometry
    and of its vehicle. remarks: what was assumed or left out.
    """

    topic: str
    frame: str
    times: list[int]
    objects: list[_Object]
    odometry: list[tuple[float, ...]]
    fixed: str
    moving: str
    remarks: list[str]


def _store() -> Any:
    """Definitions of messages for bags that have none."""
    types = optional("rosbags.typesys")
    store = types.get_typestore(types.Stores.ROS2_HUMBLE)
    for package in _PACKAGES:
        text = _TRACKED.format(package=package, line="=" * 80)
        store.register(types.get_types_from_msg(text, f"{package}/msg/TrackedObjects"))
    return store


def _contents(path: Path) -> _Bag:
    """Read a bag.

    Raises:
        InvalidFile: it is damaged. Unsupported: it has no list of objects that can be read.
    """
    highlevel = optional("rosbags.highlevel")
    folder = path.parent if path.name == _METADATA else path
    for file in folder.iterdir() if folder.is_dir() else (path,):
        current().admit(file)
    try:
        with highlevel.AnyReader([folder], default_typestore=_store()) as reader:
            return _messages(path, reader)
    except (InvalidFile, Unsupported):
        raise
    except Exception as error:  # the library raises errors of all kinds for damaged bags
        raise InvalidFile(f"not readable as a ROS bag: {reason(error)}", path=path) from None


def _messages(path: Path, reader: Any) -> _Bag:
    lists = [one for one in reader.connections if one.msgtype in _LISTS and one.msgcount]
    if not lists:
        types = ", ".join(sorted({one.msgtype for one in reader.connections})[:6]) or "nothing"
        told = f"no list of objects in this bag: it has {types}; known are {', '.join(_LISTS)}"
        raise Unsupported(told, path=path)
    chosen = max(lists, key=lambda one: one.msgcount)
    odometry = [one for one in reader.connections if one.msgtype == _ODOMETRY and one.msgcount]
    own = max(odometry, key=lambda one: one.msgcount, default=None)
    remarks = [f"objects are those of {chosen.topic}"]
    remarks += [f"{one.topic} is not read" for one in lists if one is not chosen]
    bag = _Bag(chosen.topic, "", [], [], [], "", "", remarks)
    frames = Counter[str]()
    wanted = [chosen] if own is None else [chosen, own]
    for connection, _, data in reader.messages(connections=wanted):
        message = reader.deserialize(data, connection.msgtype)
        stamp = message.header.stamp
        time = stamp.sec * _NANO + stamp.nanosec
        if connection.topic == chosen.topic:
            frames[message.header.frame_id] += 1
            found = list(_LISTS[chosen.msgtype](message))
            bag.times.extend([time] * len(found))
            bag.objects.extend(found)
        else:
            bag.odometry.append(_odometry(time, message))
            bag = bag._replace(fixed=message.header.frame_id, moving=message.child_frame_id)
    if len(frames) > 1:
        told = f"objects of {chosen.topic} are in several frames: {', '.join(sorted(frames))}"
        raise Unsupported(told, path=path)
    return bag._replace(frame=next(iter(frames)))


def _odometry(time: int, message: Any) -> tuple[float, ...]:
    pose = message.pose.pose
    return (time, *_place(pose), _yaw(pose.orientation), message.twist.twist.linear.x)


def _read(path: Path) -> tuple[Recording, Report]:
    bag = _contents(path)
    _require_tracks(path, bag)
    names = _names(bag.objects)
    numbers = {name: index for index, name in enumerate(names)}
    track = np.array([numbers[one.name] for one in bag.objects], dtype=np.int64)
    times = np.array(bag.times, dtype=np.int64)
    values = np.array(
        [(*one.place, one.heading, one.speed, *one.size, one.known) for one in bag.objects],
        dtype=np.float64,
    )
    _require_measured(path, bag, values)
    who = [
        participant(shown, _category(bag, numbers[name], track), *_size(values[track == index]))
        for index, (name, shown) in enumerate(names.items())
    ]
    if bag.odometry:
        values = _in_fixed_frame(bag, times, values)
        one = participant(EGO if EGO not in names.values() else f"{EGO}_vehicle", "car")
        own_times, own = _own_rows(bag, one)
        who += [one] if len(own) else []
        track = np.append(track, np.full(len(own), len(names)))
        times, values = np.append(times, own_times), np.concatenate([values, own])
        bag.remarks.append("the size of the recording vehicle is not in the bag: that of a car")
    else:
        bag.remarks.append(f"there is no odometry: the frame {bag.frame!r} is taken as fixed")
    clock = Clock("header.stamp", times, _NANO, _step(path, bag), int(times.min()))
    table = Table(path, {"header.stamp": times}, lines=False)
    shown = [one.name for one in who]
    rows = in_order(table, track, clock, names=shown, sort=True, repeats=True)
    report = rows.report(shown)
    report.remarks += bag.remarks
    tracks = cut(*smoothed(rows, who, _columns(rows, who, values[rows.order]), report))
    return Recording(tracks, clock.step, None), report


def _columns(rows: Rows, who: list[TrackParticipant], values: FloatArray) -> Columns:
    x, y, h, speed, _, _, known = values.T
    vx, vy = rate(x, rows), rate(y, rows)
    h, speed = _directed(h, speed, known, heading_of_motion(vx, vy, rows))
    # Lists without velocities, and objects without heading.
    speed = np.where(np.isnan(speed), vx * np.cos(h) + vy * np.sin(h), speed)
    return columns_of(rows, who, x, y, h, speed, rate(speed, rows))


def _require_tracks(path: Path, bag: _Bag) -> None:
    if not bag.objects:
        raise InvalidFile(f"the lists of {bag.topic} are empty", path=path)
    if not any(one.name for one in bag.objects):
        told = f"objects of {bag.topic} have no ids: they are detections, tracks are expected"
        raise Unsupported(told, path=path)


def _require_measured(path: Path, bag: _Bag, values: FloatArray) -> None:
    """Refuse places, headings and sizes that are no measured values; speeds may be absent."""
    measured = np.abs(values[:, [0, 1, 2, 4, 5]]) <= GREATEST
    if not measured.all():
        row = int((~measured.all(axis=1)).argmax())
        told = f"object {bag.objects[row].name[:40]!r} has a value that is no measured one"
        raise InvalidFile(told, path=path, element=f"topic {bag.topic}")


def _names(objects: list[_Object]) -> dict[str, str]:
    """Names of tracks by their ids, in the order of their appearance: the first digits, where these
    tell them apart."""
    ids = dict.fromkeys(one.name for one in objects)
    counts = Counter(name[:_SHORT] for name in ids)
    return {name: name[:_SHORT] if counts[name[:_SHORT]] == 1 else name for name in ids}


def _category(bag: _Bag, number: int, track: IntArray) -> str:
    """The most frequent category of a track: classifiers waver."""
    own = np.flatnonzero(track == number).tolist()
    return Counter(bag.objects[row].category for row in own).most_common(1)[0][0]


def _size(values: FloatArray) -> tuple[float | None, float | None]:
    """Median length and width of a track; None where they are not stated."""
    sizes = values[:, 4:6]
    stated = sizes[(sizes > 0.0).all(axis=1)]
    if not len(stated):
        return None, None
    length, width = np.median(stated, axis=0).tolist()
    return length, width


def _step(path: Path, bag: _Bag) -> float:
    """Median time between the lists of objects, s."""
    apart = np.diff(np.unique(np.array(bag.times, dtype=np.int64)))
    if not len(apart):
        raise InvalidFile(f"{bag.topic} has lists of one time only", path=path)
    return float(np.median(apart)) / _NANO


def _own_at(bag: _Bag, times: IntArray) -> FloatArray:
    """Rows x, y, heading, speed of the recording vehicle at times (ns): odometry comes more often
    than lists."""
    own = np.array(bag.odometry)
    own = own[np.argsort(own[:, 0], kind="stable")]
    own[:, 3] = np.unwrap(own[:, 3])
    return np.stack([np.interp(times, own[:, 0], own[:, index]) for index in range(1, 5)], axis=1)


def _in_fixed_frame(bag: _Bag, times: IntArray, values: FloatArray) -> FloatArray:
    """Rows of objects in the frame of the odometry."""
    if bag.frame != bag.moving:
        if bag.frame != bag.fixed:
            told = f"the frames {bag.frame!r} and {bag.fixed!r} are taken as the same"
            bag.remarks.append(told)
        return values
    x, y, h, _ = _own_at(bag, times).T
    moved = values.copy()
    moved[:, 0] = x + values[:, 0] * np.cos(h) - values[:, 1] * np.sin(h)
    moved[:, 1] = y + values[:, 0] * np.sin(h) + values[:, 1] * np.cos(h)
    moved[:, 2] += h
    told = f"objects are in the frame {bag.frame!r} of the vehicle: they are put into {bag.fixed!r}"
    bag.remarks.append(told)
    return moved


def _own_rows(bag: _Bag, one: TrackParticipant) -> tuple[IntArray, FloatArray]:
    """Times and rows of the recording vehicle at those of the lists, at the middle of its box."""
    clock = [time for time, *_ in bag.odometry]
    times = np.unique(np.array(bag.times, dtype=np.int64))
    times = times[(times >= min(clock)) & (times <= max(clock))]
    x, y, h, speed = _own_at(bag, times).T
    ahead = REAR_AXLE * one.box.length
    length, width, known = (
        np.full(len(times), value) for value in (one.box.length, one.box.width, float(_KNOWN))
    )
    place = x + ahead * np.cos(h), y + ahead * np.sin(h)
    return times, np.stack([*place, h, speed, length, width, known], axis=1)


def _directed(
    h: FloatArray, speed: FloatArray, known: FloatArray, motion: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Headings and speeds along them: those of the motion where no heading is known, turned round
    against the motion where its sign is not."""
    turned = (known == _NO_SIGN) & (np.cos(h - motion) < 0.0)
    h = np.where(known == _NO_HEADING, motion, np.where(turned, h + math.pi, h))
    speed = np.where(known == _NO_HEADING, math.nan, np.where(turned, -speed, speed))
    return h, speed
