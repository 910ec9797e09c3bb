"""AddEntityAction and DeleteEntityAction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from runner.contracts.action import GlobalAction
from runner.contracts.registry import action
from runner.participants.entity import Entity
from xosc.node import Node

if TYPE_CHECKING:
    from collections.abc import Iterable

    from runner.contracts.context import Context
    from runner.contracts.position import Position
    from runner.contracts.run import Run


def _entity(node: Node, context: Context) -> Entity:
    above = node.parent
    assert above is not None
    return context.entity(above)


@action("AddEntityAction")
@dataclass(frozen=True, slots=True)
class AddEntityAction(GlobalAction):
    """Brings a declared entity into the world at a position, standing; nothing happens where it is there already."""

    entity: Entity
    position: Position

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> AddEntityAction:
        """Build from an AddEntityAction element."""
        return cls(_entity(node, context), context.position(node.need("Position")))

    def puts(self) -> Iterable[tuple[Entity, Position | None]]:
        """The position."""
        return [(self.entity, self.position)]

    def start(self, run: Run) -> None:
        """Add at once."""
        if self.entity.active:
            run.note("entity", self.entity.name, "is in the scenario already")
            return
        run.activate(self.entity, self.position.resolve(run, self.entity))
        run.note("entity", self.entity.name, "added")


@action("DeleteEntityAction")
@dataclass(frozen=True, slots=True)
class DeleteEntityAction(GlobalAction):
    """Takes an entity out of the world; its actions end with it."""

    entity: Entity

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> DeleteEntityAction:
        """Build from a DeleteEntityAction element."""
        return cls(_entity(node, context))

    def start(self, run: Run) -> None:
        """Delete at once."""
        if self.entity.active:
            run.deactivate(self.entity)
            run.note("entity", self.entity.name, "deleted")
