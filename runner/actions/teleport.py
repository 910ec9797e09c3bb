"""TeleportAction (OpenSCENARIO XML 1.3, class TeleportAction)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from runner.contracts import registry
from runner.contracts.action import PrivateAction

if TYPE_CHECKING:
    from collections.abc import Iterable

    from runner.interpreter.compiler import Context
    from runner.interpreter.simulation import Simulation
    from runner.participants.entity import Entity
    from runner.positions import Position
    from xosc.node import Node


@registry.action("TeleportAction")
class TeleportAction(PrivateAction):
    """Puts the actor at a position at once; it keeps its speed."""

    places = True

    def __init__(self, position: Position) -> None:
        self.position = position

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> TeleportAction:
        """Read the position."""
        return cls(context.position(node.need("Position")))

    def references(self) -> Iterable[Entity]:
        """Entities that the position is relative to."""
        return self.position.references()

    def start(self, actor: Entity, sim: Simulation) -> None:
        """Jump."""
        sim.place(actor, self.position.resolve(sim, actor))
