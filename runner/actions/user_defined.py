"""UserDefinedAction: a contract between the scenario's author and a simulator; here it goes to the event log."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from runner.contracts.action import GlobalAction
from runner.contracts.registry import action
from xosc.node import Node

if TYPE_CHECKING:
    from runner.contracts.context import Context
    from runner.contracts.run import Run


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

    def start(self, run: Run) -> None:
        """Complete at once."""
        run.note("userDefined", self.type, self.content)
