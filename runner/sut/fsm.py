"""`fsm`: the driver of the Fuzzy Safety Model, which brakes the more, the less safe the situation is."""

from __future__ import annotations

import math
from dataclasses import dataclass

from runner.sut.encounters import Encounter
from runner.sut.formulas import choose, greatest, least, ratio
from runner.sut.reference import HARDEST, ROUNDING, Moving, ReferenceDriver

SYSTEM = ("fsm", "FuzzySafety")


def _between(value: float, safe: float, unsafe: float) -> float:
    """0 from `safe` on, 1 below `unsafe`, linear between."""
    found: float = choose(value > safe, 0.0, choose(value < unsafe, 1.0, ratio(safe - value, safe - unsafe, 0.0)))
    return found


@dataclass
class FuzzySafety(ReferenceDriver):
    """Brakes by the fuzzy proactive (PFS) and critical (CFS) safety metrics.

    PFS compares the gap with what is needed if the one ahead brakes suddenly, CFS with what is needed at constant speed of the
    one ahead. The deceleration is `comfortable` + CFS·(`hard` − `comfortable`) where CFS > 0, else PFS·`comfortable`, built up
    as fast as a human can. It reacts to who is in its way, or comes into it before the ego could have passed.

    Source: Mattas, Makridis, Botzoris, Kriston, Minarini, Papadopoulos, Re, Rognelund, Ciuffo, "Fuzzy Surrogate Safety
    Metrics for real-time assessment of rear-end collision risk" (Accident Analysis and Prevention 148, 2020).

    Args:
        reaction: time before it brakes, s.
        comfortable, hard: its own decelerations, m/s².
        other: deceleration that the one ahead may apply, m/s².
        margin: gap at standstill, m; kept once more where braking is comfortable.
        ahead_of_time: it reacts to who comes into its way up to this time after the ego could have passed, s.
    """

    reaction: float = 0.75
    comfortable: float = 4.0
    hard: float = 6.0
    other: float = 7.0
    margin: float = 2.0
    ahead_of_time: float = 0.1

    def dangerous(self, found: Encounter, ego: Moving) -> bool:
        """In the way or about to be, and not safe by one of the metrics."""
        return self._in_the_way(found) & ((self.critical(found, ego) > 0.0) | (self.proactive(found, ego) > 0.0))

    def _in_the_way(self, found: Encounter) -> bool:
        comes, passed = (
            ratio(found.aside, found.approach, math.inf),
            ratio(found.gap + found.length, found.closing, -math.inf),
        )
        there: bool = (found.aside <= ROUNDING) | ((found.approach > 0.0) & (comes <= passed + self.ahead_of_time))
        return there

    def proactive(self, found: Encounter, ego: Moving) -> float:
        """PFS, 0 (safe) to 1."""
        u, own = ego.speed, found.speed
        reaction, its = u * self.reaction, own * own / (2.0 * self.other)
        safe = reaction + u * u / (2.0 * self.comfortable) - its + self.margin
        return _between(found.gap - self.margin, safe, reaction + u * u / (2.0 * self.hard) - its)

    def critical(self, found: Encounter, ego: Moving) -> float:
        """CFS, 0 (safe) to 1."""
        acceleration = greatest(ego.acceleration, -self.comfortable)
        left = found.closing + acceleration * self.reaction
        within = (found.closing + 0.5 * acceleration * self.reaction) * self.reaction
        stopping = ratio(found.closing**2, 2.0 * abs(ego.acceleration), math.inf)
        moving = _between(found.gap, within + left * left / (2.0 * self.comfortable), within + left * left / (2.0 * self.hard))
        standing = choose(found.gap < stopping, 1.0, 0.0)
        unsafe: float = choose(found.closing <= 0.0, 0.0, choose(left < 0.0, standing, moving))
        return unsafe

    def demand(self, found: Encounter, ego: Moving) -> float:
        """The more, the less safe, m/s²; no human brakes harder than `HARDEST`."""
        critical = self.critical(found, ego)
        hard = self.comfortable + critical * (self.hard - self.comfortable)
        needed: float = least(choose(critical > 0.0, hard, self.proactive(found, ego) * self.comfortable), HARDEST)
        return needed
