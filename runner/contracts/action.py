"""What an action is to the storyboard: a description that starts, and something that runs.

An action class is built once from its element (`from_xml`) and holds no state. `start` applies it; what takes
simulation time comes back as a `Running`, one for each actor, with the state of this execution.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, ClassVar, Protocol

if TYPE_CHECKING:
    from collections.abc import Iterable

    from runner.interpreter.simulation import Simulation
    from runner.participants.entity import Entity
    from xosc.node import Node

LONGITUDINAL, LATERAL, LIGHTING, ANIMATION = "longitudinal", "lateral", "lighting", "animation"
"""Control domains of an entity (OpenSCENARIO XML 1.3, 6.6.1): at most one action owns each at a time."""


def need_places(node: Node, *entities: Entity) -> None:
    """Make sure that entities are somewhere before an action deals with where they are.

    Raises:
        InvalidFile: one of them has no position yet.
    """
    for entity in entities:
        if not entity.placed:
            raise node.invalid(f"{entity.name} has no position yet; a TeleportAction has to come first")


class Running(Protocol):
    """An action in execution for one actor (or for none, if global)."""

    __slots__ = ()

    def step(self, dt: float) -> bool:
        """Act on the interval from now to now + dt (s); true when the action's goal is reached at its end."""
        ...

    def stop(self) -> None:
        """Give back whatever is held, by default nothing; called once, when the action ends, is overridden or stopped."""
        return


class PrivateAction(ABC):
    """An action on one entity."""

    domains: ClassVar[tuple[str, ...]] = ()

    def claims(self) -> tuple[str, ...]:
        """Control domains that this action takes over from whatever owns them (standard 7.5.1)."""
        return self.domains

    def references(self) -> Iterable[Entity]:
        """Entities whose state `start` reads; initial actions are ordered by it."""
        return ()

    @abstractmethod
    def start(self, actor: Entity, sim: Simulation) -> Running | None:
        """Begin for this actor now; None when the action is complete at once."""


class GlobalAction(ABC):
    """An action on the simulation at large."""

    @abstractmethod
    def start(self, sim: Simulation) -> Running | None:
        """Begin now; None when the action is complete at once."""


Action = PrivateAction | GlobalAction
