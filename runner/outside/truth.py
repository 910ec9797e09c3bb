"""Observations as OSI GroundTruth messages, step by step. Needs the extra `osi`."""

from __future__ import annotations

import math
from typing import Any

from runner.exports.lanelets import lanelets
from runner.exports.osi import Osi, fill_base, fill_type
from runner.exports.osi_lanes import Lanes
from runner.motion.placement import wrap
from runner.sut.base import Observation, Participant
from xodr.model import RoadPoint
from xodr.network import RoadNetwork


class Truth:
    """Messages of one run; an entity keeps its id.

    The first message also has the lanes and lane boundaries of all roads, which do not change; all messages have the
    participants, each with the lane that it is on. Rates of angles are those since the message before.
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
            message.map_reference, message.proj_string = network.path.name, network.geo_reference or ""
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
        return self._ids.setdefault(one.name, (self._lanes.next_id if self._lanes else 0) + len(self._ids))

    def _add(self, each: Any, one: Participant, time: float, network: RoadNetwork | None) -> int | None:
        """Fill a MovingObject; the id of the lane that it is on."""
        each.id.value = self._id(one)
        source = each.source_reference.add()
        source.type = "net.asam.openscenario"
        source.identifier.append(one.name)
        fill_base(each.base, one.box, self._values(one, time), True)
        fill_type(each, one, self._osi)
        self._before[one.name] = time, one
        if network is None or self._lanes is None:
            return None
        point = network.locate(one.x, one.y, one.z, one.h, self._hints.get(one.name))
        if not network.on_road(point):
            point = network.locate(one.x, one.y, one.z, one.h)
        self._hints[one.name] = point
        lane = self._lanes.at(point.road_id, point.lane_id, point.s)
        if lane is not None:
            each.moving_object_classification.assigned_lane_id.add(value=lane)
        return lane

    def _values(self, one: Participant, time: float) -> list[float]:
        """Of the middle of its box: see `fill_base`."""
        then, before = self._before.get(one.name, (time, one))
        dt = time - then
        rates = [wrap(now - was) / dt if dt else 0.0 for now, was in zip(_angles(one), _angles(before), strict=True)]
        x, y, z = _turned(one, one.box.x, one.box.y, one.box.z)
        return [
            *(one.x + x, one.y + y, one.z + z),
            *_angles(one),
            *(one.vx - rates[0] * y, one.vy + rates[0] * x, 0.0),
            *(one.ax, one.ay, 0.0),
            *rates,
        ]


def _angles(one: Participant) -> tuple[float, float, float]:
    return wrap(one.h), one.pitch, one.roll


def _turned(one: Participant, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A vector (m) of a participant's own frame in the world's: roll, then pitch, then heading (ISO 8855)."""
    (ch, cp, cr), (sh, sp, sr) = (tuple(map(turn, (one.h, one.pitch, one.roll))) for turn in (math.cos, math.sin))
    y, z = y * cr - z * sr, y * sr + z * cr
    x, z = x * cp + z * sp, z * cp - x * sp
    return x * ch - y * sh, x * sh + y * ch, z
