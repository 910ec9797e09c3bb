"""EnvironmentAction and the actions on traffic signals: what conditions, systems under test and SUMO's drivers see."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from runner.contracts.element import GlobalAction
from runner.contracts.registry import action
from runner.surroundings.environment import Environment
from xosc.node import Node

if TYPE_CHECKING:
    from runner.contracts.registry import Context
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


@action("TrafficSignalStateAction")
@dataclass(frozen=True, slots=True)
class TrafficSignalStateAction(GlobalAction):
    """Puts a traffic signal into a state; a controller's next phase sets it anew."""

    signal: str
    state: str

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> TrafficSignalStateAction:
        """Build from a TrafficSignalStateAction element."""
        return cls(context.signals.signal(node, "name"), node.get("state"))

    def start(self, run: Run) -> None:
        """Set at once."""
        run.signals.set_state(run, self.signal, self.state)


@action("TrafficSignalControllerAction")
@dataclass(frozen=True, slots=True)
class TrafficSignalControllerAction(GlobalAction):
    """Lets a traffic signal controller go on from a phase, from now."""

    controller: str
    phase: str

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> TrafficSignalControllerAction:
        """Build from a TrafficSignalControllerAction element."""
        return cls(*context.signals.phase(node))

    def start(self, run: Run) -> None:
        """Switch at once."""
        run.signals.set_phase(run, self.controller, self.phase)
