"""AssignControllerAction, ActivateControllerAction and OverrideControllerValueAction.

How controllers and systems under test combine is said in `runner.systems.drivers`. A controller of
any other entity is a program that is not at hand: assigning and activating it is written to the
event log, the entity goes on as scripted.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from runner.engine.compile.array_protocols import ArrayProcess
from runner.engine.compile.element import PrivateAction
from runner.engine.compile.registry import action
from runner.engine.participants.entity import Entity
from xosc.document.node import Node
from xosc.rules.references import CONTROLLER_UID

if TYPE_CHECKING:
    from runner.engine.compile.array_protocols import ArrayRun
    from runner.engine.compile.protocols import Run
    from runner.engine.compile.registry import Context
    from runner.engine.participants.rows import EntityRows
    from schemas.common.array_types import BoolArray

_DOMAINS = ("longitudinal", "lateral", "lighting", "animation")
_PEDALS = ("Throttle", "Brake", "Clutch", "ParkingBrake")
_AUTOMATIC_GEARS = {"r": -1.0, "n": 0.0, "p": 0.0, "d": 1.0}
_INPUTS = ("Throttle", "Brake", "Clutch", "ParkingBrake", "SteeringWheel", "Gear")


def _activate(actor: Entity, domains: dict[str, bool], run: Run) -> None:
    if not domains:
        return
    if actor.controls.driver is not None:
        actor.controls.driver.hand_over(domains)
    actor.controls.activated |= any(domains.values())
    for domain, active in domains.items():
        run.note(
            "controller",
            actor.name,
            f"{'activated' if active else 'deactivated'} in the {domain} domain",
        )


@action("AssignControllerAction")
@dataclass(frozen=True, slots=True)
class AssignControllerAction(PrivateAction):
    """Gives an entity a controller, and activates it in the domains named
    (deactivated by default).
    """

    name: str
    properties: dict[str, str]
    switches: dict[str, bool]

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> AssignControllerAction:
        """Build from an AssignControllerAction element (its controller inline, or inlined from a
        catalogue)."""
        controller = node.find("Controller") or node.find("ObjectController", "Controller")
        if controller is None:
            raise node.invalid(
                "a Controller, ObjectController or CatalogReference is expected inside"
            )
        properties = {p.get("name"): p.get("value") for p in controller.iter("Property")}
        named = {
            d: node.bool(f"activate{d.capitalize()}")
            for d in _DOMAINS
            if node.has(f"activate{d.capitalize()}")
        }
        return cls(controller.get("name"), properties, named)

    @property
    def activates_controller(self) -> bool:
        """Whether this decides when the system under test drives."""
        return bool(self.switches)

    def start(self, actor: Entity, run: Run) -> None:
        """Assign at once."""
        actor.controls.controllers[self.name] = dict(self.properties)
        run.note("controller", actor.name, f"assigned {self.name}")
        _activate(actor, self.switches, run)

    def in_arrays(self, actor: EntityRows, run: ArrayRun) -> ArrayProcess:
        """Activate: an assigned controller has no other effect."""
        return _Activation(self.switches, actor, run)


@action("ActivateControllerAction")
@dataclass(frozen=True, slots=True)
class ActivateControllerAction(PrivateAction):
    """Activates or deactivates the entity's controller in the domains named; the others stay as
    they are."""

    switches: dict[str, bool]

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> ActivateControllerAction:
        """Build from an ActivateControllerAction element."""
        name = node.get("objectControllerRef", node.get("controllerRef", ""))
        if name and all(
            name != controller.get("name", "")
            for controller in context.document.node.iter("Controller")
        ):
            context.repair(
                node, CONTROLLER_UID, f"there is no controller {name!r}; the entity's own is meant"
            )
        return cls({domain: node.bool(domain) for domain in _DOMAINS if node.has(domain)})

    @property
    def activates_controller(self) -> bool:
        """Whether this decides when the system under test drives."""
        return True

    def start(self, actor: Entity, run: Run) -> None:
        """Activate or deactivate at once."""
        _activate(actor, self.switches, run)

    def in_arrays(self, actor: EntityRows, run: ArrayRun) -> ArrayProcess:
        """The same, in many runs."""
        return _Activation(self.switches, actor, run)


class _Activation(ArrayProcess):
    """Activation of controllers in many runs."""

    def __init__(self, switches: dict[str, bool], actor: EntityRows, run: ArrayRun) -> None:
        super().__init__(run)
        self._switches, self._actor, self._run = switches, actor, run

    def start(self, rows: BoolArray) -> BoolArray:
        """Activate or deactivate at once."""
        run = self._run
        if self._actor is run.ego and run.driver is not None:
            run.driver.hand_over(rows, self._switches)
        if any(self._switches.values()):
            self._actor.activated |= rows
        return np.zeros_like(rows)


@action("OverrideControllerValueAction")
@dataclass(frozen=True, slots=True)
class OverrideControllerValueAction(PrivateAction):
    """Overrides inputs of the entity's controller: they replace the requests of a system under
    test.

    Throttle, brake and parking brake (0 to 1 of the vehicle's `Performance`) act on the ego while a
    system under test drives it; clutch, gear and steering wheel are written to the event log and
    shown to the system under test.
    """

    inputs: dict[str, float | None]
    """input → value; None ends its override"""

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> OverrideControllerValueAction:
        """Build from an OverrideControllerValueAction element."""
        inputs: dict[str, float | None] = {}
        for child in node.children():
            if child.tag not in _INPUTS:
                raise child.unsupported("this controller input is not known to the runner")
            inputs[child.tag] = _input(child) if child.bool("active") else None
        return cls(inputs)

    def start(self, actor: Entity, run: Run) -> None:
        """Override at once."""
        overrides = {**actor.controls.overrides, **self.inputs}
        actor.controls.overrides = MappingProxyType(
            {name: value for name, value in overrides.items() if value is not None}
        )
        for name, value in self.inputs.items():
            run.note(
                "override",
                actor.name,
                f"{name} {'released' if value is None else format(value, 'g')}",
            )


def _input(node: Node) -> float:
    """Value of an override: a share of the pedal, a gear's number; since 1.2 brakes and gears have
    it in a child.

    Raises:
        Unsupported: a brake force, which says nothing about the pedal.
    """
    inner = node.children()
    detail = inner[0] if inner else node
    if detail.tag == "BrakeForce":
        raise detail.unsupported(
            "a brake force can't be converted to a share of the pedal; use BrakePercent"
        )
    if detail.tag == "AutomaticGear":
        return _AUTOMATIC_GEARS[detail.choice("gear", _AUTOMATIC_GEARS)]
    value = float(detail.finite("number" if detail.has("number") else "value"))
    if node.tag in _PEDALS and not 0.0 <= value <= 1.0:
        raise detail.invalid(f"value={value:g} must be from 0 to 1")
    return value
