"""`aeb`: autonomous emergency braking in two stages, by the time to collision."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from runner.systems.arrays import BatchControl
from runner.systems.base import Control, Observation, Participant
from runner.systems.encounters import (
    AheadParticipant,
    choose,
    encounters,
    encounters_arrays,
    greatest,
    least,
)

if TYPE_CHECKING:
    from runner.systems.arrays import BatchObservation, BatchParticipants
    from schemas.common.array_types import IntArray

SYSTEMS = {
    "aeb": (
        "EmergencyBraking",
        "emergency braking in two stages by the time to collision; sees no lights",
    ),
}
_FORESEEN = 10.0
"""Longest prediction (s) of lateral motion"""
_FOLLOWS, _HOLDS, _PARTIAL, _FULL = range(4)


@dataclass
class EmergencyBraking:
    """Brakes in part, then fully, for entities in its path now or when it reaches them; else it
    follows the scenario.

    Braking continues, at least as hard, until the ego is no longer faster than the entity in its
    path, or the path is free. It then keeps its speed, or stands, while that entity is near: the
    scenario's speed would drive it on.

    Args:
        partial_time, full_time: times to collision below which it brakes, s.
        partial, full: its decelerations, m/s².
        sensor_range: how far it sees ahead, m.
        clearance: lateral gap (m) below which an entity is in the path.
        hold: after braking, the scenario's speed applies again once the entity in its path is this
            far ahead (m), plus the distance driven in `partial_time`.
    """

    partial_time: float = 1.6
    full_time: float = 1.0
    partial: float = 4.0
    full: float = 9.0
    sensor_range: float = 80.0
    clearance: float = 0.2
    hold: float = 5.0

    def reset(self, ego: Participant, timestep: float, seed: int) -> None:
        """Forget the last run."""
        self._stage = _FOLLOWS

    def control(self, observation: Observation, dt: float) -> Control:
        """Braking or keeping the speed, with the reason, or nothing."""
        seen = list(encounters(observation))
        time, name = min(
            ((self.threat(participant), participant.name) for participant in seen),
            key=lambda threat: threat[0],
            default=(math.inf, ""),
        )
        held = next(
            (
                participant.name
                for participant in seen
                if self.holds(participant, observation.ego.speed)
            ),
            None,
        )
        self._stage = self.stage(time, held is not None, self._stage)
        if self._stage == _FOLLOWS:
            return Control()
        reason = (
            f"{held} is near" if self._stage == _HOLDS else f"{name} is reached in {time:.2f} s"
        )
        return Control(self.acceleration(self._stage), reason=reason)

    def reset_batch(self, egos: BatchParticipants, timestep: float, seeds: IntArray) -> None:
        """Forget the last runs."""
        self._stages = np.full(len(seeds), _FOLLOWS)

    def control_batch(self, observations: BatchObservation, dt: float) -> BatchControl:
        """`control` in many runs."""
        ahead, found = encounters_arrays(observations)
        # `initial`, since a run may have no other participants.
        time = np.where(ahead, self.threat(found), np.inf).min(axis=0, initial=np.inf)
        held = (ahead & self.holds(found, observations.ego.speed)).any(axis=0)
        stage = self.stage(time, held, self._stages[observations.run])
        self._stages[observations.run] = stage
        return BatchControl(self.acceleration(stage), stage != _FOLLOWS)

    def threat(self, found: AheadParticipant) -> Any:
        """Return the time (s) until the ego reaches the entity, if it is or will be in the path;
        else infinity."""
        time = found.time_to_collision
        return choose((found.gap <= self.sensor_range) & self._in_way(found), time, math.inf)

    def holds(self, found: AheadParticipant, speed: Any) -> Any:
        """Whether an entity in the path is so near that, having braked at a speed (m/s), it does
        not speed up again."""
        return (found.gap <= self.hold + self.partial_time * speed) & self._in_way(found)

    def stage(self, time: Any, held: Any, stage: Any) -> Any:
        """Return the next stage, for the time (s) to reach an object or for a near object, and the
        current stage."""
        # Once begun, braking lasts while there is a threat: at the threshold alone it would pulse.
        braking = (time <= self.partial_time) | ((stage >= _PARTIAL) & (time < math.inf))
        full = braking & ((stage == _FULL) | (time <= self.full_time))
        holding = choose((stage != _FOLLOWS) & held, _HOLDS, _FOLLOWS)
        return choose(full, _FULL, choose(braking, _PARTIAL, holding))

    def acceleration(self, stage: Any) -> Any:
        """Acceleration (m/s²) of a stage."""
        return choose(stage == _FULL, -self.full, choose(stage == _PARTIAL, -self.partial, 0.0))

    def _in_way(self, found: AheadParticipant) -> Any:
        # The time is bounded, since an infinite one without approach would give no number.
        left = found.aside - greatest(found.approach, 0.0) * least(
            found.time_to_collision, _FORESEEN
        )
        return left < self.clearance
