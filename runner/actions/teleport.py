"""TeleportAction (OpenSCENARIO XML 1.3, class TeleportAction)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from runner.contracts import registry
from runner.contracts.action import PrivateAction

if TYPE_CHECKING:
    from collections.abc import Iterable

    from runner.contracts.context import Context
    from runner.contracts.position import Position
    from runner.contracts.run import Run
    from runner.participants.entity import Entity
    from xosc.node import Node


@registry.action("TeleportAction")
class TeleportAction(PrivateAction):
    """Puts the actor at a position at once; it keeps its speed."""

    def __init__(self, position: Position) -> None:
        self.position = position

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> TeleportAction:
        """Read the position."""
        return cls(context.position(node.need("Position")))

    @property
    def places(self) -> bool:
        """It does."""
        return True

    def puts(self, actor: Entity) -> Iterable[tuple[Entity, Position | None]]:
        """The position."""
        return [(actor, self.position)]

    def references(self) -> Iterable[Entity]:
        """Entities that the position is relative to."""
        return self.position.references()

    def start(self, actor: Entity, run: Run) -> None:
        """Jump."""
        run.place(actor, self.position.resolve(run, actor))
