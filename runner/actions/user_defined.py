"""UserDefinedAction: a contract between the scenario's author and a simulator; here it goes to the event log."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from runner.contracts.action import GlobalAction
from runner.contracts.registry import action
from xosc.node import Node

if TYPE_CHECKING:
    from runner.interpreter.compiler import Context
    from runner.interpreter.simulation import Simulation


@action("CustomCommandAction")
@dataclass(frozen=True, slots=True)
class CustomCommandAction(GlobalAction):
    """Writes its type and content to the event log, for whoever made the contract to read."""

    type: str
    content: str

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> CustomCommandAction:
        """Build from a CustomCommandAction element."""
        return cls(node.get("type"), node.text())

    def start(self, sim: Simulation) -> None:
        """Complete at once."""
        sim.note("userDefined", self.type, self.content)
