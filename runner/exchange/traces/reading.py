"""Tracks of an OSI trace.

Source: ASAM OSI 3.8, GroundTruth, BaseMoving, MovingObject. OSI has the centre of the bounding box
and the middle of the rear axle; a recording has the OpenSCENARIO reference point, which is that of
the rear axle on the ground. Traces of OpenSCENARIO players say so (`source_reference` of type
net.asam.openscenario), and `bbcenter_to_rear` is then taken as it is.
"""

from __future__ import annotations

import math
from array import array
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from runner.engine.participants.declaration import BoundingBox
from runner.recording import Recording, Track
from schemas.common.array_types import FloatArray
from schemas.common.errors import InvalidFile
from schemas.osi.traces import Trace

SCENARIO = "net.asam.openscenario"
"""Type of the reference by which players of OpenSCENARIO name entities"""
_NAMED = "entity_name:"
"""Begins the name among several identifiers of an entity (esmini)"""
_NANO = 1_000_000_000
_EPOCH = 1e6
"""Times (s) from which on a trace counts from another zero than its own beginning"""
_GREATEST = 1e9
"""Greatest magnitude of a value, in m, rad or s"""
MOST_ROWS = 20_000_000
"""Rows of all tracks together, which take about 2 GiB"""
_ROW = 12
"""Numbers of a row: frame, position, yaw, pitch, roll, velocity, acceleration along x and y"""
_CREDIBLE = (0.8, 1.25)
"""Way by the given velocities over the way by positions"""
_VEHICLES = {
    "SMALL_CAR": "car", "COMPACT_CAR": "car", "CAR": "car", "MEDIUM_CAR": "car",
    "LUXURY_CAR": "car", "VAN": "van",
    "DELIVERY_VAN": "van", "HEAVY_TRUCK": "truck", "SEMITRACTOR": "truck",
    "SEMITRAILER": "semitrailer", "TRAILER": "trailer",
    "MOTORBIKE": "motorbike", "MOTORCYCLE": "motorbike", "BICYCLE": "bicycle", "BUS": "bus",
    "TRAM": "tram", "TRAIN": "train",
    "STANDUP_SCOOTER": "bicycle", "MICROMOBILITY_DEVICE": "bicycle", "WORK_MACHINE": "truck",
}  # fmt: skip
"""Category by OSI's vehicle type; all others are cars, with a remark"""
_PEOPLE = {"PEDESTRIAN": "pedestrian", "ANIMAL": "animal"}
_THINGS = {"UNKNOWN", "OTHER", "PYLON", "CONSTRUCTION_SITE_ELEMENT"}
"""Stationary objects that are participants; all others are surroundings"""
_SIZES = {
    "pedestrian": (0.5, 0.5, 1.8),
    "vehicle": (4.5, 1.8, 1.5),
    "miscellaneous": (1.0, 1.0, 1.0),
}
"""Length, width and height (m) where a trace gives none"""
_REAR = 0.3
"""Distance of the rear axle behind the centre of a vehicle in lengths of it, where a trace does not
say"""


class LeftOut(NamedTuple):
    """Part of a trace that is not in its recording: name, number of rows, and reason."""

    what: str
    rows: int
    reason: str


@dataclass
class TraceRecording:
    """Contents of a trace.

    Attributes:
        recording: its tracks, without a road network.
        ego: name of the host vehicle; None where the trace names none that is there.
        truth: the lanes, boundaries and references of all its messages, and the environmental
            conditions of the first that has some, as one GroundTruth.
        remarks: what was assumed or derived, one sentence each.
        left_out: what the recording lacks.
    """

    recording: Recording
    ego: str | None
    truth: Any
    remarks: list[str] = field(default_factory=list)
    left_out: list[LeftOut] = field(default_factory=list)


def read(path: Path) -> TraceRecording:
    """The recording of a trace.

    Raises:
        InvalidFile: the trace is damaged, its times do not ascend, or an object lacks an id or has
            values that are no numbers.
        Unsupported: its messages hold no ground truth.
    """
    trace = Trace(path)
    found = _Collected(path)
    for frame in trace.frames():
        found.take(frame.number, frame.truth)
    made = found.recording()
    made.remarks[:0] = trace.remarks
    return made


class _TraceObject:
    """Known properties of one object."""

    def __init__(self, message: Any, stationary: bool, number: int) -> None:
        self.first, self.stationary, self.number = message, stationary, number
        self.rows = array("d")
        self.moving = not stationary and message.base.HasField("velocity")
        self.accelerated = not stationary and message.base.HasField("acceleration")
        self.turned = message.base.HasField("orientation")


class _Collected:
    """Objects and lanes, taken from message after message."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._objects: dict[int, _TraceObject] = {}
        self._times: list[int] = []
        self._hosts: Counter[int] = Counter()
        self._truth: Any = None
        self._lines: dict[str, set[int]] = {"lane": set(), "lane_boundary": set()}
        self._rows = 0
        self._resized: set[int] = set()

    def take(self, number: int, truth: Any) -> None:
        """Take in one message."""
        now = truth.timestamp.seconds * _NANO + truth.timestamp.nanos
        if self._times and now <= self._times[-1]:
            fault = (
                "is there twice"
                if now == self._times[-1]
                else f"comes after {self._times[-1] / _NANO:g} s"
            )
            raise self._fault(
                number, f"timestamp {now / _NANO:g} s {fault}: the times of a trace ascend"
            )
        self._times.append(now)
        if truth.HasField("host_vehicle_id"):
            self._hosts[truth.host_vehicle_id.value] += 1
        self._keep_lanes(truth)
        seen: set[int] = set()
        for message in truth.moving_object:
            self._take_object(number, message, False, seen)
        for message in truth.stationary_object:
            self._take_object(number, message, True, seen)
        # While reading: a trace that does not fit into memory must not fill it first.
        if self._rows > MOST_ROWS:
            raise self._fault(
                number, f"more than {MOST_ROWS} objects in all messages together are not read"
            )

    def _fault(self, number: int, message: str) -> InvalidFile:
        return InvalidFile(f"message {number}: {message}", path=self._path)

    def _keep_lanes(self, truth: Any) -> None:
        if self._truth is None:
            self._truth = type(truth)()
        kept = self._truth
        for name in ("map_reference", "proj_string"):
            if not getattr(kept, name) and getattr(truth, name):
                setattr(kept, name, getattr(truth, name))
        if truth.HasField("proj_frame_offset") and not kept.HasField("proj_frame_offset"):
            kept.proj_frame_offset.CopyFrom(truth.proj_frame_offset)
        if truth.HasField("environmental_conditions") and not kept.HasField(
            "environmental_conditions"
        ):
            kept.environmental_conditions.CopyFrom(truth.environmental_conditions)
        for name, known in self._lines.items():
            for message in getattr(truth, name):
                # Messages repeat lanes: each is kept once, as it was first.
                if message.id.value not in known:
                    known.add(message.id.value)
                    getattr(kept, name).add().CopyFrom(message)

    def _take_object(self, number: int, message: Any, stationary: bool, seen: set[int]) -> None:
        key, base = message.id.value, message.base
        kind = "stationary_object" if stationary else "moving_object"
        if key in seen:
            raise self._fault(number, f"{kind} {key} is there twice: ids are unique")
        seen.add(key)
        known = self._objects.get(key)
        if known is None:
            if not base.HasField("position"):
                raise self._fault(number, f"{kind} {key} has no position")
            known = self._objects[key] = _TraceObject(message, stationary, len(self._objects))
        elif not stationary and _size(base) != _size(known.first.base):
            self._resized.add(key)
        p, o = base.position, base.orientation
        row = [float(len(self._times) - 1), p.x, p.y, p.z, o.yaw, o.pitch, o.roll]
        row += (
            [0.0] * 5
            if stationary
            else [*_vector(base.velocity), base.acceleration.x, base.acceleration.y]
        )
        # NaN fails the comparison, too.
        if not all(-_GREATEST <= value <= _GREATEST for value in row):
            wrong = next(value for value in row if not -_GREATEST <= value <= _GREATEST)
            raise self._fault(
                number,
                f"{kind} {key} has the value {wrong:g}, which is no position, angle or velocity",
            )
        known.rows.extend(row)
        self._rows += 1

    # the recording --------------------------------------------------------------------------

    def recording(self) -> TraceRecording:
        """Return the recording so far."""
        times = np.array(self._times, dtype=np.int64)
        made = TraceRecording(Recording([], 1.0, None), None, self._truth)
        # In whole ns until here: differences of large doubles would lose digits.
        steps = np.diff(times) / _NANO
        step = float(np.median(steps)) if len(steps) else 0.1
        zero = 0
        if len(times) and times[0] / _NANO >= _EPOCH:
            zero = int(times[0])
            made.remarks.append(
                f"times are from the first message, which is at {zero / _NANO:.3f} s of the "
                "trace's clock"
            )
        time = (times - zero) / _NANO
        if len(steps) and float(steps.max()) > 1.5 * step:
            made.remarks.append(
                f"messages are {step:.3f} s apart in the median and "
                f"{float(steps.max()):.3f} s at most"
            )
        # Messages may name several hosts: the most frequent one is the ego.
        host = self._hosts.most_common(1)[0][0] if self._hosts else None
        tracks, names = [], set[str]()
        for key, participant in self._objects.items():
            reason = _surroundings(participant)
            if reason:
                made.left_out.append(
                    LeftOut(f"stationary_object {key}", len(participant.rows) // _ROW, reason)
                )
                continue
            name = _name(participant.first, key, names)
            names.add(name)
            tracks.append(_track(name, participant, time, made))
            if key == host and not participant.stationary:
                made.ego = name
        if host is not None and made.ego is None:
            made.remarks.append(f"host_vehicle_id {host} is of no moving object: there is no ego")
        if self._resized:
            shown = ", ".join(map(str, sorted(self._resized)[:5]))
            made.remarks.append(
                f"sizes of {len(self._resized)} moving objects change ({shown} first): those of "
                "the first message count"
            )
        made.recording = Recording(tracks, step, None)
        made.remarks = _together(made.remarks)
        return made


def _together(remarks: list[str]) -> list[str]:
    """Remarks, each once; remarks on several objects name the first one and their number."""
    of: dict[str, list[str]] = {}
    for remark in remarks:
        who, parted, what = remark.partition(": ")
        of.setdefault(what if parted else remark, []).append(who if parted else "")
    return [
        what
        if not who[0]
        else f"{who[0]}{f' and {len(who) - 1} more' if len(who) > 1 else ''}: {what}"
        for what, who in of.items()
    ]


def _size(base: Any) -> tuple[float, float, float]:
    return base.dimension.length, base.dimension.width, base.dimension.height


def _vector(value: Any) -> tuple[float, float, float]:
    return value.x, value.y, value.z


def _surroundings(each: _TraceObject) -> str | None:
    """Reason why an object is no participant; None if it is one."""
    if not each.stationary or any(one.type == SCENARIO for one in each.first.source_reference):
        return None
    kind = _enum(each.first.classification, "type")
    return (
        None
        if kind in _THINGS
        else f"a stationary {kind.lower().replace('_', ' ')} is no participant"
    )


def _enum(message: Any, name: str) -> str:
    """The value of an enumeration without TYPE_; UNKNOWN for one of a later version."""
    values = message.DESCRIPTOR.fields_by_name[name].enum_type.values_by_number
    value = values.get(getattr(message, name))
    return value.name.removeprefix("TYPE_") if value is not None else "UNKNOWN"


def _name(message: Any, key: int, taken: Iterable[str]) -> str:
    """The name in the scenario where the trace has it, else the id."""
    name = ""
    for one in message.source_reference:
        if one.type == SCENARIO:
            named = [
                text.removeprefix(_NAMED) for text in one.identifier if text.startswith(_NAMED)
            ]
            name = named[0] if named else one.identifier[0] if len(one.identifier) == 1 else ""
    return name if name and name.isprintable() and name not in taken else str(key)


def _category(each: _TraceObject, name: str, remarks: list[str]) -> tuple[str, str]:
    """Kind and category."""
    if each.stationary:
        return "miscellaneous", "obstacle"
    kind = _enum(each.first, "type")
    if kind in _PEOPLE:
        return "pedestrian", _PEOPLE[kind]
    if kind == "VEHICLE":
        category = _enum(each.first.vehicle_classification, "type")
        if category not in _VEHICLES:
            remarks.append(f"{name}: vehicles of type {category} are taken as cars")
        return "vehicle", _VEHICLES.get(category, "car")
    remarks.append(f"{name}: moving objects of type {kind} are taken as obstacles")
    return "miscellaneous", "obstacle"


def _box(each: _TraceObject, name: str, kind: str, remarks: list[str]) -> BoundingBox:
    """The bounding box about the reference point."""
    size = tuple(
        value if math.isfinite(value) and 0.0 < value < _GREATEST else 0.0
        for value in _size(each.first.base)
    )
    if not all(size):
        remarks.append(f"{name}: sizes that are not given are the usual ones of a {kind}")
    length, width, height = (
        given or usual for given, usual in zip(size, _SIZES[kind], strict=True)
    )
    rear = _offset(each.first, kind)
    own = any(one.type == SCENARIO for one in each.first.source_reference)
    if rear is None:
        if kind == "vehicle":
            remarks.append(
                f"{name}: no bbcenter_to_rear, the rear axle is taken {_REAR:g} of the length "
                "behind the centre"
            )
        return BoundingBox(
            _REAR * length if kind == "vehicle" else 0.0, 0.0, height / 2, length, width, height
        )
    # Other traces mean the axle itself, not the ground below it.
    return BoundingBox(-rear[0], -rear[1], -rear[2] if own else height / 2, length, width, height)


def _offset(message: Any, kind: str) -> tuple[float, float, float] | None:
    """The vector (m) from the box's centre to the reference point, where the trace has one."""
    if kind == "vehicle" and message.vehicle_attributes.HasField("bbcenter_to_rear"):
        offset = _vector(message.vehicle_attributes.bbcenter_to_rear)
    elif kind == "pedestrian" and message.pedestrian_attributes.HasField("bbcenter_to_root"):
        offset = _vector(message.pedestrian_attributes.bbcenter_to_root)
    else:
        return None
    return offset if all(abs(value) < _GREATEST for value in offset) else None


def _track(name: str, each: _TraceObject, time: FloatArray, made: TraceRecording) -> Track:
    kind, category = _category(each, name, made.remarks)
    box = _box(each, name, kind, made.remarks)
    rows = np.frombuffer(each.rows, dtype=np.float64).reshape(-1, _ROW)
    return Track(
        name,
        kind,
        category,
        box,
        partial(_copied, _columns(name, each, rows, time, box, made.remarks)),
    )


def _copied(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Columns that may be written to."""
    return {name: values.copy() for name, values in columns.items()}


def _columns(
    name: str,
    each: _TraceObject,
    rows: FloatArray,
    time: FloatArray,
    box: BoundingBox,
    remarks: list[str],
) -> dict[str, np.ndarray]:
    """Columns of a recording from rows of box centres."""
    own = time[rows[:, 0].astype(np.int64)]
    x, y, z, h, pitch, roll, vx, vy, _, ax, ay = rows[:, 1:].T
    dx, dy = (np.gradient(values, own) if len(own) > 1 else np.zeros(len(own)) for values in (x, y))
    if not each.turned:
        remarks.append(f"{name}: no orientation, the heading is that of the motion")
        h = _of_motion(dx, dy)
    given = each.moving and not each.stationary
    if given and not _credible(np.hypot(vx, vy), np.hypot(dx, dy)):
        remarks.append(
            f"{name}: the velocities contradict the positions, from which they are derived instead"
        )
        given = False
    elif not given and not each.stationary:
        remarks.append(f"{name}: velocities are derived from the positions")
    if not given:
        vx, vy = dx, dy
    cos, sin = np.cos(h), np.sin(h)
    speed = vx * cos + vy * sin
    if given and each.accelerated:
        acceleration = ax * cos + ay * sin
    else:
        acceleration = np.gradient(speed, own) if len(own) > 1 else np.zeros(len(own))
    (ch, cp, cr), (sh, sp, sr) = (
        [turn(values) for values in (h, pitch, roll)] for turn in (np.cos, np.sin)
    )
    bx, by, bz = box.x, box.y, box.z
    count = len(own)
    return {
        "time": own,
        "x": x - bx * ch * cp - by * (ch * sp * sr - sh * cr) - bz * (ch * sp * cr + sh * sr),
        "y": y - bx * sh * cp - by * (sh * sp * sr + ch * cr) - bz * (sh * sp * cr - ch * sr),
        "z": z + bx * sp - by * cp * sr - bz * cp * cr,
        "h": np.arctan2(np.sin(h), np.cos(h)),
        "pitch": pitch.copy(),
        "roll": roll.copy(),
        "speed": speed,
        "acceleration": acceleration,
        "road_id": np.full(count, None, dtype=object),
        "lane_id": np.zeros(count, dtype=np.int64),
        "s": np.zeros(count),
        "t": np.zeros(count),
        "lane_offset": np.zeros(count),
    }


def _credible(given: FloatArray, derived: FloatArray) -> bool:
    """Whether speeds agree with the positions, in sum."""
    way = float(derived.sum())
    # Positions of slow objects are mostly noise: their way says nothing.
    return way < 0.5 * len(derived) or _CREDIBLE[0] <= float(given.sum()) / way <= _CREDIBLE[1]


_STANDING = 0.5
"""Below this speed (m/s) the direction of motion is noise"""


def _of_motion(vx: FloatArray, vy: FloatArray) -> FloatArray:
    """Direction of motion (rad); while standing that of the last motion, before the first that of
    the first."""
    moves = np.hypot(vx, vy) >= _STANDING
    if not moves.any():
        return np.zeros(len(vx))
    # Headings of standing objects would be noise: the last motion counts.
    latest = np.maximum.accumulate(np.where(moves, np.arange(len(vx)), -1))
    return np.asarray(np.arctan2(vy, vx)[np.where(latest >= 0, latest, int(moves.argmax()))])
