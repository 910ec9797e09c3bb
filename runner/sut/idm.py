"""`idm`: the Intelligent Driver Model."""

from __future__ import annotations

import math
from dataclasses import dataclass

from runner.sut.base import Control, Observation, Participant
from runner.sut.encounters import encounters

SYSTEM = ("idm", "IntelligentDriver")


@dataclass
class IntelligentDriver:
    """Follows whoever is in its way; its desired speed v₀ is what the scenario asks for.

    a = `accelerate`·(1 − (v/v₀)⁴ − (s*/s)²), s* = `standstill` + max(0, v·`headway` + v·Δv/(2·√(`accelerate`·`comfortable`)))

    Source: Treiber, Hennecke, Helbing, "Congested traffic states in empirical observations and microscopic simulations"
    (Physical Review E 62, 2000), equations 3 and 4.

    Args:
        headway: desired time gap, s.
        standstill: gap at standstill, m.
        accelerate, comfortable: acceleration and comfortable deceleration, m/s².
        brake: greatest deceleration, m/s².
        clearance: whoever is less than this far aside counts as in the way, m.
    """

    headway: float = 1.5
    standstill: float = 2.0
    accelerate: float = 1.4
    comfortable: float = 2.0
    brake: float = 8.0
    clearance: float = 0.2

    def reset(self, ego: Participant, timestep: float, seed: int) -> None:
        """Nothing is carried from run to run."""

    def control(self, observation: Observation, dt: float) -> Control:
        """The model's acceleration where somebody is in the way or the speed is not the desired one; else nothing."""
        speed, target = observation.ego.speed, observation.target_speed
        ahead = [found for found in encounters(observation) if found.aside < self.clearance]
        if speed < 0.0 or target < 0.0 or not ahead:
            return Control()
        found = min(ahead, key=lambda one: one.gap)
        dynamic = speed * self.headway + speed * found.closing / (2.0 * math.sqrt(self.accelerate * self.comfortable))
        needed = (self.standstill + max(0.0, dynamic)) / max(found.gap, 0.1)
        free = (speed / target) ** 4 if target > 0.0 else 1.0
        acceleration = max(self.accelerate * (1.0 - free - needed * needed), -self.brake)
        return Control(acceleration, reason=f"{found.name} is {found.gap:.1f} m ahead, {found.closing:.1f} m/s slower")
