"""EnvironmentAction: nothing of it can be seen in SUMO; conditions and systems under test see it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from runner.contracts.action import GlobalAction
from runner.contracts.registry import action
from runner.surroundings.environment import Environment
from xosc.node import Node

if TYPE_CHECKING:
    from runner.contracts.context import Context
    from runner.contracts.run import Run


@action("EnvironmentAction")
@dataclass(frozen=True, slots=True)
class EnvironmentAction(GlobalAction):
    """Sets time of day, weather and road condition, as far as its Environment names them."""

    environment: Node

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> EnvironmentAction:
        """Build from an EnvironmentAction element; its values are checked here."""
        environment = node.need("Environment")
        Environment().after(environment, 0.0)
        return cls(environment)

    def start(self, run: Run) -> None:
        """Apply at once."""
        environment = run.environment.after(self.environment, run.time)
        run.set_environment(environment)
        run.note("environment", environment.name, f"friction {environment.friction:g}")
