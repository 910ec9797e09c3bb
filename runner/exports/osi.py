"""Target `osi`: the run as a trace of ASAM OSI GroundTruth messages, in the `.osi` and `.mcap` formats.

Source: ASAM OSI 3.8, GroundTruth and "trace file formats". Positions are those of the bounding box's centre, angles and
rates those of the world frame, as OSI asks for; the OpenSCENARIO reference point is in `bbcenter_to_rear`. Every message has
the lanes around (`runner.exports.osi_lanes` and `runner.exports.osi_logical`); the
whole road network is in the file that `map_reference` names. In `.mcap` the ego has channels of its own
(`runner.exports.osi_traffic`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from runner.exports.moments import box_centre, date, moments, rate, stands, wrapped
from runner.exports.osi_lanes import Lanes, around
from runner.exports.osi_logical import LogicalLanes
from runner.exports.osi_objects import Osi, fill_base, fill_type
from runner.exports.osi_traffic import host_of, message_types, traffic
from schemas.common.errors import UsageError
from schemas.common.packages import version
from schemas.common.storage import drafted, writing

if TYPE_CHECKING:
    from runner.batch.jobs import Job, Outcome
    from runner.interpreter.result import RunResult
    from runner.recording import Track
    from xosc.exports.folder import Folder

TARGETS = {"osi": "ASAM OSI ground-truth traces, .osi and .mcap"}
FORMATS = (".osi", ".mcap")


def export(result: RunResult, name: str, folder: Folder) -> list[str]:
    """Write the trace of a run in both formats, named as the standard names traces.

    Raises:
        UsageError: the packages for it are not installed, or a file is in the way.
    """
    for suffix in FORMATS:
        folder.write_by(trace_name(result, name, suffix), partial(write_trace, result))
    return []


def trace_name(result: RunResult, name: str, suffix: str) -> str:
    """A trace's name as OSI wants it: start, message type, versions of OSI and protobuf, number of frames, own name.

    The start is the date of the scenario's FileHeader, so that the same run always gives the same name.
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


def _write(writer: Any, result: RunResult, draft: Path, metadata: dict[str, str], path: Path) -> None:
    osi = Osi()
    if not writer.open(draft, metadata=metadata):
        raise UsageError("the trace can't be written", path=path)
    multi = path.suffix == ".mcap"

    def add_channel(topic: str, kind: Any, description: str) -> None:
        about = {"osi_version": osi.osi_version, "protobuf_version": osi.protobuf_version, "description": description}
        writer.add_channel(topic, kind, {f"net.asam.osi.trace.channel.{key}": text for key, text in about.items()})

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
        for topic, message in traffic(osi, hosts):
            writer.write_message(message, topic)
    finally:
        writer.close()


def alone(jobs: Iterable[Job | Outcome], path: Path) -> Iterator[Job | Outcome]:
    """The jobs, of which only one may be: all would write their trace into the same file.

    Raises:
        UsageError: there are more; the file is of another format; the packages for it are not installed.
    """
    Osi()
    if path.suffix not in FORMATS:
        raise UsageError(f"an OSI trace ends in {' or '.join(FORMATS)}", path=path)
    for number, job in enumerate(jobs):
        if number:
            raise UsageError("one trace is of one run; xosc-export --to osi writes those of many", path=path)
        yield job


def ground_truths(result: RunResult) -> Iterator[Any]:
    """The run as GroundTruth messages, one for each of its times."""
    osi = Osi()
    tracks = list(result.recording.tracks.values())
    tables = [_table(track) for track in tracks]
    standing = [stands(track) for track in tracks]
    network = result.recording.network
    near = around(network, result.recording) if network is not None else []
    lanes = Lanes(network, near, len(tracks)) if network is not None else None
    logical = LogicalLanes(network, near, lanes.id, lanes.next_id) if network is not None and lanes is not None else None
    assigned = [logical.assignments(track) if logical is not None else [] for track in tracks]
    on = [lanes.of(track) if lanes is not None else [None] * len(track.columns["time"]) for track in tracks]
    for time, there in moments(result.recording):
        message = osi.groundtruth.GroundTruth()
        osi.stamp(message, time)
        if network is not None:
            message.map_reference = network.path.name
            message.proj_string = network.geo_reference or ""
        host = next((on[number][row] for number, row in there if tracks[number].name == result.ego), None)
        if lanes is not None:
            lanes.fill(message, host)
        if logical is not None:
            logical.fill(message)
        for number, row in there:
            track = tracks[number]
            each = message.stationary_object.add() if standing[number] else message.moving_object.add()
            each.id.value = number
            source = each.source_reference.add()
            source.type, source.reference = "net.asam.openscenario", result.scenario.name
            source.identifier.append(track.name)
            fill_base(each.base, track.box, tables[number][row], not standing[number])
            if standing[number]:
                each.classification.type = osi.objects.StationaryObject.Classification.TYPE_OTHER
            else:
                fill_type(each, track, osi)
                if (lane := on[number][row]) is not None:
                    each.moving_object_classification.assigned_lane_id.add(value=lane)
                if logical is not None and (place := assigned[number][row]) is not None:
                    _assign(each.moving_object_classification.logical_lane_assignment.add(), place)
            if track.name == result.ego:
                message.host_vehicle_id.value = number
        yield message


def _assign(assignment: Any, place: tuple[int, float, float, float]) -> None:
    assignment.assigned_lane_id.value, assignment.s_position, assignment.t_position, assignment.angle_to_lane = place


def _table(track: Track) -> list[list[float]]:
    """One row for each of the track's: position, yaw, pitch, roll, velocity, acceleration, yaw, pitch and roll rate."""
    columns, time, centre = track.columns, track.columns["time"], box_centre(track)
    angles = np.column_stack([np.unwrap(columns[name].astype(float)) for name in ("h", "pitch", "roll")])
    velocity = rate(centre, time)
    return np.hstack([centre, wrapped(angles), velocity, rate(velocity, time), rate(angles, time)]).tolist()
