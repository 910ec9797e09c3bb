"""The one door to a simulator: what the interpreter asks of a world, and nothing more.

The interpreter owns every scripted participant and tells the world where it is (`mirror`); participants that the
world's own driver moves are read back (`read`). A world knows nothing of storyboards.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple, Protocol

from runner.entities import Entity
from xodr.network import RoadNetwork


class Reading(NamedTuple):
    """State of a participant that the world moves: reference point (m), heading (rad), speed (m/s)."""

    x: float
    y: float
    z: float
    h: float
    speed: float


class World(Protocol):
    """A simulator that participants live in."""

    name: str

    def open(self, network: RoadNetwork | None, timestep: float, seed: int) -> None:
        """Load the road network and stand at time 0."""
        ...

    def add(self, entity: Entity) -> None:
        """Bring a participant into the world at its present pose."""
        ...

    def remove(self, entity: Entity) -> None:
        """Take a participant out of the world."""
        ...

    def drive(self, entity: Entity) -> None:
        """Hand a participant to the world's own driver, at its present pose and speed."""
        ...

    def release(self, entity: Entity) -> None:
        """Take a participant back from the world's own driver."""
        ...

    def set_speed(self, entity: Entity, speed: float | None) -> None:
        """Prescribe the speed (m/s) of a driven participant; None lets the world's driver choose."""
        ...

    def show(self, entity: Entity, visible: bool) -> None:
        """Let the world's own drivers see a scripted participant, or not (VisibilityAction, traffic)."""
        ...

    def mirror(self, entities: Iterable[Entity]) -> None:
        """Show the world where scripted participants are at the end of the coming step."""
        ...

    def step(self) -> None:
        """Advance by one time step."""
        ...

    def read(self, entity: Entity) -> Reading | None:
        """State of a driven participant; None once it has left the world."""
        ...

    def close(self) -> None:
        """Free the simulator."""
        ...
