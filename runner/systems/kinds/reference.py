"""Reference drivers `r157-cc`, `r157-reg`, `rss` and `fsm`: they notice danger, react after a time,
and brake.

Source of the models and constants: Mattas, Albano, Donà, Galassi, Suarez-Bertoa, Vass, Ciuffo,
"Driver models for the definition of safety requirements of automated vehicles in international
regulations" (Accident Analysis and Prevention 174, 2022), and UN Regulation 157, Annex 4,
Appendix 3. They are models of motorway driving: they brake and never steer.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np

from runner.engine.motion.rss import (
    RssParameters,
    lateral_distance,
    longitudinal_distance,
    parameter_set,
)
from runner.systems.arrays import BatchControl
from runner.systems.base import Control, Observation, Participant
from runner.systems.encounters import (
    AheadParticipant,
    choose,
    encounters,
    encounters_arrays,
    greatest,
    least,
    ratio,
    stop_line,
    stop_line_arrays,
)

if TYPE_CHECKING:
    from runner.systems.arrays import BatchObservation, BatchParticipants
    from schemas.common.array_types import IntArray

SYSTEMS = {
    "r157-cc": (
        "CarefulCompetent",
        "careful and competent driver of UN Regulation 157; stops at red lights",
    ),
    "r157-reg": (
        "Regulation157",
        "requirement of UN Regulation 157 on the system; stops at red lights",
    ),
    "rss": (
        "SafeDistance",
        "brakes where RSS distances of the set r157 are violated; stops at red lights",
    ),
    "fsm": ("FuzzySafety", "Fuzzy Safety Model of the JRC; stops at red lights"),
}
GRAVITY = 9.81
HARDEST = 0.774 * GRAVITY
"""Braking of a careful and competent human on a dry road, m/s²."""
JERK = 12.65
"""Jerk (m/s³) at the onset of that braking."""
_FOR_SIGNALS = 2.5
"""Deceleration (m/s²) from which on a stop at a signal is begun: comfortable on a dry road."""
_BEFORE_LINE = 1.0
"""Distance (m) from a signal's line at which one stops."""
ROUNDING = 1e-6
"""Tolerance of comparisons with limits: positions are sums of many steps."""


class Moving(Protocol):
    """Ego state of the drivers; numbers, or arrays over many cases."""

    @property
    def speed(self) -> Any:
        """Along the heading, m/s."""
        ...

    @property
    def acceleration(self) -> Any:
        """Along the heading, m/s²."""
        ...


class ReferenceDriver:
    """Follows the scenario until a participant ahead is dangerous. From then on it brakes, after a
    reaction time, while there is danger, and keeps its speed while there is none. It stops at red
    lights, and goes on as scripted at green.

    Attributes:
        reaction: time in danger before it brakes, s.
        release: deceleration during that time, m/s².
        jerk: how fast its braking builds up, m/s³.
    """

    reaction: float
    release: float = 0.0
    jerk: ClassVar[float] = JERK

    def reset(self, ego: Participant, timestep: float, seed: int) -> None:
        """Forget the last run."""
        self._until_braking = self.reaction
        self._alarmed = False
        self._deceleration = 0.0

    def control(self, observation: Observation, dt: float) -> Control:
        """Braking with the reason in danger; else the scripted speed, or after an alarm the present
        one."""
        dangers = [
            found for found in encounters(observation) if self.dangerous(found, observation.ego)
        ]
        line = stop_line(observation)
        if line is not None and not dangers:
            stops, deceleration = self.for_signal(line)
            if stops:
                return Control(-deceleration, reason=f"{line.name} says stop in {line.gap:.1f} m")
        if not dangers:
            return (
                Control(acceleration=0.0, reason="the danger is over")
                if self._alarmed
                else Control()
            )
        nearest = min(dangers, key=lambda found: found.gap)
        reason = (
            f"{nearest.name} is {nearest.gap:.1f} m ahead, {nearest.closing:.1f} m/s slower, "
            f"{nearest.aside:.1f} m aside"
        )
        self._alarmed = True
        demand = max(self.demand(found, observation.ego) for found in dangers)
        self._until_braking, self._deceleration = self.react(
            self._until_braking, self._deceleration, demand, dt
        )
        return Control(acceleration=-self._deceleration, reason=reason)

    def reset_batch(self, egos: BatchParticipants, timestep: float, seeds: IntArray) -> None:
        """Forget the last runs."""
        n = len(seeds)
        self._waiting, self._braking = np.full(n, self.reaction), np.zeros(n)
        self._alarms = np.zeros(n, bool)

    def control_batch(self, observations: BatchObservation, dt: float) -> BatchControl:
        """`control` in many runs."""
        run, ego = observations.run, observations.ego
        ahead, found = encounters_arrays(observations)
        with np.errstate(invalid="ignore"):  # both sides of choices are worked out
            dangers = ahead & self.dangerous(found, ego)
            demands = np.where(dangers, self.demand(found, ego), 0.0)
            line_there, line = stop_line_arrays(observations)
            stops, deceleration = self.for_signal(line)
        danger, demand = dangers.any(axis=0), demands.max(axis=0, initial=0.0)
        waiting, braking = self.react(self._waiting[run], self._braking[run], demand, dt)
        # Reaction time runs in danger only: single runs call `react` only then.
        self._waiting[run] = np.where(danger, waiting, self._waiting[run])
        self._braking[run] = np.where(danger, braking, self._braking[run])
        self._alarms[run] |= danger
        stops = line_there & stops & ~danger
        wanted = np.where(danger, -braking, np.where(stops, -deceleration, 0.0))
        return BatchControl(wanted, self._alarms[run] | stops)

    def dangerous(self, found: AheadParticipant, ego: Moving) -> Any:
        """Whether a participant ahead calls for a reaction; of numbers or arrays."""
        raise NotImplementedError

    def demand(self, found: AheadParticipant, ego: Moving) -> Any:
        """Deceleration that a dangerous participant calls for, m/s²; of numbers or arrays."""
        return HARDEST

    def for_signal(self, line: AheadParticipant) -> tuple[Any, Any]:
        """Whether a stop at a signal's line begins or goes on, and its deceleration, m/s²; of
        numbers or arrays."""
        needed = ratio(line.closing, 2.0 * (line.gap - _BEFORE_LINE), math.inf) * line.closing
        is_due = (line.gap <= 2.0 * _BEFORE_LINE) | (needed >= _FOR_SIGNALS)
        stops = (line.closing >= 0.0) & is_due  # one that reverses drives away from it
        return stops, least(needed, HARDEST)

    def react(self, waiting: Any, before: Any, demand: Any, dt: float) -> tuple[Any, Any]:
        """Reaction time that is left, and deceleration for the coming dt (s), in danger.

        Args:
            waiting: reaction time left, s.
            before: deceleration of the step before, m/s².
            demand: deceleration that the danger calls for, m/s².
        """
        # Remaining times are sums of steps, so that 0 is reached up to rounding only.
        late = waiting > ROUNDING
        return choose(late, waiting - dt, waiting), choose(
            late, self.release, least(before + self.jerk * dt, demand)
        )


@dataclass
class CarefulCompetent(ReferenceDriver):
    """Reacts to entities in its path below a critical time to collision (see
    `runner.systems.kinds.reference`).

    Args:
        reaction: time before it brakes, s.
        release: deceleration with the foot off the pedal, m/s².
        critical: time to collision, s.
    """

    reaction: float = 0.75
    release: float = 0.4
    # UN R157, Annex 4, Appendix 3: lateral overlap, and a TTC below 2 s.
    critical: float = 2.0

    def dangerous(self, found: AheadParticipant, ego: Moving) -> Any:
        """Return whether an entity is in the way, and reached within the critical time."""
        return (found.aside <= ROUNDING) & (found.time_to_collision <= self.critical)


@dataclass
class Regulation157(ReferenceDriver):
    """Reacts to entities less than a lateral distance away and nearer in time than the braking to
    their speed takes.

    Danger is: lateral gap ≤ `lateral`, and TTC ≤ Δv/(2·`brake`) + `reaction` + 0.1 s. For an entity
    beside the ego, the time since their bumpers met counts as TTC, as in the JRC's implementation:
    it brakes only for those that have just come beside it.

    Args:
        reaction: time before it brakes, s.
        brake: deceleration, m/s², without build-up.
        lateral: lateral gap from which on a participant counts as cutting in, m.
    """

    # UN R157, 5.2.5.2: 0.35 s and 6 m/s².
    reaction: float = 0.35
    brake: float = 6.0
    lateral: float = 0.5
    jerk: ClassVar[float] = math.inf

    def dangerous(self, found: AheadParticipant, ego: Moving) -> Any:
        """Whether a participant cuts in nearer than the regulation grants."""
        enough = found.closing / (2.0 * self.brake) + self.reaction + 0.1
        near = (found.closing > 0.0) & (abs(found.gap) <= enough * found.closing)
        return near & (found.aside <= self.lateral + ROUNDING)

    def demand(self, found: AheadParticipant, ego: Moving) -> Any:
        """Deceleration, constant for all participants, m/s²."""
        return self.brake


@dataclass
class SafeDistance(ReferenceDriver):
    """Reacts while the longitudinal and the lateral gap to a participant are both less than RSS
    asks for.

    The ego keeps its lane, so that laterally only the other one moves within its response time.

    Args:
        reaction: time before it brakes, s.
        parameters: name of the RSS parameter set.
    """

    reaction: float = 0.75
    parameters: str = "r157"
    _set: RssParameters = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self._set = parameter_set(self.parameters)

    def dangerous(self, found: AheadParticipant, ego: Moving) -> Any:
        """Return whether an entity is less than both safe distances away."""
        aside = lateral_distance(abs(found.approach), 0.0, self._set.response, 0.0, self._set)
        ahead = longitudinal_distance(ego.speed, found.speed, self._set)
        return (found.aside < aside) & (found.gap < ahead)


def _between(value: Any, safe: Any, unsafe: Any) -> Any:
    """0 from `safe` on, 1 below `unsafe`, linear between."""
    between = ratio(safe - value, safe - unsafe, 0.0)
    return choose(value > safe, 0.0, choose(value < unsafe, 1.0, between))


@dataclass
class FuzzySafety(ReferenceDriver):
    """Brakes by the fuzzy proactive (PFS) and critical (CFS) safety metrics.

    PFS compares the gap with what is needed if the one ahead brakes suddenly, CFS with what is
    needed at constant speed of the one ahead. The deceleration is `comfortable` + CFS·(`hard` −
    `comfortable`) where CFS > 0, else PFS·`comfortable`, built up as fast as a human can. It reacts
    to entities in its path, or entering it before the ego could have passed.

    Source: Mattas, Makridis, Botzoris, Kriston, Minarini, Papadopoulos, Re, Rognelund, Ciuffo,
    "Fuzzy Surrogate Safety Metrics for real-time assessment of rear-end collision risk" (Accident
    Analysis and Prevention 148, 2020).

    Args:
        reaction: time before it brakes, s.
        comfortable, hard: its own decelerations, m/s².
        other: deceleration that the one ahead may apply, m/s².
        margin: gap at standstill, m; kept once more where braking is comfortable.
        ahead_of_time: it also reacts to entities entering its path up to this time (s) after the
            ego could have passed.
    """

    reaction: float = 0.75
    comfortable: float = 4.0
    hard: float = 6.0
    other: float = 7.0
    margin: float = 2.0
    ahead_of_time: float = 0.1

    def dangerous(self, found: AheadParticipant, ego: Moving) -> Any:
        """Return whether an entity is in the way or about to be, and not safe by one of the
        metrics."""
        return self._in_the_way(found) & (
            (self.critical(found, ego) > 0.0) | (self.proactive(found, ego) > 0.0)
        )

    def _in_the_way(self, found: AheadParticipant) -> Any:
        # Without closing it is never passed: nothing then enters before that.
        comes, passed = (
            ratio(found.aside, found.approach, math.inf),
            ratio(found.gap + found.length, found.closing, -math.inf),
        )
        enters = (found.approach > 0.0) & (comes <= passed + self.ahead_of_time)
        return (found.aside <= ROUNDING) | enters

    def proactive(self, found: AheadParticipant, ego: Moving) -> Any:
        """PFS, 0 (safe) to 1."""
        u, own = ego.speed, found.speed
        reaction, its = u * self.reaction, own * own / (2.0 * self.other)
        safe = reaction + u * u / (2.0 * self.comfortable) - its + self.margin
        return _between(found.gap - self.margin, safe, reaction + u * u / (2.0 * self.hard) - its)

    def critical(self, found: AheadParticipant, ego: Moving) -> Any:
        """CFS, 0 (safe) to 1."""
        acceleration = greatest(ego.acceleration, -self.comfortable)
        left = found.closing + acceleration * self.reaction
        within = (found.closing + 0.5 * acceleration * self.reaction) * self.reaction
        # Speeds become equal within the reaction time: the ego's own braking then decides.
        stopping = ratio(found.closing**2, 2.0 * abs(ego.acceleration), math.inf)
        moving = _between(
            found.gap,
            within + left * left / (2.0 * self.comfortable),
            within + left * left / (2.0 * self.hard),
        )
        standing = choose(found.gap < stopping, 1.0, 0.0)
        return choose(found.closing <= 0.0, 0.0, choose(left < 0.0, standing, moving))

    def demand(self, found: AheadParticipant, ego: Moving) -> Any:
        """The more, the less safe, m/s²; no human brakes harder than `HARDEST`."""
        critical = self.critical(found, ego)
        hard = self.comfortable + critical * (self.hard - self.comfortable)
        gentle = self.proactive(found, ego) * self.comfortable
        return least(choose(critical > 0.0, hard, gentle), HARDEST)
