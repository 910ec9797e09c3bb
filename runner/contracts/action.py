"""Contract of actions: a description that starts, and an execution.

An action class is built once from its element (`from_xml`) and holds no state. `start` applies it; what takes
simulation time comes back as a `Running`, one for each actor, with the state of this execution.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, ClassVar

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from runner.contracts.position import Position
    from runner.contracts.run import Run, Running
    from runner.motion.placement import Placement
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


class PrivateAction(ABC):
    """An action on one entity."""

    domains: ClassVar[tuple[str, ...]] = ()

    @property
    def places(self) -> bool:
        """Whether it puts the actor somewhere, whatever its place is; initial actions are ordered by it."""
        return False

    @property
    def activates_controller(self) -> bool:
        """Whether it decides when a system under test drives the actor."""
        return False

    def claims(self) -> tuple[str, ...]:
        """Control domains that this action takes over from whatever owns them (standard 7.5.1)."""
        return self.domains

    def references(self) -> Iterable[Entity]:
        """Entities whose state `start` reads; initial actions are ordered by it."""
        return ()

    def puts(self, actor: Entity) -> Iterable[tuple[Entity, Position | None]]:
        """Return the entities that it teleports, with None for a place known only in a run."""
        return [(actor, None)] if self.places else []

    def check(self, actor: Entity, starts: Sequence[Placement] | None) -> None:  # noqa: B027  (most actions suit every actor)
        """Complain before any run about what this actor can never do.

        Args:
            starts: all places where actions can put the actor; None where only a run knows.

        Raises:
            InvalidFile: the action makes no sense for this actor.
        """

    @abstractmethod
    def start(self, actor: Entity, run: Run) -> Running | None:
        """Begin for this actor now; None when the action is complete at once."""


class GlobalAction(ABC):
    """An action on the simulation at large."""

    def puts(self) -> Iterable[tuple[Entity, Position | None]]:
        """Return the entities that it teleports, with None for a place known only in a run."""
        return []

    @abstractmethod
    def start(self, run: Run) -> Running | None:
        """Begin now; None when the action is complete at once."""


Action = PrivateAction | GlobalAction
