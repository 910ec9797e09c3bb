"""Contract of positions: an object that resolves to a place in a run."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from runner.contracts.run import Surroundings
    from runner.motion.placement import Placement
    from runner.participants.entity import Entity
    from xosc.node import Node


class Position(ABC):
    """A position of the standard.

    Attributes:
        node: its element, for complaints.
        fixed: where it is, for positions that are the same throughout every run.
        oriented: whether the file prescribes an orientation.
        grounded: whether the height is that of the road's surface.
    """

    def __init__(self, node: Node) -> None:
        self.node = node
        self.fixed: Placement | None = None
        self.oriented = node.find("Orientation") is not None
        self.grounded = True

    @abstractmethod
    def resolve(self, run: Surroundings | None, actor: Entity | None = None) -> Placement:
        """Return the current place.

        Args:
            run: the run; positions with `fixed` need none.
            actor: the entity concerned, for shapes that begin where it is.

        Raises:
            InvalidFile: there is no such place at the moment: with the line of the position's element.
        """

    def references(self) -> tuple[Entity, ...]:
        """Entities whose place must be known before this position can be resolved."""
        return ()

    def current(self, entity: Entity) -> Entity:
        """The entity referred to, once it has a place."""
        if not entity.placed:
            raise self.node.invalid(f"the position is relative to {entity.name!r}, which has no position yet")
        return entity


class FixedPosition(Position):
    """A position that does not depend on anything that happens."""

    fixed: Placement

    def __init__(self, node: Node, placement: Placement) -> None:
        super().__init__(node)
        self.fixed = placement

    def resolve(self, run: Surroundings | None, actor: Entity | None = None) -> Placement:
        """The place."""
        return self.fixed
