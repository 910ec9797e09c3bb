"""`r157-reg`: what UN Regulation 157 itself asks of an automated lane keeping system when somebody cuts in (5.2.5.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from runner.sut.encounters import Encounter
from runner.sut.reference import ROUNDING, Moving, ReferenceDriver

SYSTEM = ("r157-reg", "Regulation157")


@dataclass
class Regulation157(ReferenceDriver):
    """Reacts to who is less than a lateral distance away and nearer in time than the braking to its speed takes.

    Danger is: lateral gap ≤ `lateral`, and TTC ≤ Δv/(2·`brake`) + `reaction` + 0.1 s. For who is beside the ego already, the time
    since their bumpers met counts as TTC, as in the JRC's implementation: only who has just come beside it is braked for.

    Args:
        reaction: time before it brakes, s.
        brake: deceleration, m/s², without build-up.
        lateral: lateral gap from which on a participant counts as cutting in, m.
    """

    reaction: float = 0.35
    brake: float = 6.0
    lateral: float = 0.5
    jerk: ClassVar[float] = math.inf

    def dangerous(self, found: Encounter, ego: Moving) -> bool:
        """Cutting in, too near for what the regulation grants."""
        enough = found.closing / (2.0 * self.brake) + self.reaction + 0.1
        near = (found.closing > 0.0) & (abs(found.gap) <= enough * found.closing)
        return near & (found.aside <= self.lateral + ROUNDING)

    def demand(self, found: Encounter, ego: Moving) -> float:
        """The same for everyone, m/s²."""
        return self.brake
