"""Rules of ASAM OSI for ground-truth traces.

Three families, each found under its uid: the rules that OSI publishes beside its fields (`is_set`,
`is_globally_unique`, `refers_to`, ranges, conditions; Source: ASAM OSI 3.8, message definitions),
under the uids of ASAM's qc-osi-trace; the rules for multi-channel trace files (ASAM OSI 3.8, "OSI
trace file formats"); and requirements of the message definitions' text for objects and lanes. A
problem is reported once for all messages that have it. Lanes and other things that do not change
may be in the first messages alone: a reference to anything that an earlier message has is sound.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from schemas.checks import Problem
from schemas.common.errors import InvalidFile, Unsupported
from schemas.osi.traces import TRACE, Trace, TraceMessage

_SOURCE = "asam.net:osi:3.8.0:osirules"
_FORMAT = "asam.net:osi:3.8.0:multi_channel_trace_file"
READABLE = "asam.net:osi:3.0.0:deserialization.possible"
_OWN = "xosc.toolchain:osi:3.8.0"
MOST = 100
"""Problems reported of one rule and file"""

_FIELDS = {
    "Timestamp": {"seconds": ">= 0", "nanos": ">= 0, <= 999999999"},
    "Dimension3d": {"length": ">= 0", "width": ">= 0", "height": ">= 0"},
    "ExternalReference": {"type": "set"},
    "LogicalLaneAssignment": {"assigned_lane_id": "LogicalLane"},
    "EnvironmentalConditions": {
        "atmospheric_pressure": ">= 80000, <= 120000", "temperature": ">= 170, <= 340",
        "relative_humidity": ">= 0, <= 100",
    },
    "EnvironmentalConditions.TimeOfDay": {"seconds_since_midnight": ">= 0, < 86400"},
    "EnvironmentalConditions.Wind": {"speed": ">= 0"},
    "EnvironmentalConditions.Sun": {"intensity": ">= 0"},
    "GroundTruth": {"version": "set", "timestamp": "set", "host_vehicle_id": "set, MovingObject",
        "country_code": "country"},
    "Lane": {"id": "set, unique"},
    "Lane.Classification.RoadCondition": {
        "surface_temperature": ">= 0", "surface_water_film": ">= 0",
        "surface_freezing_point": ">= 0", "surface_ice": ">= 0",
        "surface_roughness": ">= 0",
    },
    "Lane.Classification.LanePairing": {"antecessor_lane_id": "Lane", "successor_lane_id": "Lane"},
    "LaneBoundary": {"id": "unique"},
    "LaneBoundary.Classification": {"limiting_structure_id": "StationaryObject"},
    "LogicalLaneBoundary": {"id": "set, unique", "reference_line_id": "ReferenceLine",
        "physical_boundary_id": "LaneBoundary"},
    "LogicalLane": {
        "id": "unique", "reference_line_id": "ReferenceLine",
        "right_boundary_id": "LogicalLaneBoundary",
        "left_boundary_id": "LogicalLaneBoundary",
    },
    "LogicalLane.PhysicalLaneReference": {"physical_lane_id": "Lane"},
    "LogicalLane.LaneConnection": {"other_lane_id": "LogicalLane"},
    "LogicalLane.LaneRelation": {"other_lane_id": "LogicalLane"},
    "StationaryObject": {"id": "set, unique"},
    "MovingObject": {
        "id": "set, unique", "vehicle_attributes": "set if type 2",
        "vehicle_classification": "set if type 2",
        "pedestrian_attributes": "set if type 3",
    },
    "MovingObject.VehicleAttributes": {"radius_wheel": ">= 0", "number_wheels": ">= 1"},
    "MovingObject.VehicleClassification": {"trailer_id": "set if has_trailer 1"},
    "Occupant": {"id": "unique"},
    "ReferenceLine": {"id": "set, unique"},
    "RoadMarking": {"id": "set"},
    "RoadMarking.Classification": {"assigned_lane_id": "Lane", "monochrome_color": "set if type 2"},
    "SensorView": {
        "version": "set", "timestamp": "set", "sensor_id": "set", "mounting_position": "set",
        "host_vehicle_id": "set, MovingObject",
    },
    "TrafficLight": {"id": "set, unique"},
    "TrafficLight.Classification": {"counter": ">= 0", "assigned_lane_id": "Lane"},
    "TrafficSign": {"id": "set, unique"},
    "TrafficSign.MainSign.Classification": {"assigned_lane_id": "Lane"},
    "TrafficSign.SupplementarySign.Classification": {"assigned_lane_id": "Lane"},
    "TrafficSign.SupplementarySign.Classification.Arrow": {"lane_id": "Lane"},
}  # fmt: skip
"""Rules of fields by message: set, unique among all ids, the message type that an id refers to,
ranges, and conditions. Rules
that demand presence of a repeated field are left out: an absent one is the same as an empty one."""
_RANGE = re.compile(r"(>=|<=|<) (-?[\d.]+)")
_COMPARE: dict[str, Callable[[float, float], bool]] = {
    ">=": lambda a, b: a >= b, "<=": lambda a, b: a <= b, "<": lambda a, b: a < b,
}  # fmt: skip
_NAMES = {
    ">=": "is_greater_than_or_equal_to",
    "<=": "is_less_than_or_equal_to",
    "<": "is_less_than",
}


class OsiRule(NamedTuple):
    """A rule: its uid, the level of its problems, and what it demands."""

    uid: str
    level: str
    description: str


class _FieldRule(NamedTuple):
    """One rule of a field."""

    rule: OsiRule
    field: str
    broken: Callable[[Any, str, _Ids], str | None]


class _Ids:
    """Ids of all things so far, with the message type of each."""

    def __init__(self) -> None:
        self.known: dict[int, str] = {}
        self.here: dict[int, Any] = {}


@cache
def all_osi_rules() -> tuple[OsiRule, ...]:
    """Every rule for traces, by uid."""
    fields = {check.rule.uid: check.rule for rules in _rules().values() for check in rules}
    own = [OsiRule(f"{_OWN}:{name}", level, text) for name, (level, text) in REQUIREMENTS.items()]
    formats = [OsiRule(f"{_FORMAT}.{name}", "error", text) for name, text in _FORMATS.items()]
    readable = OsiRule(READABLE, "error", "The messages of a trace can be read.")
    return tuple(sorted([*fields.values(), *own, *formats, readable], key=lambda rule: rule.uid))


@cache
def _rules() -> dict[str, tuple[_FieldRule, ...]]:
    """The rules of fields by the full name of their message."""
    return {
        f"osi3.{message}": tuple(
            check for field, text in fields.items() for check in _of_field(message, field, text)
        )
        for message, fields in _FIELDS.items()
    }


def _of_field(message: str, field: str, text: str) -> Iterator[_FieldRule]:
    uid = f"{_SOURCE}.{message.lower()}.{field}"
    # The small language of the table: a comma joins rules of one field.
    for part in text.split(", "):
        words = part.split()
        ranged = _RANGE.fullmatch(part)
        if ranged:
            sign, limit = ranged[1], float(ranged[2])
            what = f"{message}.{field} is {sign} {ranged[2]}."
            yield _FieldRule(
                OsiRule(f"{uid}.{_NAMES[sign]}", "error", what), field, _in_range(sign, limit)
            )
        elif words[0] == "set":
            condition = f" where {words[2]} is {words[3]}" if len(words) > 1 else ""
            name = "check_if" if condition else "is_set"
            yield _FieldRule(
                OsiRule(f"{uid}.{name}", "error", f"{message}.{field} is set{condition}."),
                field,
                _is_set(words[2:]),
            )
        elif part == "unique":
            yield _FieldRule(
                OsiRule(
                    f"{uid}.is_globally_unique",
                    "error",
                    f"{message}.{field} is unlike all other ids.",
                ),
                field,
                _is_unique,
            )
        elif part == "country":
            yield _FieldRule(
                OsiRule(f"{uid}.is_iso_country_code", "error",
                    f"{message}.{field} is a numeric code of ISO 3166 (1 to 999)."),
                field, _is_country,
            )  # fmt: skip
        else:
            yield _FieldRule(
                OsiRule(f"{uid}.refers_to", "error", f"{message}.{field} is the id of a {part}."),
                field,
                _refers(part),
            )


def _in_range(sign: str, limit: float) -> Callable[[Any, str, _Ids], str | None]:
    def broken(message: Any, field: str, _ids: _Ids) -> str | None:
        value = getattr(message, field)
        # An unset number reads as 0, which would break limits above it; presence is another rule's.
        good = not message.HasField(field) or _COMPARE[sign](value, limit)
        return None if good else f"{field} is {value:g}, {sign} {limit:g} is expected"

    return broken


def _is_set(condition: list[str]) -> Callable[[Any, str, _Ids], str | None]:
    def broken(message: Any, field: str, _ids: _Ids) -> str | None:
        if message.HasField(field) or (
            condition and getattr(message, condition[0]) != int(condition[1])
        ):
            return None
        return f"{field} is not set" + (
            f", as {condition[0]} {condition[1]} demands" if condition else ""
        )

    return broken


def _is_unique(message: Any, field: str, ids: _Ids) -> str | None:
    number, kind = getattr(message, field).value, message.DESCRIPTOR.name
    if not message.HasField(field):
        return None
    other = ids.here.get(number)
    # By identity: `here` holds the messages, so protobuf gives the same objects again.
    if other is not None and other is not message:
        return f"the id {number} is that of another {other.DESCRIPTOR.name} too"
    if ids.known.get(number, kind) != kind:
        return f"the id {number} was that of a {ids.known[number]} in an earlier message"
    return None


def _is_country(message: Any, field: str, _ids: _Ids) -> str | None:
    value = getattr(message, field)
    return (
        None
        if not message.HasField(field) or 1 <= value <= 999
        else f"{field} is {value}, 1 to 999 is expected"
    )


def _refers(kind: str) -> Callable[[Any, str, _Ids], str | None]:
    def broken(message: Any, field: str, ids: _Ids) -> str | None:
        values = getattr(message, field)
        # Repeated fields have a length, in each implementation of protobuf their own class.
        if not isinstance(values, tuple | list) and not hasattr(values, "__len__"):
            values = [values] if message.HasField(field) else []
        for value in values:
            number = value.value
            # This message first: an id that is used again stands for the newer thing.
            other = (
                ids.here[number].DESCRIPTOR.name if number in ids.here else ids.known.get(number)
            )
            if other != kind:
                return f"{field} {number} is " + (
                    f"the id of a {other}, not of a {kind}" if other else f"of no {kind}"
                )
        return None

    return broken


# going through a trace ----------------------------------------------------------------------


def check_trace(path: Path) -> list[Problem]:
    """Every problem of an OSI trace, by rule; empty for a sound one.

    Raises:
        MissingExtra: the packages for OSI are not installed.
    """
    problems = _ProblemMessages(path)
    trace = Trace(path)
    try:
        if trace.is_mcap:
            _check_format(trace, problems)
        for number, rule, text in breaches(trace.frames()):
            problems.add(rule, text, number)
    except (InvalidFile, Unsupported) as error:
        # What was found before the damage is reported with it.
        problems.add(OsiRule(READABLE, "error", ""), error.message, None)
    return problems.problems()


def breaches(frames: Iterable[TraceMessage]) -> Iterator[tuple[int, OsiRule, str]]:
    """Yield the broken rules of a trace in order: number of the message, rule, fault."""
    ids, requirements = _Ids(), Requirements()
    for frame in frames:
        # Whole nanoseconds: in floats, seconds since 1970 are multiples of 240 ns.
        stamp = frame.message.timestamp.seconds * 1_000_000_000 + frame.message.timestamp.nanos
        if frame.published is not None and frame.published != stamp:
            yield (
                frame.number,
                OsiRule(f"{_FORMAT}.times", "error", _FORMATS["times"]),
                "the publish time is not the timestamp",
            )
        ids.here = {}
        # Before the rules: fields refer to things that come later in the same message.
        _collect(frame.truth, ids.here)
        for where, rule, text in _walk(frame.message, "", ids):
            yield frame.number, rule, f"{where}: {text}" if where else text
        for name, text in requirements.of(frame.truth):
            yield frame.number, OsiRule(f"{_OWN}:{name}", *REQUIREMENTS[name]), text
        # The kind alone: messages themselves would keep a whole trace in memory.
        ids.known |= {number: message.DESCRIPTOR.name for number, message in ids.here.items()}


class _Places(NamedTuple):
    """First and last message with a problem, and their number; each of a million may have it."""

    first: int | None
    last: int | None
    number: int


class _ProblemMessages:
    """Problems, each with the messages that have it."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._places: dict[tuple[OsiRule, str], _Places] = {}

    def add(self, rule: OsiRule, text: str, message: int | None) -> None:
        """Note a problem of a message, or of the file."""
        if message is None:
            self._places.setdefault((rule, text), _Places(None, None, 0))
            return
        places = self._places.get((rule, text), _Places(message, None, 0))
        # Parts of a message without an id have one text: they count once.
        if places.last != message:
            self._places[rule, text] = _Places(places.first, message, places.number + 1)

    def problems(self) -> list[Problem]:
        """One for each rule and text."""
        counts: dict[str, int] = {}
        made = []
        for (rule, text), places in sorted(
            self._places.items(), key=lambda place: (place[0][0].uid, place[1])
        ):
            counts[rule.uid] = counts.get(rule.uid, 0) + 1
            if counts[rule.uid] > MOST:
                continue
            more = f" and {places.number - 1} more" if places.number > 1 else ""
            where = "" if places.first is None else f"message {places.first}{more}: "
            made.append(Problem(rule.uid, rule.level, where + text, str(self._path)))
        for uid, count in counts.items():
            if count > MOST:
                text = f"more problems of this kind than the {MOST} listed"
                made.append(Problem(uid, "info", text, str(self._path)))
        return made


def _collect(message: Any, here: dict[int, Any]) -> None:
    """The things of a message by their ids; of several with one id the first."""
    for field, values in message.ListFields():
        # Things with ids are in repeated fields of the ground truth itself, nowhere deeper.
        if field.message_type is not None and _is_repeated(field):
            for item in values:
                if "id" in item.DESCRIPTOR.fields_by_name and item.HasField("id"):
                    here.setdefault(item.id.value, item)


def _is_repeated(field: Any) -> bool:
    """Whether a field is repeated; the name of the property depends on the version of protobuf."""
    repeated = getattr(field, "is_repeated", None)
    return bool(repeated if repeated is not None else field.label == field.LABEL_REPEATED)


@cache
def _concerned(descriptor: Any) -> bool:
    """Whether a message type, or one inside it, has rules: the others are not gone through."""
    return _has_rules(descriptor, set())


def _has_rules(descriptor: Any, seen: set[str]) -> bool:
    if descriptor.full_name in _rules():
        return True
    seen.add(descriptor.full_name)
    inner = [field.message_type for field in descriptor.fields if field.message_type is not None]
    return any(_has_rules(message, seen) for message in inner if message.full_name not in seen)


def _walk(message: Any, where: str, ids: _Ids) -> Iterator[tuple[str, OsiRule, str]]:
    """Yield the broken rules of a message: field, rule, fault."""
    for rule, field, broken in _rules().get(message.DESCRIPTOR.full_name, ()):
        text = broken(message, field, ids)
        if text is not None:
            yield where, rule, text
    for field, value in message.ListFields():
        if field.message_type is None or not _concerned(field.message_type):
            continue
        for item in value if _is_repeated(field) else (value,):
            named = "id" in item.DESCRIPTOR.fields_by_name and item.HasField("id")
            name = f"{field.name} {item.id.value}" if named else field.name
            yield from _walk(
                item,
                f"{where}, {name}" if where and named else f"{where}.{name}" if where else name,
                ids,
            )


# multi-channel trace files ------------------------------------------------------------------

_FORMATS = {
    "metadata": "The file has one metadata record net.asam.osi.trace with all mandatory entries.",
    "schema": "The schema of an OSI channel has the encoding protobuf.",
    "channel": "An OSI channel has the message encoding protobuf and the mandatory metadata.",
    "chunks": (
        "All messages are in chunks, compressed by nothing, zstd or lz4, and the summary has an "
        "index of the chunks."
    ),
    "times": "The publish time of a message is its timestamp.",
}
_MANDATORY = (
    "version",
    "min_osi_version",
    "max_osi_version",
    "min_protobuf_version",
    "max_protobuf_version",
)
_OF_CHANNELS = (
    "net.asam.osi.trace.channel.osi_version",
    "net.asam.osi.trace.channel.protobuf_version",
)
_VERSION = re.compile(r"\d+\.\d+\.\d+")


def _check_format(trace: Trace, problems: _ProblemMessages) -> None:
    contents = trace.contents

    def add(name: str, text: str) -> None:
        problems.add(OsiRule(f"{_FORMAT}.{name}", "error", _FORMATS[name]), text, None)

    records = [values for name, values in contents.metadata if name == TRACE]
    if len(records) != 1:
        add("metadata", f"there are {len(records)} metadata records {TRACE}, one is expected")
    for values in records[:1]:
        for key in _MANDATORY:
            if not _VERSION.fullmatch(values.get(key, "")):
                add(
                    "metadata",
                    f"{key} of {TRACE} is {values.get(key)!r}, a version like 3.8.0 is expected",
                )
    for channel in contents.channels.values():
        if not channel.schema.startswith("osi3."):
            continue
        if channel.encoding != "protobuf":
            add(
                "schema",
                f"the schema of channel {channel.topic!r} has the encoding {channel.encoding!r}",
            )
        if channel.message_encoding != "protobuf":
            add(
                "channel",
                f"channel {channel.topic!r} has the message encoding {channel.message_encoding!r}",
            )
        for key in _OF_CHANNELS:
            if not _VERSION.fullmatch(channel.metadata.get(key, "")):
                add("channel", f"channel {channel.topic!r} has no {key} like 3.8.0")
    if contents.unchunked:
        add("chunks", f"{contents.unchunked} messages are outside of chunks")
    if not contents.indexed:
        add("chunks", "the summary has no index of all chunks")


# requirements of the text of the messages -------------------------------------------------------


REQUIREMENTS = {
    "timestamp.ascends": ("error", "The timestamps of a trace ascend."),
    "values.are_finite": ("error", "Positions, angles, velocities and dimensions are numbers."),
    "orientation.in_range": ("warning", "Angles are from -pi to pi."),
    "object.is_complete": ("warning", ("Objects have dimensions and pose; moving ones velocity, "
                                      "acceleration and rates too.")),
    "object.type_is_known": ("warning", "The type of an object is not unknown in ground truth."),
    "vehicle.classification": ("warning",
        "Vehicles alone have a classification, which is not unknown, and bbcenter_to_rear."),
    "host.is_there": ("warning", ("The host vehicle is on the lanes that are marked "
                                 "as the host vehicle's.")),
    "assigned_lane.is_there": ("warning", "Assigned lanes are lanes of the trace."),
    "lane.is_complete": ("warning", ("Lanes have a type, a centre line, boundaries on both sides, "
                                    "or free ones in intersections.")),
    "lane.references": ("warning", "Neighbours and boundaries of a lane are in the trace."),
    "lane.begins_at_antecessor": ("warning",
        "The centre line of a lane begins where that of its antecessor ends."),
    "lane_boundary.is_complete": ("warning",
        "Boundaries have a type, a colour, two points or more, and belong to a lane."),
}  # fmt: skip
"""Level and description by name"""
NEAR = 0.05
"""Distance (m) up to which points are the same"""
_MOVING = ("dimension", "position", "orientation", "velocity", "acceleration", "orientation_rate")
_ROUND = 1e-9

Finding = tuple[str, str]


class Requirements:
    """Checks of the messages of one trace, in their order."""

    def __init__(self) -> None:
        self._before: int | None = None
        self._lanes: dict[int, Any] = {}
        self._boundaries: set[int] = set()

    def of(self, truth: Any) -> Iterator[Finding]:
        """Yield the broken requirements of a message: name and fault."""
        now = truth.timestamp.seconds * 1_000_000_000 + truth.timestamp.nanos
        if self._before is not None and now <= self._before:
            yield "timestamp.ascends", "the timestamp does not ascend"
        self._before = now
        # Added up over messages: what does not change may be in the first ones alone.
        self._lanes |= {lane.id.value: lane.classification for lane in truth.lane}
        self._boundaries |= {boundary.id.value for boundary in truth.lane_boundary}
        for body in truth.stationary_object:
            name = f"stationary_object {body.id.value}"
            yield from _base(body.base, _MOVING[:3], name)
            if not body.classification.type:
                yield "object.type_is_known", f"{name}: the type is unknown"
        for body in truth.moving_object:
            yield from self._moving(body)
        yield from self._roads(truth)

    def _moving(self, body: Any) -> Iterator[Finding]:
        name = f"moving_object {body.id.value}"
        yield from _base(body.base, _MOVING, name)
        if not body.type:
            yield "object.type_is_known", f"{name}: the type is unknown"
        is_vehicle = body.type == body.TYPE_VEHICLE
        if body.HasField("vehicle_classification") != is_vehicle or (
            is_vehicle and not body.vehicle_classification.type
        ):
            yield (
                "vehicle.classification",
                f"{name}: vehicle_classification is missing, unknown, or of no vehicle",
            )
        if is_vehicle and not body.vehicle_attributes.HasField("bbcenter_to_rear"):
            yield "vehicle.classification", f"{name}: bbcenter_to_rear is not set"
        for lane in body.moving_object_classification.assigned_lane_id:
            if lane.value not in self._lanes:
                yield (
                    "assigned_lane.is_there",
                    f"{name}: the assigned lane {lane.value} is not in the trace",
                )

    def _roads(self, truth: Any) -> Iterator[Finding]:
        used: set[int] = set()
        for message in truth.lane:
            lane, name = message.classification, f"lane {message.id.value}"
            yield from _lane(lane, name)
            beside = (*lane.left_adjacent_lane_id, *lane.right_adjacent_lane_id)
            sides = (
                *lane.left_lane_boundary_id,
                *lane.right_lane_boundary_id,
                *lane.free_lane_boundary_id,
            )
            used |= {one.value for one in sides}
            for number in (one.value for one in beside if one.value not in self._lanes):
                yield "lane.references", f"{name}: the neighbour {number} is not in the trace"
            for number in (one.value for one in sides if one.value not in self._boundaries):
                yield "lane.references", f"{name}: the boundary {number} is not in the trace"
            yield from self._joined(lane, name)
        for boundary in truth.lane_boundary:
            yield from _boundary(boundary)
            if boundary.id.value not in used:
                yield (
                    "lane_boundary.is_complete",
                    f"lane_boundary {boundary.id.value}: no lane has it",
                )
        marked = {lane.id.value for lane in truth.lane if lane.classification.is_host_vehicle_lane}
        host = {
            one.value
            for vehicle in truth.moving_object
            if truth.HasField("host_vehicle_id") and vehicle.id.value == truth.host_vehicle_id.value
            for one in vehicle.moving_object_classification.assigned_lane_id
        }
        # Messages without lanes say nothing about marks.
        if truth.lane and marked != host:
            yield (
                "host.is_there",
                (
                    "lanes with is_host_vehicle_lane are not those that the host "
                    "vehicle is assigned to"
                ),
            )

    def _joined(self, lane: Any, name: str) -> Iterator[Finding]:
        if lane.type == lane.TYPE_INTERSECTION or not lane.centerline:
            return
        for pair in lane.lane_pairing:
            before = (
                self._lanes.get(pair.antecessor_lane_id.value)
                if pair.HasField("antecessor_lane_id")
                else None
            )
            # OSI gives intersections no centre lines: neither end can be compared there.
            if before is None or before.type == before.TYPE_INTERSECTION or not before.centerline:
                continue
            end, start = before.centerline[-1], lane.centerline[0]
            if math.dist((end.x, end.y), (start.x, start.y)) > NEAR:
                yield (
                    "lane.begins_at_antecessor",
                    f"{name}: it does not begin where lane {pair.antecessor_lane_id.value} ends",
                )


def _base(base: Any, fields: Iterable[str], name: str) -> Iterator[Finding]:
    for field in fields:
        axes = {"dimension": ("length", "width", "height")}.get(field, ("x", "y", "z"))
        axes = ("roll", "pitch", "yaw") if field.startswith("orientation") else axes
        value = getattr(base, field)
        if not base.HasField(field) or not all(value.HasField(axis) for axis in axes):
            yield "object.is_complete", f"{name}: {field} is not set in full"
        values = [getattr(value, axis) for axis in axes]
        if not all(map(math.isfinite, values)):
            yield "values.are_finite", f"{name}: {field} is no number"
        elif field == "orientation" and max(map(abs, values)) > math.pi + _ROUND:
            yield "orientation.in_range", f"{name}: an angle is not from -pi to pi"


def _lane(lane: Any, name: str) -> Iterator[Finding]:
    def incomplete(text: str) -> Finding:
        return "lane.is_complete", f"{name}: {text}"

    if not lane.type:
        yield incomplete("the type is unknown")
    driving = lane.type == lane.TYPE_DRIVING
    if driving and not lane.HasField("centerline_is_driving_direction"):
        yield incomplete("centerline_is_driving_direction is not set")
    if driving and len(lane.centerline) < 2:
        yield incomplete("the centre line has less than two points")
    sides, free = (
        (*lane.left_lane_boundary_id, *lane.right_lane_boundary_id),
        tuple(lane.free_lane_boundary_id),
    )
    if lane.type == lane.TYPE_INTERSECTION:
        if lane.left_adjacent_lane_id or lane.right_adjacent_lane_id or sides or not free:
            yield incomplete(
                "intersections have free boundaries, and neither neighbours nor boundaries of sides"
            )
    elif free or not (lane.left_lane_boundary_id and lane.right_lane_boundary_id):
        yield incomplete("lanes have a left and a right boundary, and no free ones")


def _boundary(boundary: Any) -> Iterator[Finding]:
    kind, name = boundary.classification, f"lane_boundary {boundary.id.value}"
    if not kind.type or not kind.color:
        yield "lane_boundary.is_complete", f"{name}: the type or colour is unknown"
    unpainted = kind.type in (
        kind.TYPE_NO_LINE,
        kind.TYPE_ROAD_EDGE,
        kind.TYPE_CURB,
        kind.TYPE_GRASS_EDGE,
    )
    if kind.color and unpainted != (kind.color == kind.COLOR_NONE):
        yield (
            "lane_boundary.is_complete",
            f"{name}: the colour is none exactly where nothing is painted",
        )
    if len(boundary.boundary_line) < 2:
        yield "lane_boundary.is_complete", f"{name}: there are less than two points"
    if any(
        not point.HasField("position") or point.width < 0.0 or point.height < 0.0
        for point in boundary.boundary_line
    ):
        yield (
            "lane_boundary.is_complete",
            f"{name}: a point has no position, or a width or height below 0",
        )
