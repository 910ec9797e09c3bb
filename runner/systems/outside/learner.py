"""Inputs of a learner made of an `Observation` (rows of numbers, in lane coordinates and bare), and
rewards.

Lane coordinates are those of `xodr.graph.network.RoadNetwork.relative_in_lane`, with the signs of
the ego: ahead along its lane and to its left are positive, whichever way it faces. Where no way
leads from lane to lane, or without roads, the axes of the ego take their place.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from runner.engine.motion.placement import lane_heading, wrap
from runner.systems.base import Observation, Participant
from xodr.graph.network import RoadNetwork
from xodr.model import RoadPoint

Rows = NDArray[np.float32]

EGO = ("speed", "acceleration", "target_speed", "offset", "heading", "right_edge", "left_edge")
"""Columns of the ego: m/s, m/s², the speed that the scenario asks for (m/s); from the lane's centre
(m), heading relative to the lane (rad), distance from the reference point to the road's edges (m, 0
without roads)."""
PARTICIPANT = (
    "present",
    "ahead",
    "left",
    "lanes",
    "speed",
    "closing",
    "heading",
    "length",
    "width",
)
"""Columns of a participant: 1 (0 in an empty row); from reference point to reference point (m),
lanes between, its speed along the ego's lane (m/s), how much faster the ego is (m/s), its heading
relative to the ego's (rad), its size (m)."""
SIGNAL = ("present", "distance", "stop", "stop_distance")
"""Columns of the traffic lights: 1 with a light ahead, the distance to the next one (m); 1 with a
line at which a light forbids to go on, the distance to it (m); from the reference point, 0 without
one."""
STATE = ("x", "y", "z", "h", "vx", "vy", "ax", "ay")
"""Columns of the bare state, as in `runner.systems.Participant`; the ego in the first row, then the
participants."""


class _Seat(NamedTuple):
    """Position of an entity on the roads; direction 1 faces +s, −1 faces −s."""

    point: RoadPoint
    heading: float
    side: float


class ObservationArrays:
    """Makes arrays of observations.

    Args:
        participants: number of rows; the nearest participants have one each, the nearest first.
    """

    def __init__(self, participants: int) -> None:
        self._most = participants
        self._hints: dict[str, RoadPoint] = {}

    def of(self, observation: Observation) -> dict[str, Rows]:
        """`ego` (7,), `signal` (4,), `participants` (n, 9) and `state` (1 + n, 8), see the columns
        above."""
        ego, network = observation.ego, observation.network
        seat = self._seat(network, ego) if network is not None else None
        nearest = self.nearest(observation)
        rows = {
            "ego": np.zeros(len(EGO), np.float32),
            "signal": np.zeros(len(SIGNAL), np.float32),
            "participants": np.zeros((self._most, len(PARTICIPANT)), np.float32),
            "state": np.zeros((1 + self._most, len(STATE)), np.float32),
        }
        rows["ego"][:] = (
            ego.speed,
            ego.acceleration,
            observation.target_speed,
            *_on_road(network, seat),
        )
        for place, signal in (
            (0, next(iter(observation.signals), None)),
            (2, observation.stop_line),
        ):
            if signal is not None:
                rows["signal"][place : place + 2] = 1.0, signal.distance
        for row, other in enumerate(nearest):
            rows["participants"][row] = self._participant(network, ego, seat, other)
        for row, participant in enumerate((ego, *nearest)):
            rows["state"][row] = [getattr(participant, name) for name in STATE]
        return rows

    def nearest(self, observation: Observation) -> list[Participant]:
        """Return the participants that have a row, in the order of the rows."""
        ego = observation.ego
        return sorted(
            observation.others, key=lambda other: math.hypot(other.x - ego.x, other.y - ego.y)
        )[: self._most]

    def is_off_road(self, observation: Observation) -> bool:
        """Whether the ego's reference point is on no lane; never without roads."""
        network = observation.network
        return network is not None and not network.on_road(
            self._seat(network, observation.ego).point
        )

    def _seat(self, network: RoadNetwork, each: Participant) -> _Seat:
        point = network.locate(each.x, each.y, each.z, each.h, self._hints.get(each.name))
        # The next search begins at the last place: most steps stay on the same road.
        self._hints[each.name] = point
        heading = wrap(each.h - lane_heading(network.roads[point.road_id], point))
        # Angles are those to the nearer direction of the lane, whichever way it is driven.
        side = 1.0 if abs(heading) <= math.pi / 2 else -1.0
        return _Seat(point, heading if side > 0.0 else wrap(heading + math.pi), side)

    def _participant(
        self, network: RoadNetwork | None, ego: Participant, seat: _Seat | None, other: Participant
    ) -> list[float]:
        ahead, left, lanes, along = self._in_lane(network, seat, other) or _in_axes(ego, other)
        turn = wrap(other.h - ego.h)
        return [
            1.0,
            ahead,
            left,
            lanes,
            along,
            ego.speed - along,
            turn,
            other.box.length,
            other.box.width,
        ]

    def _in_lane(
        self, network: RoadNetwork | None, seat: _Seat | None, other: Participant
    ) -> tuple[float, ...] | None:
        """`ahead`, `left`, `lanes` and `speed` in lane coordinates of the ego; None where no way
        leads there."""
        # Without roads there are no lanes to count along.
        if network is None or seat is None:
            return None
        theirs = self._seat(network, other)
        relative = network.relative_in_lane(seat.point, theirs.point)
        if relative is None:
            return None
        same = theirs.side * seat.side * (1.0 if relative.aligned else -1.0)
        along = same * other.speed * math.cos(theirs.heading)
        return seat.side * relative.ds, seat.side * relative.dt, seat.side * relative.lanes, along


def _in_axes(ego: Participant, other: Participant) -> tuple[float, ...]:
    """Columns `ahead`, `left`, `lanes` and `speed` along the axes of the ego."""
    c, s, dx, dy = math.cos(ego.h), math.sin(ego.h), other.x - ego.x, other.y - ego.y
    return dx * c + dy * s, dy * c - dx * s, 0.0, other.vx * c + other.vy * s


def _on_road(network: RoadNetwork | None, seat: _Seat | None) -> tuple[float, float, float, float]:
    """The last four columns of `EGO`."""
    if network is None or seat is None:
        return 0.0, 0.0, 0.0, 0.0
    point = seat.point
    right, left = network.roads[point.road_id].edges(point.s)
    edges = (point.t - right, left - point.t)
    return (seat.side * point.offset, seat.heading, *(edges if seat.side > 0.0 else edges[::-1]))


_STRONG = 8.0
"""m/s², with which `effort` is measured: a fully pressed brake"""


class EgoStep(NamedTuple):
    """One step of the ego.

    Args:
        ego: as it is at the end of the step.
        target_speed: speed that the scenario asks of it, m/s.
        dt: length of the step, s.
        collided: whether it has had a contact.
        departed: whether it has left the road.
    """

    ego: Participant
    target_speed: float
    dt: float
    collided: bool
    departed: bool


class RewardFunction(Protocol):
    """Gives the reward of a step."""

    def __call__(self, step: EgoStep) -> float: ...


@dataclass(frozen=True)
class DrivingReward:
    """Drive at the requested speed, smoothly and without contacts.

    A step of dt seconds is worth

        dt · (progress · min(v, v*) / v* − effort · (a / 8 m/s²)²) − collision − departure

    with the ego's speed v along its heading, the target speed v* (without one there is no progress
    to reward) and acceleration a; the last two count in the step of a contact of the ego or its
    departure from the road.

    Args:
        progress: of a second at the target speed.
        effort: of a second at 8 m/s².
        collision, departure: of the end.
    """

    progress: float = 1.0
    effort: float = 0.5
    collision: float = 20.0
    departure: float = 20.0

    def __call__(self, step: EgoStep) -> float:
        """The reward of a step."""
        target = step.target_speed
        share = min(step.ego.speed / target, 1.0) if target > 0.0 else 0.0
        rate = self.progress * share - self.effort * (step.ego.acceleration / _STRONG) ** 2
        return step.dt * rate - self.collision * step.collided - self.departure * step.departed
