"""`cas`: the collision avoidance system, default system under test."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from runner.engine.motion.rss import (
    RssParameters,
    lateral_distance,
    longitudinal_distance,
    parameter_set,
)
from runner.engine.participants.boxes import (
    Outlook,
    gap,
    interval_gap,
    outlook,
    reach,
    spans,
)
from runner.engine.participants.boxes import vertical_gap as vertical
from runner.engine.participants.declaration import BoundingBox
from runner.engine.participants.outlines import (
    box_distance,
    extents,
    interval_gaps,
    seen_by,
    vertical_gap,
)
from runner.systems.arrays import BatchControl
from runner.systems.base import Control, Observation, Participant
from runner.systems.encounters import choose
from schemas.common.errors import UsageError

if TYPE_CHECKING:
    from runner.systems.arrays import BatchObservation, BatchParticipants
    from schemas.common.array_types import BoolArray, FloatArray, IntArray

_NOTHING = Control()
_ROUNDING = 1e-6
SYSTEMS = {
    "cas": (
        "CollisionAvoidance",
        "full braking where RSS distances within 10 m are violated; sees no lights",
    ),
}


def unsafe_ahead(ahead: Any, own: Any, its: Any, p: RssParameters) -> tuple[Any, Any]:
    """Whether a longitudinal gap (m) is less than the safe one, and the safe one, m; of numbers or
    arrays.

    Args:
        own, its: speeds in the ego's direction of travel, m/s.
    """
    safe = longitudinal_distance(own, its, p)
    return (ahead <= 0.0) | (ahead < safe), safe


def unsafe_aside(is_left: Any, aside: Any, own: Any, its: Any, p: RssParameters) -> tuple[Any, Any]:
    """Whether a lateral gap (m) is less than the safe one, and the safe one, m; of numbers or
    arrays.

    Args:
        is_left: whether the other one is to the left.
        own, its: lateral speeds to the right, as RSS counts them, m/s.
    """
    left, right = choose(is_left, its, own), choose(is_left, own, its)
    # ρ goes with ego and other one, whichever of them is to the left.
    response, other = p.response, p.response_other
    if response != other:
        response, other = choose(is_left, other, response), choose(is_left, response, other)
    safe = lateral_distance(left, right, response, other, p)
    return aside < safe, safe


def rightwards(one: Any, c: Any, s: Any) -> Any:
    """Speed of a participant to the right of a heading with that cosine and sine, m/s."""
    return one.vx * s - one.vy * c


class _PairedParticipants(NamedTuple):
    """Participants of some pairs: the deciding fields, each an array (m,)."""

    box: BoundingBox
    x: FloatArray
    y: FloatArray
    z: FloatArray
    speed: FloatArray
    vx: FloatArray
    vy: FloatArray
    cos: FloatArray
    sin: FloatArray

    @property
    def facing(self) -> tuple[FloatArray, FloatArray]:
        """Cosine and sine of the heading."""
        return self.cos, self.sin

    @classmethod
    def of(cls, some: BatchParticipants, at: tuple[IntArray, ...]) -> _PairedParticipants:
        """Participants at places of arrays."""
        x, y, z, h, speed, vx, vy = (
            column[at] for column in (some.x, some.y, some.z, some.h, some.speed, some.vx, some.vy)
        )
        return cls(_boxes(some.box, at), x, y, z, speed, vx, vy, np.cos(h), np.sin(h))

    def at(self, rows: IntArray) -> _PairedParticipants:
        """Subset of the pairs."""
        return _PairedParticipants(_boxes(self.box, rows), *(column[rows] for column in self[1:]))


def _boxes(box: Any, at: Any) -> BoundingBox:
    return BoundingBox(*(column[at] for column in box))


def _reach(box: BoundingBox) -> Any:
    """`runner.engine.participants.boxes.reach` of boxes in arrays, m; worked out once where one box
    stands for all runs."""
    columns: tuple[Any, ...] = box
    box = BoundingBox(*(each[..., :1] if each.strides[-1:] == (0,) else each for each in columns))
    return np.hypot(np.abs(box.x) + box.length / 2, np.abs(box.y) + box.width / 2)


@dataclass(slots=True)
class CollisionAvoidance:
    """Brakes as hard as it can while the RSS distances to a participant within sensor range are
    violated.

    Danger is: a participant no further than the sensor range (between the boxes), ahead of the
    ego's middle (behind it while the ego reverses), whose longitudinal and lateral gaps in the
    ego's frame are both less than the safe ones. Otherwise the ego does what the scenario asks. It
    does not look at traffic lights.

    Args:
        sensor_range: how far it sees, m.
        rss: name of the RSS parameter set.
        brake: deceleration when in danger, m/s².
        jerk: how fast its braking builds up, m/s³; at once by default, as published.
    """

    sensors = True
    """It may see through a `runner.systems.encounters.SensorModel`"""
    sensor_range: float = 10.0
    rss: str = "ad-rss"
    brake: float = 8.0
    jerk: float = math.inf
    _parameters: RssParameters = field(init=False)
    _braking: float = field(default=0.0, init=False)
    _brakings: FloatArray = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not self.sensor_range >= 0.0:
            raise UsageError(f"sensor_range of cas is 0 m or more, not {self.sensor_range:g}")
        if not self.brake > 0.0:
            raise UsageError(f"brake of cas is more than 0 m/s², not {self.brake:g}")
        if not self.jerk > 0.0:
            raise UsageError(f"jerk of cas is more than 0 m/s³, not {self.jerk:g}")
        self._parameters = parameter_set(self.rss)

    def reset(self, ego: Participant, timestep: float, seed: int) -> None:
        """Forget the last run."""
        self._braking = 0.0

    def control(self, observation: Observation, dt: float) -> Control:
        """Full braking with the reason when in danger, else nothing."""
        ego = observation.ego
        # A standing ego looks where the scenario is about to drive it.
        way = -1.0 if (ego.speed or observation.target_speed) < 0.0 else 1.0
        # Circles about the boxes first: they exclude most participants.
        far = self.sensor_range + reach(ego.box)
        for other in observation.others:
            if math.hypot(other.x - ego.x, other.y - ego.y) <= far + reach(other.box):
                danger = self._danger(ego, other, way)
                if danger:
                    self._braking = min(self.brake, self._braking + self.jerk * dt)
                    return Control(acceleration=-way * self._braking, reason=danger)
        self._braking = 0.0
        return _NOTHING

    def reset_batch(self, egos: BatchParticipants, timestep: float, seeds: IntArray) -> None:
        """Forget the last runs."""
        self._brakings = np.zeros(len(seeds))

    def control_batch(self, observations: BatchObservation, dt: float) -> BatchControl:
        """`control` in many runs."""
        ego, others = observations.ego, observations.others
        ahead_first = np.where(ego.speed != 0.0, ego.speed, observations.target_speed)
        way = np.where(ahead_first < 0.0, -1.0, 1.0)
        # Circles about the boxes first: they exclude most participants.
        far = self.sensor_range + _reach(ego.box) + _reach(others.box)
        dx, dy = others.x - ego.x, others.y - ego.y
        near = others.present & (np.sqrt(dx * dx + dy * dy) <= far)
        danger = np.zeros(len(way), bool)
        row, run = np.nonzero(near)
        if row.size:
            pairs = _PairedParticipants.of(ego, (run,)), _PairedParticipants.of(others, (row, run))
            danger[run[self._dangers(*pairs, way[run])]] = True
        if self.jerk == math.inf:
            return BatchControl(-way * self.brake, danger)
        built = np.minimum(self.brake, self._brakings[observations.run] + self.jerk * dt)
        braking = np.where(danger, built, 0.0)
        self._brakings[observations.run] = braking
        return BatchControl(-way * braking, danger)

    def _dangers(
        self, ego: _PairedParticipants, other: _PairedParticipants, way: FloatArray
    ) -> BoolArray:
        """`_danger` of many pairs (m,)."""
        seen, p = seen_by(ego, other), self._parameters
        rear, front, right, left = extents(seen, other.box)
        ahead = np.abs(interval_gaps(-ego.box.length / 2, ego.box.length / 2, rear, front))
        aside = np.abs(interval_gaps(-ego.box.width / 2, ego.box.width / 2, right, left))
        c, s = ego.facing
        own = way * ego.speed, rightwards(ego, c, s)
        its = way * (other.vx * c + other.vy * s), rightwards(other, c, s)
        found: BoolArray = (way * seen.x > 0.0) & unsafe_ahead(ahead, own[0], its[0], p)[0]
        found &= unsafe_aside(seen.y > 0.0, aside, own[1], its[1], p)[0]
        # The range last, for the few pairs that are left: distances of boxes cost most.
        rows = np.flatnonzero(found)
        a, b = ego.at(rows), other.at(rows)
        gaps = np.hypot(box_distance(a, b), vertical_gap(a, b))
        found[rows] = gaps <= self.sensor_range
        return found

    def _in_range(self, ego: Participant, other: Participant, seen: Outlook) -> bool:
        """Whether the gap is at most the sensor range; the distance of the boxes' centres, never
        less, mostly says so already."""
        if math.hypot(seen.x, seen.y, vertical(ego, other)) < self.sensor_range - _ROUNDING:
            return True
        return gap(ego, other) <= self.sensor_range

    def _danger(self, ego: Participant, other: Participant, way: float) -> str:
        """Reason why a participant is dangerous for an ego that drives forwards (way +1) or
        backwards (−1); empty for none."""
        p = self._parameters
        seen = outlook(ego, other)
        if way * seen.x <= 0.0:
            return ""
        rear, front, right, left = spans(seen, other.box)
        ahead = abs(interval_gap(-ego.box.length / 2, ego.box.length / 2, rear, front))
        c, s = math.cos(ego.h), math.sin(ego.h)
        its = way * (other.vx * c + other.vy * s)
        is_near, safe_ahead = unsafe_ahead(ahead, way * ego.speed, its, p)
        if not is_near:
            return ""
        aside = abs(interval_gap(-ego.box.width / 2, ego.box.width / 2, right, left))
        is_near, safe_aside = unsafe_aside(
            seen.y > 0.0, aside, rightwards(ego, c, s), rightwards(other, c, s), p
        )
        if not is_near or not self._in_range(ego, other, seen):  # the range last: it takes longest
            return ""
        return (
            f"{other.name} is {ahead:.1f} m ahead and {aside:.1f} m aside, "
            f"RSS asks for {safe_ahead:.1f} m or {safe_aside:.1f} m"
        )
