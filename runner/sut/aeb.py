"""`aeb`: autonomous emergency braking in two stages, by the time to collision."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from runner.sut.base import Control, Observation, Participant
from runner.sut.encounters import Encounter, encounters
from runner.sut.formulas import choose, greatest, least

SYSTEM = ("aeb", "EmergencyBraking")
_FORESEEN = 10.0
"""Time (s) over which someone's way sideways is foreseen, at most"""


@dataclass
class EmergencyBraking:
    """Brakes in part, then fully, for who is in its way or will be when it is reached; else it follows the scenario.

    Once it brakes fully it does so until it stands or no one is in the way any more, as systems on the road do.

    Args:
        partial_time, full_time: times to collision below which it brakes, s.
        partial, full: its decelerations, m/s².
        sensor_range: how far it sees ahead, m.
        clearance: whoever is less than this far aside counts as in the way, m.
    """

    partial_time: float = 1.6
    full_time: float = 1.0
    partial: float = 4.0
    full: float = 9.0
    sensor_range: float = 80.0
    clearance: float = 0.2

    def reset(self, ego: Participant, timestep: float, seed: int) -> None:
        """Forget the last run."""
        self._full = False

    def control(self, observation: Observation, dt: float) -> Control:
        """Braking with the reason, or nothing."""
        times = ((self.threat(found), found.name) for found in encounters(observation))
        time, name = min(times, key=lambda threat: threat[0], default=(math.inf, ""))
        braking, self._full = self.stage(time, self._full)
        if not braking:
            return Control()
        return Control(-(self.full if self._full else self.partial), reason=f"{name} is reached in {time:.2f} s")

    def threat(self, found: Encounter) -> float:
        """Time (s) until the ego reaches someone who is in its way, or will be by then; infinite for all others."""
        time = found.time_to_collision
        left = found.aside - greatest(found.approach, 0.0) * least(time, _FORESEEN)
        reached: float = choose((found.gap <= self.sensor_range) & (left < self.clearance), time, math.inf)
        return reached

    def stage(self, time: Any, full: Any) -> tuple[Any, Any]:
        """Whether it brakes, and whether fully, with someone reached in a time (s), given whether it braked fully before."""
        braking = time <= self.partial_time
        return braking, braking & (full | (time <= self.full_time))
