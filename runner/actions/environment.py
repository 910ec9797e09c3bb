"""EnvironmentAction: nothing of it can be seen in SUMO; conditions and systems under test see it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from runner.contracts.action import GlobalAction
from runner.contracts.registry import action
from runner.interpreter.environment import Environment
from xosc.node import Node

if TYPE_CHECKING:
    from runner.interpreter.compiler import Context
    from runner.interpreter.simulation import Simulation


@action("EnvironmentAction")
@dataclass(frozen=True, slots=True)
class EnvironmentAction(GlobalAction):
    """Sets time of day, weather and road condition, as far as its Environment names them."""

    environment: Node

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> EnvironmentAction:
        """Build from an EnvironmentAction element; its values are checked here."""
        environment = node.need("Environment")
        Environment().apply(environment, 0.0)
        return cls(environment)

    def start(self, sim: Simulation) -> None:
        """Apply at once."""
        sim.environment.apply(self.environment, sim.time)
        sim.note("environment", sim.environment.name, f"friction {sim.environment.friction:g}")
