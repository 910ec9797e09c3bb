"""`cas`: the collision avoidance system, default system under test."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

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
    vertical_gap,
)
from runner.systems.base import Control, Observation, Participant
from runner.systems.encounters import choose
from schemas.common.errors import UsageError

_NOTHING = Control()
_ROUNDING = 1e-6
SYSTEMS = {
    "cas": (
        "CollisionAvoidance",
        "full braking where RSS distances within 10 m are violated; sees no lights",
    ),
}


def safe_sideways(left: Any, own: Any, its: Any, p: RssParameters) -> Any:
    """Least safe lateral gap (m) to another one; numbers, or arrays of them over many cases.

    Args:
        left: whether the other one is to the left.
        own, its: lateral speeds to the right, as RSS counts them, m/s.
    """
    if_left = lateral_distance(its, own, p.response_other, p.response, p)
    return choose(left, if_left, lateral_distance(own, its, p.response, p.response_other, p))


@dataclass(slots=True)
class CollisionAvoidance:
    """Brakes as hard as it can while the RSS distances to a participant within sensor range are violated.

    Danger is: a participant no further than the sensor range (between the boxes), ahead of the
    ego's middle (behind it while the ego reverses), whose longitudinal and lateral gaps in the
    ego's frame are both less than the safe ones. Otherwise the ego does what the scenario asks. It
    does not look at traffic lights.

    Args:
        sensor_range: how far it sees, m.
        rss: name of the RSS parameter set.
        brake: deceleration when in danger, m/s².
    """

    sensor_range: float = 10.0
    rss: str = "ad-rss"
    brake: float = 8.0
    _parameters: RssParameters = field(init=False)

    def __post_init__(self) -> None:
        if not self.sensor_range >= 0.0:
            raise UsageError(f"sensor_range of cas is 0 m or more, not {self.sensor_range:g}")
        if not self.brake > 0.0:
            raise UsageError(f"brake of cas is more than 0 m/s², not {self.brake:g}")
        self._parameters = parameter_set(self.rss)

    def reset(self, ego: Participant, timestep: float, seed: int) -> None:
        """Nothing is carried from run to run."""

    def control(self, observation: Observation, dt: float) -> Control:
        """Full braking with the reason when in danger, else nothing."""
        ego = observation.ego
        way = -1.0 if (ego.speed or observation.target_speed) < 0.0 else 1.0
        far = self.sensor_range + reach(ego.box)
        for other in observation.others:
            if math.hypot(other.x - ego.x, other.y - ego.y) <= far + reach(other.box):
                danger = self._danger(ego, other, way)
                if danger:
                    return Control(acceleration=-way * self.brake, reason=danger)
        return _NOTHING

    def _in_range(self, ego: Participant, other: Participant, seen: Outlook) -> bool:
        """Whether the gap is at most the sensor range; the distance of the boxes' centres, never less, mostly says so already."""
        if math.hypot(seen.x, seen.y, vertical_gap(ego, other)) < self.sensor_range - _ROUNDING:
            return True
        return gap(ego, other) <= self.sensor_range

    def _danger(self, ego: Participant, other: Participant, way: float) -> str:
        """Why a participant is dangerous for an ego that drives forwards (way +1) or backwards (−1); empty where it is not."""
        p = self._parameters
        seen = outlook(ego, other)
        if way * seen.x <= 0.0:
            return ""
        rear, front, right, left = spans(seen, other.box)
        ahead = abs(interval_gap(-ego.box.length / 2, ego.box.length / 2, rear, front))
        aside = interval_gap(-ego.box.width / 2, ego.box.width / 2, right, left)
        c, s = math.cos(ego.h), math.sin(ego.h)
        safe_ahead = longitudinal_distance(way * ego.speed, way * (other.vx * c + other.vy * s), p)
        if 0.0 < ahead >= safe_ahead:
            return ""
        safe_aside = safe_sideways(
            seen.y > 0.0, ego.vx * s - ego.vy * c, other.vx * s - other.vy * c, p
        )
        if abs(aside) >= safe_aside or not self._in_range(
            ego, other, seen
        ):  # the range last: it takes longest
            return ""
        return (
            f"{other.name} is {ahead:.1f} m ahead and {abs(aside):.1f} m aside, "
            f"RSS asks for {safe_ahead:.1f} m or {safe_aside:.1f} m"
        )
