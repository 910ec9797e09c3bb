"""`aeb`: autonomous emergency braking in two stages, by the time to collision."""

from __future__ import annotations

from dataclasses import dataclass

from runner.sut.base import Control, Observation, Participant
from runner.sut.encounters import encounters

SYSTEM = ("aeb", "EmergencyBraking")


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
        near = (found for found in encounters(observation) if found.gap <= self.sensor_range)
        threats = [one for one in near if one.aside - max(one.approach, 0.0) * min(one.time_to_collision, 10.0) < self.clearance]
        nearest = min(threats, key=lambda found: found.time_to_collision, default=None)
        if nearest is None or nearest.time_to_collision > self.partial_time:
            self._full = False
            return Control()
        self._full = self._full or nearest.time_to_collision <= self.full_time
        reason = f"{nearest.name} is reached in {nearest.time_to_collision:.2f} s"
        return Control(-(self.full if self._full else self.partial), reason=reason)
