"""A world without a simulator: scripted participants only, for tests and quick looks."""

from __future__ import annotations

from collections.abc import Iterable

from runner.participants.entity import Entity
from runner.worlds.base import DriverRequest, Reading
from xodr.network import RoadNetwork


class KinematicWorld:
    """Holds and moves no one; the interpreter's own motion is all there is."""

    name = "kinematic"

    def open(self, network: RoadNetwork | None, timestep: float, seed: int) -> str:
        """Nothing to load."""
        return ""

    def add(self, entity: Entity) -> None:
        """Nothing to add."""

    def remove(self, entity: Entity) -> None:
        """Nothing to remove."""

    def drive(self, entity: Entity) -> bool:
        """Refused: there is no driver here."""
        raise entity.declared.unsupported(f"the kinematic world has no driver of its own for {entity.name!r}; run on SUMO")

    def release(self, entity: Entity) -> None:
        """Nothing to release."""

    def ask(self, entity: Entity, request: DriverRequest) -> None:
        """No one is driven here."""

    def show(self, entity: Entity, visible: bool) -> None:
        """No one looks."""

    def signal(self, signal_id: str, state: str) -> bool:
        """No one looks."""
        return True

    def mirror(self, entities: Iterable[Entity]) -> None:
        """No one looks."""

    def step(self) -> None:
        """Time is the interpreter's."""

    def read(self, entity: Entity) -> Reading | None:
        """No one is driven here."""
        return None

    def close(self) -> None:
        """Nothing to free."""


class RehearsalWorld(KinematicWorld):
    """For the beginning of a run only: no step is made, so whoever is to be driven may wait for it."""

    def drive(self, entity: Entity) -> bool:
        """No one is driven yet."""
        return True
