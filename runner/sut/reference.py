"""What the reference drivers of UN Regulation 157 have in common: they notice danger, react after a time, and brake.

Source of the models and constants: Mattas, Albano, Donà, Galassi, Suarez-Bertoa, Vass, Ciuffo, "Driver models for the
definition of safety requirements of automated vehicles in international regulations" (Accident Analysis and Prevention
174, 2022), and UN Regulation 157, Annex 4, Appendix 3. They are models of motorway driving: they brake and never steer.
"""

from __future__ import annotations

from typing import Any, ClassVar, Protocol

from runner.sut.base import Control, Observation, Participant
from runner.sut.encounters import Encounter, encounters
from runner.sut.formulas import choose, least

GRAVITY = 9.81
HARDEST = 0.774 * GRAVITY
"""Braking of a careful and competent human on a dry road, m/s²."""
JERK = 12.65
"""How fast that braking builds up, m/s³."""
ROUNDING = 1e-6
"""What is nearer to a limit than this has reached it: positions are sums of many steps."""


class Moving(Protocol):
    """What the drivers know of the ego; numbers, or arrays of them over many cases."""

    @property
    def speed(self) -> float:
        """Along the heading, m/s."""
        ...

    @property
    def acceleration(self) -> float:
        """Along the heading, m/s²."""
        ...


class ReferenceDriver:
    """Follows the scenario until a participant ahead is dangerous. From then on it brakes, after a reaction time, while there is
    danger, and keeps its speed while there is none.

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
        """Braking with the reason in danger; else the scripted speed, or after an alarm the present one."""
        dangers = [found for found in encounters(observation) if self.dangerous(found, observation.ego)]
        if not dangers:
            return Control(acceleration=0.0, reason="the danger is over") if self._alarmed else Control()
        nearest = min(dangers, key=lambda found: found.gap)
        reason = f"{nearest.name} is {nearest.gap:.1f} m ahead, {nearest.closing:.1f} m/s slower, {nearest.aside:.1f} m aside"
        self._alarmed = True
        demand = max(self.demand(found, observation.ego) for found in dangers)
        self._until_braking, self._deceleration = self.react(self._until_braking, self._deceleration, demand, dt)
        return Control(acceleration=-self._deceleration, reason=reason)

    def dangerous(self, found: Encounter, ego: Moving) -> bool:
        """Whether a participant ahead calls for a reaction."""
        raise NotImplementedError

    def demand(self, found: Encounter, ego: Moving) -> float:
        """Deceleration that a dangerous participant calls for, m/s²."""
        return HARDEST

    def react(self, waiting: Any, before: Any, demand: Any, dt: float) -> tuple[Any, Any]:
        """Reaction time that is left, and deceleration for the coming dt (s), in danger.

        Args:
            waiting: reaction time left, s.
            before: deceleration of the step before, m/s².
            demand: deceleration that the danger calls for, m/s².
        """
        late = waiting > ROUNDING
        return choose(late, waiting - dt, waiting), choose(late, self.release, least(before + self.jerk * dt, demand))
