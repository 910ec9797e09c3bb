"""The ego of a run as OSI's traffic messages: what it is commanded, and how it moves, for models of traffic participants.

Source: ASAM OSI 3.8, TrafficCommand and TrafficUpdate. The command is sent once, when the ego appears: to follow the trajectory
that it drove, by time and place. The updates are what a model that does so answers: the dynamic fields of the ego's MovingObject.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from runner.exports.osi_objects import Osi
from schemas.common.packages import optional

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
    number: int = action.DESCRIPTOR.fields_by_name["following_mode"].enum_type.values_by_name["FOLLOWING_MODE_POSITION"].number
    return number


def host_of(truth: Any) -> tuple[Any, Any] | None:
    """Timestamp and host vehicle of a GroundTruth; None where the host is not there."""
    if not truth.HasField("host_vehicle_id"):
        return None
    found = (each for each in truth.moving_object if each.id.value == truth.host_vehicle_id.value)
    return next(((truth.timestamp, each) for each in found), None)


def traffic(osi: Osi, hosts: Sequence[tuple[Any, Any]]) -> Iterator[tuple[str, Any]]:
    """The command and the updates of the host vehicle, each with its topic; nothing without a host.

    Args:
        hosts: what `host_of` gives of all messages.
    """
    if not hosts:
        return
    types, (start, ego) = message_types(), hosts[0]
    command = types[COMMAND](version=osi.interface_version, timestamp=start, traffic_participant_id=ego.id)
    action = command.action.add().follow_trajectory_action
    action.action_header.action_id.value = 0
    action.constrain_orientation, action.following_mode = True, _by_position(action)
    for time, host in hosts:
        action.trajectory_point.add(timestamp=time, position=host.base.position, orientation=host.base.orientation)
    yield COMMAND, command
    for time, host in hosts:
        update = types[UPDATE](version=osi.interface_version, timestamp=time)
        each = update.update.add(id=host.id)
        for field in _DYNAMIC:
            getattr(each.base, field).CopyFrom(getattr(host.base, field))
        yield UPDATE, update
