"""Target `osi`: the run as a trace of ASAM OSI GroundTruth messages, in the `.osi` and `.mcap`
formats. Needs the extra `osi`.

Sources: ASAM OSI 3.8, GroundTruth, "trace file formats", TrafficCommand and TrafficUpdate.
Positions are those of the bounding box's centre, angles and rates those of the world frame, as OSI
asks for; the OpenSCENARIO reference point is in `bbcenter_to_rear`. Every message has the lanes
around (`runner.exchange.exports.osi_lanes`); the whole road network is in the file that
`map_reference` names.

In `.mcap` the ego has channels of its own, for models of traffic participants. A TrafficCommand is
sent once, when the ego appears: to follow the trajectory that it drove, by time and place. The
TrafficUpdates are what a model that does so answers: the dynamic fields of the ego's MovingObject.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from runner.exchange.exports.moments import box_centre, date, moments, rate, stands, wrapped
from runner.exchange.exports.osi_lanes import LogicalLanes, Nearby, around
from runner.exchange.exports.osi_signals import Signals, VehicleLights
from runner.systems.outside.osi.lanes import Lanes
from runner.systems.outside.osi.messages import Osi, fill_base, fill_frame, fill_lights, fill_type
from schemas.common.errors import UsageError
from schemas.common.fates import changed, kept, lost
from schemas.common.packages import optional, version
from schemas.common.storage import drafted, writing

if TYPE_CHECKING:
    from runner.batch.jobs import Job, Outcome
    from runner.judging.result import RunResult
    from runner.recording import Track
    from xosc.exports.draft import Folder


COMMAND, UPDATE = "traffic_command", "traffic_update"
"""Topics of the two channels"""
_DYNAMIC = ("position", "orientation", "velocity", "acceleration", "orientation_rate")


def message_types() -> dict[str, Any]:
    """The message type of each channel by its topic."""
    return {
        COMMAND: optional("osi3.osi_trafficcommand_pb2").TrafficCommand,
        UPDATE: optional("osi3.osi_trafficupdate_pb2").TrafficUpdate,
    }


def _by_position(action: Any) -> int:
    """The following mode that keeps to times and places."""
    number: int = (
        action.DESCRIPTOR.fields_by_name["following_mode"]
        .enum_type.values_by_name["FOLLOWING_MODE_POSITION"]
        .number
    )
    return number


def host_of(truth: Any) -> tuple[Any, Any] | None:
    """Timestamp and host vehicle of a GroundTruth; None where the host is not there."""
    if not truth.HasField("host_vehicle_id"):
        return None
    found = (
        vehicle
        for vehicle in truth.moving_object
        if vehicle.id.value == truth.host_vehicle_id.value
    )
    return next(((truth.timestamp, host) for host in found), None)


def traffic(osi: Osi, hosts: Sequence[tuple[Any, Any]]) -> Iterator[tuple[str, Any]]:
    """The command and the updates of the host vehicle, each with its topic; nothing without a host.

    Args:
        hosts: what `host_of` gives of all messages.
    """
    if not hosts:
        return
    types, (start, ego) = message_types(), hosts[0]
    command = types[COMMAND](
        version=osi.interface_version, timestamp=start, traffic_participant_id=ego.id
    )
    action = command.action.add().follow_trajectory_action
    action.action_header.action_id.value = 0
    action.constrain_orientation, action.following_mode = True, _by_position(action)
    for time, host in hosts:
        action.trajectory_point.add(
            timestamp=time, position=host.base.position, orientation=host.base.orientation
        )
    yield COMMAND, command
    for time, host in hosts:
        update = types[UPDATE](version=osi.interface_version, timestamp=time)
        entry = update.update.add(id=host.id)
        for field in _DYNAMIC:
            getattr(entry.base, field).CopyFrom(getattr(host.base, field))
        yield UPDATE, update


_BESIDE = "the road file beside the trace has them"
FATES = {
    "name": kept("`source_reference`"), "kind": kept("`type`"),
    "category": changed("kinds that OSI has not are other; motorbike is a type of its own"),
    "role": kept("`role`"),
    "length and width": kept("`dimension`"), "height of the box": kept("`dimension`"),
    "box about the reference point": kept("`bbcenter_to_rear`, `_root`"),
    "front axle": kept("`bbcenter_to_front`"),
    "mass": lost("OSI has no mass"), "ego": kept("`host_vehicle_id`"), "time": kept("`timestamp`"),
    "position": kept("box centre"), "height": kept("box centre"), "heading": kept("`yaw`"),
    "pitch": kept("`pitch`"),
    "roll": kept("`roll`"), "speed": changed("velocities, accelerations and rates are finite "
                                             "differences of the box centre"),
    "acceleration": changed("velocities, accelerations and rates are finite "
                            "differences of the box centre"),
    "place on the road": changed("of the box centre, in the logical lane "
                                 "(`logical_lane_assignment`)"),
    "lights": changed("OSI has no daytime running lights and fog lights of their own blinking: "
                      "others have on, off and other"),
    "events": lost("ground truth is what is there"),
    "verdict": lost("ground truth is what is there"),
    "criticality": lost("ground truth is what is there"),
    "tags": lost("ground truth is what is there"),
    "projection": kept("`proj_string`"), "offset": kept("`proj_frame_offset`"),
    "lane borders": kept("`lane_boundary`"),
    "road heights": kept("z of boundaries"), "lane heights": kept("z of boundaries"),
    "lane types": kept("`logical_lane`"),
    "speed limits": kept("`traffic_rule`"),
    "road marks": changed("double lines are single; colours that OSI has not are other"),
    "lane links": kept("`successor_lane`"), "neighbours": kept("`left_adjacent_lane`, `right_…`"),
    "junctions": changed("all lanes of a junction are one lane of type intersection"),
    "signs": kept("`traffic_sign`"),
    "traffic lights": kept("`traffic_light`, one a lamp"), "light states": kept("`mode`"),
    "objects": lost(_BESIDE),
}  # fmt: skip
"""Fates of `runner.exchange.exports.RUN_FIELDS`; of roads those of lanes within 200 m of the
participants' ways"""

TARGETS = {"osi": "ASAM OSI ground-truth traces, .osi and .mcap"}
FORMATS = (".osi", ".mcap")


def export(result: RunResult, name: str, folder: Folder) -> list[str]:
    """Write the trace of a run in both formats, named as the standard names traces, and the road
    file that it names.

    Raises:
        UsageError: the packages for it are not installed, or a file is in the way.
    """
    for suffix in FORMATS:
        folder.write_by(trace_name(result, name, suffix), partial(write_trace, result))
    if (network := result.recording.network) is not None:
        folder.copy(network.path, network.path.name)  # which `map_reference` names
    return []


def trace_name(result: RunResult, name: str, suffix: str) -> str:
    """A trace's name as OSI wants it: start, message type, versions of OSI and protobuf, number of
    frames, own name.

    The start is the date of the scenario's FileHeader, so that the same run always gives the same
    name.
    """
    osi = Osi()
    own = "".join(c if c.isalnum() or c in "-~" else "-" for c in name)
    frames = sum(1 for _ in moments(result.recording))
    when = "".join(c for c in date(result) if c not in "-:")
    numbers = [".".join(text.split(".")[:3]) for text in (osi.osi_version, osi.protobuf_version)]
    kind = "multi" if suffix == ".mcap" and result.ego is not None else "gt"
    return f"{when}Z_{kind}_{numbers[0]}_{numbers[1]}_{frames}_{own}{suffix}"


def write_trace(result: RunResult, path: Path) -> None:
    """Write the trace of a run into a file, `.osi` or `.mcap`, whole or not at all.

    Raises:
        UsageError: the packages for it are not installed, or the file can't be written.
    """
    osi = Osi()
    writer = osi.single() if path.suffix == ".osi" else osi.multi()
    metadata = {
        "version": version(),
        **dict.fromkeys(("min_osi_version", "max_osi_version"), osi.osi_version),
        **dict.fromkeys(("min_protobuf_version", "max_protobuf_version"), osi.protobuf_version),
        **dict.fromkeys(("zero_time", "creation_time"), f"{date(result)}Z"),
        "description": result.scenario.name,
        "authors": "xosc-toolchain",
        "data_sources": "simulation",
    }
    with writing("the trace", path), drafted(path) as draft:
        draft.open("wb").close()  # the writer would print why it can't, and not say
        _write(writer, result, draft, metadata, path)


def _write(
    writer: Any, result: RunResult, draft: Path, metadata: dict[str, str], path: Path
) -> None:
    osi = Osi()
    if not writer.open(draft, metadata=metadata):
        raise UsageError("the trace can't be written", path=path)
    multi = path.suffix == ".mcap"

    def add_channel(topic: str, kind: Any, description: str) -> None:
        about = {
            "osi_version": osi.osi_version,
            "protobuf_version": osi.protobuf_version,
            "description": description,
        }
        writer.add_channel(
            topic, kind, {f"net.asam.osi.trace.channel.{key}": text for key, text in about.items()}
        )

    try:
        if multi:
            add_channel("ground_truth", osi.groundtruth.GroundTruth, "ground truth of the run")
            for topic, kind in message_types().items() if result.ego is not None else ():
                add_channel(topic, kind, f"{topic.replace('_', ' ')} of the ego")
        hosts = []
        for message in ground_truths(result):
            writer.write_message(message, "ground_truth")
            host = host_of(message) if multi else None
            hosts += [host] if host is not None else []
        # After the ground truth: the command has the whole way of the ego.
        for topic, message in traffic(osi, hosts):
            writer.write_message(message, topic)
    finally:
        writer.close()


def alone(jobs: Iterable[Job | Outcome], path: Path) -> Iterator[Job | Outcome]:
    """The only job; several are refused, since all would write into one file.

    Raises:
        UsageError: there are more; the file is of another format; the packages for it are not
            installed.
    """
    Osi()
    if path.suffix not in FORMATS:
        raise UsageError(f"an OSI trace ends in {' or '.join(FORMATS)}", path=path)
    for number, job in enumerate(jobs):
        if number:
            raise UsageError(
                "one trace is of one run; xosc-export --to osi writes those of many", path=path
            )
        yield job


def ground_truths(result: RunResult) -> Iterator[Any]:
    """The run as GroundTruth messages, one for each of its times."""
    osi = Osi()
    tracks = list(result.recording.tracks.values())
    tables = [_table(track) for track in tracks]
    standing = [stands(track) for track in tracks]
    network = result.recording.network
    nearby = Nearby(result.recording)
    near = around(network, nearby) if network is not None else []
    # Participants have the first ids, then lanes, then signals: ids are unique in a message.
    lanes = Lanes(network, near, len(tracks)) if network is not None else None
    logical = (
        LogicalLanes(network, near, lanes.id, lanes.next_id)
        if network is not None and lanes is not None
        else None
    )
    signals = None
    if network is not None and lanes is not None and logical is not None:
        signals = Signals(network, nearby.has, lanes.id, result.events, logical.next_id)
    lamps = VehicleLights(result.events)
    assigned = [logical.assignments(track) if logical is not None else [] for track in tracks]
    on = [
        lanes.of(track) if lanes is not None else [None] * len(track.columns["time"])
        for track in tracks
    ]
    for time, there in moments(result.recording):
        message = osi.groundtruth.GroundTruth()
        osi.stamp(message, time)
        if network is not None:
            fill_frame(message, network)
        host = next(
            (on[number][row] for number, row in there if tracks[number].name == result.ego), None
        )
        if lanes is not None:
            lanes.fill(message, host)
        if logical is not None:
            logical.fill(message)
        if signals is not None:
            signals.fill(message, time)
        for number, row in there:
            track = tracks[number]
            body = (
                message.stationary_object.add() if standing[number] else message.moving_object.add()
            )
            body.id.value = number
            source = body.source_reference.add()
            source.type, source.reference = "net.asam.openscenario", result.scenario.name
            source.identifier.append(track.name)
            fill_base(body.base, track.box, tables[number][row], not standing[number])
            if standing[number]:
                body.classification.type = osi.objects.StationaryObject.Classification.TYPE_OTHER
            else:
                fill_type(body, track, osi, track.role)
                if modes := lamps.at(track.name, time):
                    fill_lights(body.vehicle_classification.light_state, modes, track.role)
                if (lane := on[number][row]) is not None:
                    body.moving_object_classification.assigned_lane_id.add(value=lane)
                # Off all lanes there is no assignment.
                if logical is not None and (place := assigned[number][row]) is not None:
                    _assign(body.moving_object_classification.logical_lane_assignment.add(), place)
            if track.name == result.ego:
                message.host_vehicle_id.value = number
        yield message


def _assign(assignment: Any, place: tuple[int, float, float, float]) -> None:
    (
        assignment.assigned_lane_id.value,
        assignment.s_position,
        assignment.t_position,
        assignment.angle_to_lane,
    ) = place


def _table(track: Track) -> list[list[float]]:
    """One row for each of the track's: position, yaw, pitch, roll, velocity, acceleration, yaw,
    pitch and roll rate."""
    columns, time, centre = track.columns, track.columns["time"], box_centre(track)
    # Rates need continuous angles: a jump from π to -π would be one.
    angles = np.column_stack(
        [np.unwrap(columns[name].astype(float)) for name in ("h", "pitch", "roll")]
    )
    velocity = rate(centre, time)
    return np.hstack(
        [centre, wrapped(angles), velocity, rate(velocity, time), rate(angles, time)]
    ).tolist()
