"""Systems under test: what they see, what they answer, and how they are found.

A system under test drives one entity, the ego. Each step it is given an `Observation` and answers with a `Control`;
what it leaves as None stays as the scenario scripts it. It never sees the storyboard.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Sequence

    from runner.interpreter.environment import Environment
    from runner.participants.entity import Entity
    from xodr.network import RoadNetwork


@dataclass(frozen=True, slots=True)
class Observation:
    """What a system under test sees at one instant.

    Args:
        time: simulation time, s.
        ego: the entity driven (state as in `runner.participants.entity`; not to be changed).
        others: every other participant that sensors can see.
        demand: speed that the scenario asks of the ego at the end of this step, m/s.
        network: the roads, or None.
        environment: what EnvironmentActions have set (weather, time of day, road condition).
    """

    time: float
    ego: Entity
    others: Sequence[Entity]
    demand: float
    network: RoadNetwork | None
    environment: Environment


@dataclass(frozen=True, slots=True)
class Control:
    """What a system under test does in this step; None leaves that domain to the scenario.

    Args:
        acceleration: along the heading, m/s².
        steering: angle of the front wheels, rad, positive to the left (kinematic bicycle).
        reason: why, for the event log, where the system intervenes.
    """

    acceleration: float | None = None
    steering: float | None = None
    reason: str = ""


class SystemUnderTest(Protocol):
    """A driver or driver assistance system: `control` is called once a step."""

    def reset(self, ego: Entity, timestep: float, seed: int) -> None:
        """Called once before the run."""
        ...

    def control(self, observation: Observation, dt: float) -> Control:
        """Decide for the coming dt (s)."""
        ...


class WorldDriven:
    """A system under test that is the world's own driver: the ego is handed to it, and there is nothing to control.

    See `runner.interpreter.ego.WorldDriver` for how that combines with what the scenario scripts.
    """

    def reset(self, ego: Entity, timestep: float, seed: int) -> None:
        """Called once before the run."""
