"""`r157-cc`: the careful and competent human driver of UN Regulation 157."""

from __future__ import annotations

from dataclasses import dataclass

from runner.sut.encounters import Encounter
from runner.sut.reference import ROUNDING, Moving, ReferenceDriver

SYSTEM = ("r157-cc", "CarefulCompetent")


@dataclass
class CarefulCompetent(ReferenceDriver):
    """Reacts to who is in its way with a time to collision of less than a critical one (see `runner.sut.reference`).

    Args:
        reaction: time before it brakes, s.
        release: deceleration with the foot off the pedal, m/s².
        critical: time to collision, s.
    """

    reaction: float = 0.75
    release: float = 0.4
    critical: float = 2.0

    def dangerous(self, found: Encounter, ego: Moving) -> bool:
        """In the way, and reached within the critical time."""
        return (found.aside <= ROUNDING) & (found.time_to_collision <= self.critical)
