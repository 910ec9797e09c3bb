"""System under test `acme`: brakes as soon as it could only just stop behind a
participant ahead.
"""

from __future__ import annotations

import math

from runner.systems import Control, Observation, Participant
from runner.systems.encounters import encounters

_ASIDE = 0.2
"""Lateral gap below which a participant is ahead, m"""
_FULL = 8.0
"""Deceleration of a participant that brakes fully, m/s²"""


class Acme:
    """Brakes at a needed deceleration above the accepted one.

    Args:
        accepted: deceleration, m/s².
        margin: gap at the standstill, m.
    """

    def __init__(self, accepted: float = 5.0, margin: float = 5.0) -> None:
        self.accepted = accepted
        self.margin = margin

    def reset(self, ego: Participant, timestep: float, seed: int) -> None:
        """Begin a run; this system carries nothing from run to run."""

    def control(self, observation: Observation, dt: float) -> Control:
        """Control for the coming step; fields left out stay scripted."""
        for other in encounters(observation):
            if other.aside >= _ASIDE:
                continue
            room = other.gap - self.margin + max(other.speed, 0.0) ** 2 / (2.0 * _FULL)
            needed = observation.ego.speed**2 / (2.0 * room) if room > 0.0 else math.inf
            if needed > self.accepted:
                reason = f"{other.name} is {other.gap:.1f} m ahead"
                return Control(acceleration=-min(needed, 9.0), reason=reason)
        return Control()
