"""`idm`: the Intelligent Driver Model."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from runner.systems.arrays import BatchControl
from runner.systems.base import Control, Observation, Participant
from runner.systems.encounters import (
    AheadParticipant,
    encounters,
    encounters_arrays,
    greatest,
    nearest,
    ratio,
    stop_line,
    stop_line_arrays,
)

if TYPE_CHECKING:
    from runner.systems.arrays import BatchObservation

SYSTEMS = {
    "idm": (
        "IntelligentDriver",
        "Intelligent Driver Model behind the participant ahead; stops at red lights",
    ),
}


@dataclass
class IntelligentDriver:
    """Follows the entity in its path; its desired speed v₀ is the scenario's. It stops at red
    lights.

    a = `accelerate`·(1 − (v/v₀)⁴ − (s*/s)²), s* = `standstill` + max(0, v·`headway` +
    v·Δv/(2·√(`accelerate`·`comfortable`)))

    Source: Treiber, Hennecke, Helbing, "Congested traffic states in empirical observations and
    microscopic simulations" (Physical Review E 62, 2000), equations 3 and 4.

    Args:
        headway: desired time gap, s.
        standstill: gap at standstill, m.
        accelerate, comfortable: acceleration and comfortable deceleration, m/s².
        brake: greatest deceleration, m/s².
        clearance: lateral gap (m) below which an entity is in the path.
    """

    headway: float = 1.5
    standstill: float = 2.0
    accelerate: float = 1.4
    comfortable: float = 2.0
    brake: float = 8.0
    clearance: float = 0.2

    def reset(self, ego: Participant, timestep: float, seed: int) -> None:
        """Do nothing: no state is carried from run to run."""

    def control(self, observation: Observation, dt: float) -> Control:
        """Return the model's acceleration if the path is occupied or the speed differs from the
        desired one; else nothing."""
        speed, target = observation.ego.speed, observation.target_speed
        ahead = [found for found in encounters(observation) if found.aside < self.clearance]
        line = stop_line(observation)
        if line is not None:
            ahead.append(line)
        # The model drives forwards only: reversing stays with the scenario.
        if speed < 0.0 or target < 0.0 or not ahead:
            return Control()
        found = min(ahead, key=lambda one: one.gap)
        reason = f"{found.name} is {found.gap:.1f} m ahead, {found.closing:.1f} m/s slower"
        return Control(self.acceleration(found, speed, target), reason=reason)

    def control_batch(self, observations: BatchObservation, dt: float) -> BatchControl:
        """`control` in many runs."""
        speed, target = observations.ego.speed, observations.target_speed
        ahead, found = encounters_arrays(observations)
        ahead &= found.aside < self.clearance
        is_met, first = nearest(ahead, found, *stop_line_arrays(observations))
        acts = is_met & (speed >= 0.0) & (target >= 0.0)
        return BatchControl(self.acceleration(first, speed, target), acts)

    def acceleration(self, found: AheadParticipant, speed: Any, target: Any) -> Any:
        """Return the model's acceleration behind an entity, at a speed and with a desired one
        (m/s); numbers or arrays."""
        dynamic = speed * self.headway + speed * found.closing / (
            2.0 * math.sqrt(self.accelerate * self.comfortable)
        )
        # The floor of the gap lets contacts end in full braking, not in a division by 0.
        needed = (self.standstill + greatest(dynamic, 0.0)) / greatest(found.gap, 0.1)
        # With a desired speed of 0 there is no free acceleration.
        free = ratio(speed, target, 1.0) ** 4
        return greatest(self.accelerate * (1.0 - free - needed * needed), -self.brake)
