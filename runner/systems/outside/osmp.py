"""OSI messages of an ego driven from outside: ground truth of observations, sensor views and
answers of OSMP.

Needs the extra `osi`.

Source: ASAM OSI Sensor Model Packaging 1.5; osi_trafficupdate.proto and osi_motionrequest.proto of
OSI 3. A TrafficUpdate has the middle of the bounding box, a MotionRequest that of the rear axle,
which is the reference point here.
"""

from __future__ import annotations

import math
from typing import Any

from runner.engine.motion.placement import wrap
from runner.systems.base import Observation, Participant, Pose
from runner.systems.outside.osi.lanes import Lanes
from runner.systems.outside.osi.messages import Osi, fill_base, fill_frame, fill_lights, fill_type
from schemas.common.errors import ToolchainError
from schemas.common.packages import optional
from xodr.graph.network import RoadNetwork
from xodr.lookup.lanelets import lanelets
from xodr.model import RoadPoint


class Truth:
    """Messages of one run; an entity keeps its id.

    The first message also has the lanes and lane boundaries of all roads, which do not change; all
    messages have the participants, each with the lane that it is on. Rates of angles are those
    since the message before.
    """

    def __init__(self) -> None:
        self._osi = Osi()
        self._lanes: Lanes | None = None
        self._ids: dict[str, int] = {}
        self._hints: dict[str, RoadPoint] = {}
        self._before: dict[str, tuple[float, Participant]] = {}
        self._begun = False

    def of(self, observation: Observation) -> Any:
        """The GroundTruth of an instant; the ego is the host vehicle."""
        message, network = self._osi.groundtruth.GroundTruth(), observation.network
        self._osi.stamp(message, observation.time)
        if network is not None:
            fill_frame(message, network)
        first, self._begun = not self._begun, True
        if first and network is not None:
            self._lanes = Lanes(network, lanelets(network).values(), 0)
        for one in (observation.ego, *observation.others):
            lane = self._add(message.moving_object.add(), one, observation.time, network)
            if one is observation.ego:
                message.host_vehicle_id.value = self._id(one)
                if first and self._lanes is not None:
                    self._lanes.fill(message, lane)
        return message

    def _id(self, one: Participant) -> int:
        # Ids are unique in a GroundTruth: participants are numbered after lanes and boundaries.
        return self._ids.setdefault(
            one.name, (self._lanes.next_id if self._lanes else 0) + len(self._ids)
        )

    def _add(
        self, each: Any, one: Participant, time: float, network: RoadNetwork | None
    ) -> int | None:
        """Fill a MovingObject; the id of the lane that it is on."""
        each.id.value = self._id(one)
        source = each.source_reference.add()
        source.type = "net.asam.openscenario"
        source.identifier.append(one.name)
        fill_base(each.base, one.box, self._values(one, time), True)
        fill_type(each, one, self._osi)
        if one.kind == "vehicle" and one.lights:
            fill_lights(each.vehicle_classification.light_state, one.lights)
        self._before[one.name] = time, one
        if network is None or self._lanes is None:
            return None
        point = network.locate(one.x, one.y, one.z, one.h, self._hints.get(one.name))
        # A hint keeps the search near: after a jump the whole network is looked at.
        if not network.on_road(point):
            point = network.locate(one.x, one.y, one.z, one.h)
        self._hints[one.name] = point
        lane = self._lanes.at(point.road_id, point.lane_id, point.s)
        if lane is not None:
            each.moving_object_classification.assigned_lane_id.add(value=lane)
        return lane

    def _values(self, one: Participant, time: float) -> list[float]:
        """Values of the middle of the participant's box: see `fill_base`."""
        then, before = self._before.get(one.name, (time, one))
        dt = time - then
        rates = [
            wrap(now - was) / dt if dt else 0.0
            for now, was in zip(_angles(one), _angles(before), strict=True)
        ]
        x, y, z = _turned(one, one.box.x, one.box.y, one.box.z)
        return [
            *(one.x + x, one.y + y, one.z + z),
            *_angles(one),
            # The box's middle turns about the reference point: ω × r is added to its velocity.
            *(one.vx - rates[0] * y, one.vy + rates[0] * x, 0.0),
            *(one.ax, one.ay, 0.0),
            *rates,
        ]


def _angles(one: Participant) -> tuple[float, float, float]:
    return wrap(one.h), one.pitch, one.roll


def _turned(one: Participant, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A vector (m) of a participant's own frame in the world's: roll, then pitch, then heading (ISO
    8855)."""
    (ch, cp, cr), (sh, sp, sr) = (
        tuple(map(turn, (one.h, one.pitch, one.roll))) for turn in (math.cos, math.sin)
    )
    y, z = y * cr - z * sr, y * sr + z * cr
    x, z = x * cp + z * sp, z * cp - x * sp
    return x * ch - y * sh, x * sh + y * ch, z


VIEW, GROUND_TRUTH, SENSOR_DATA = "OSMPSensorViewIn", "OSMPGroundTruthInit", "OSMPSensorDataIn"
UPDATE, REQUEST = "OSMPTrafficUpdateOut", "OSMPMotionRequestOut"
_MOVING = ("timestamp", "host_vehicle_id", "moving_object")
"""Fields of a GroundTruth that change from step to step"""
_NANO = 1e-9
_SOON = 1e-6
"""Time (s) by which a trajectory may begin too late or end too early"""


class SensorViews:
    """Sensor views of one run, with the ego as host vehicle.

    Args:
        initialised: whether the roads are in a message of their own (`static`), and so in none of
            these.
    """

    def __init__(self, initialised: bool) -> None:
        self._truth, self._initialised = Truth(), initialised
        self._roads: Any = None
        self._encoded = b""

    def static(self, observation: Observation) -> bytes:
        """Return a GroundTruth with the roads."""
        return bytes(self._static(observation).SerializeToString(deterministic=True))

    def of(self, observation: Observation) -> bytes:
        """Return the SensorView of an instant."""
        roads, truth = self._static(observation), self._truth.of(observation)
        view = optional("osi3.osi_sensorview_pb2").SensorView()
        # Roads are encoded once: they stay the same in all messages.
        if not (self._initialised or self._encoded):
            view.global_ground_truth.CopyFrom(roads)
            self._encoded = view.SerializeToString(deterministic=True)
            view.Clear()
        view.version.CopyFrom(roads.version)
        view.timestamp.CopyFrom(truth.timestamp)
        view.sensor_id.value = 0
        view.host_vehicle_id.CopyFrom(truth.host_vehicle_id)
        view.global_ground_truth.CopyFrom(truth)
        message: bytes = view.SerializeToString(deterministic=True)
        return self._encoded + message  # protocol buffers merge messages that follow each other

    def _static(self, observation: Observation) -> Any:
        """Return the constant part of the first GroundTruth."""
        if self._roads is None:
            self._roads = self._truth.of(observation)
            for name in _MOVING:
                self._roads.ClearField(name)
        return self._roads


def pose_of_update(data: bytes, ego: Participant, path: str) -> Pose | None:
    """Return the ego's pose in a TrafficUpdate; None where the message is empty.

    Raises:
        ToolchainError: it is no such message, or has no position and yaw of one moving object.
    """
    message = _parsed("osi3.osi_trafficupdate_pb2", "TrafficUpdate", data, path)
    if not message.update:
        return None
    if len(message.update) > 1:
        raise ToolchainError(
            f"{UPDATE} has {len(message.update)} moving objects, the ego alone is expected",
            path=path,
        )
    base = message.update[0].base
    if not (base.HasField("position") and base.orientation.HasField("yaw")):
        raise ToolchainError(f"{UPDATE} has no position, or no yaw", path=path)
    h = base.orientation.yaw
    c, s = math.cos(h), math.sin(h)
    x, y = (
        base.position.x - ego.box.x * c + ego.box.y * s,
        base.position.y - ego.box.x * s - ego.box.y * c,
    )
    return Pose(x, y, h, _along(base, h))


def pose_of_request(data: bytes, time: float, path: str) -> Pose | None:
    """Return the pose that a MotionRequest asks for at a time (s), between points of its
    trajectory; None where it is empty.

    Raises:
        ToolchainError: it is no such message, or its trajectory has no point there.
    """
    message = _parsed("osi3.osi_motionrequest_pb2", "MotionRequest", data, path)
    if message.HasField("desired_trajectory"):
        return _on_trajectory(message.desired_trajectory.trajectory_point, time, path)
    if not message.HasField("desired_state"):
        return None
    state = message.desired_state
    if not (state.HasField("position") and state.orientation.HasField("yaw")):
        raise ToolchainError(f"{REQUEST} has no position, or no yaw", path=path)
    return Pose(
        state.position.x,
        state.position.y,
        state.orientation.yaw,
        _along(state, state.orientation.yaw),
    )


def _on_trajectory(points: Any, time: float, path: str) -> Pose:
    times = [point.timestamp.seconds + point.timestamp.nanos * _NANO for point in points]
    if not times or not times[0] - _SOON <= time <= times[-1] + _SOON:
        span = f"is from {times[0]:.3f} to {times[-1]:.3f} s" if times else "has no point"
        raise ToolchainError(
            f"the trajectory of {REQUEST} {span}, the ego is asked for at {time:.3f} s", path=path
        )
    after = next(
        (number for number, instant in enumerate(times) if instant >= time), len(times) - 1
    )
    before = max(after - 1, 0)
    length = times[after] - times[before]
    # A single point, or two at one time, have no length to divide by.
    share = min(max((time - times[before]) / length, 0.0), 1.0) if length > 0.0 else 1.0
    one, two = points[before], points[after]
    x, y = (
        getattr(one.position, a) + share * (getattr(two.position, a) - getattr(one.position, a))
        for a in "xy"
    )
    # By the shorter turn, over ±π as well.
    return Pose(x, y, one.orientation.yaw + share * wrap(two.orientation.yaw - one.orientation.yaw))


def _along(moving: Any, h: float) -> float | None:
    """Return the speed (m/s) along a heading (rad); None where no velocity is given."""
    velocity = moving.velocity
    return (
        velocity.x * math.cos(h) + velocity.y * math.sin(h) if moving.HasField("velocity") else None
    )


def _parsed(module: str, name: str, data: bytes, path: str) -> Any:
    message = getattr(optional(module), name)()
    try:
        message.ParseFromString(data)
    except optional("google.protobuf.message").DecodeError:
        raise ToolchainError(
            f"the FMU gives {len(data)} bytes that are no {name}", path=path
        ) from None
    return message
