"""Actions on parameters, variables and monitors."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from runner.actions.base import GlobalAction
from runner.registry import action
from xosc.node import Node
from xosc.values import Value, typed

if TYPE_CHECKING:
    from runner.scenario import Context
    from runner.simulation import Simulation

_NUMBERS = ("double", "int", "unsignedInt", "unsignedShort")
_CHANGES: dict[str, Callable[[float, float], float]] = {"AddValue": operator.add, "MultiplyByValue": operator.mul}


class _ValueAction(GlobalAction):
    """What actions on parameters and on variables share: the two differ in the table that they change."""

    store: ClassVar[str]
    name: str

    def write(self, sim: Simulation, value: Value) -> None:
        """Put a value into the table."""
        getattr(sim, self.store)[self.name] = value
        sim.note(self.store.removesuffix("s"), self.name, f"set to {value}")


def _declared(node: Node, declared: Mapping[str, str], what: str) -> tuple[str, str]:
    """Name and type of the parameter or variable that the enclosing element refers to."""
    above = node.parent
    assert above is not None
    name = above.get(f"{what}Ref")
    if name not in declared:
        raise above.invalid(f"{what}Ref={name!r} is not a {what} that the scenario declares")
    return name, declared[name]


def _literal(node: Node, kind: str) -> Value:
    try:
        return typed(kind, node.get("value"))
    except ValueError as error:
        raise node.invalid(f"value: {error}") from None


def _change(node: Node, kind: str, what: str) -> tuple[Callable[[float, float], float], float]:
    if kind not in _NUMBERS:
        raise node.invalid(f"only numbers can be modified, this {what} is a {kind}")
    rule = node.need("Rule").only()
    if rule.tag not in _CHANGES:
        raise rule.invalid(f"{' or '.join(_CHANGES)} is expected")
    return _CHANGES[rule.tag], rule.finite("value")


def _modified(kind: str, value: float) -> Value:
    return value if kind == "double" else round(value)


@dataclass(frozen=True)
class _Set(_ValueAction):
    name: str
    value: Value

    def start(self, sim: Simulation) -> None:
        """Set the value at once."""
        self.write(sim, self.value)


@dataclass(frozen=True)
class _Modify(_ValueAction):
    name: str
    kind: str
    change: Callable[[float, float], float]
    operand: float

    def start(self, sim: Simulation) -> None:
        """Modify the value at once; integers stay integers."""
        before = getattr(sim, self.store)[self.name]
        self.write(sim, _modified(self.kind, self.change(float(before), self.operand)))


@action("ParameterAction/SetAction")
class ParameterSetAction(_Set):
    """Sets a parameter; ParameterConditions see it (deprecated by the standard in favour of variables)."""

    store = "parameters"

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> ParameterSetAction:
        """Build from the SetAction of a ParameterAction."""
        name, kind = _declared(node, context.parameter_types, "parameter")
        return cls(name, _literal(node, kind))


@action("ParameterAction/ModifyAction")
class ParameterModifyAction(_Modify):
    """Adds to or multiplies a parameter."""

    store = "parameters"

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> ParameterModifyAction:
        """Build from the ModifyAction of a ParameterAction."""
        name, kind = _declared(node, context.parameter_types, "parameter")
        return cls(name, kind, *_change(node, kind, "parameter"))


@action("VariableAction/SetAction")
class VariableSetAction(_Set):
    """Sets a variable."""

    store = "variables"

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> VariableSetAction:
        """Build from the SetAction of a VariableAction."""
        name, kind = _declared(node, context.variable_types, "variable")
        return cls(name, _literal(node, kind))


@action("VariableAction/ModifyAction")
class VariableModifyAction(_Modify):
    """Adds to or multiplies a variable."""

    store = "variables"

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> VariableModifyAction:
        """Build from the ModifyAction of a VariableAction."""
        name, kind = _declared(node, context.variable_types, "variable")
        return cls(name, kind, *_change(node, kind, "variable"))


@action("SetMonitorAction")
@dataclass(frozen=True, slots=True)
class SetMonitorAction(GlobalAction):
    """Sets a monitor; its values over time are in the event log."""

    name: str
    value: bool

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> SetMonitorAction:
        """Build from a SetMonitorAction element."""
        name = node.get("monitorRef")
        if name not in context.monitors:
            raise node.invalid(f"monitorRef={name!r} is not a monitor that the scenario declares")
        return cls(name, node.bool("value"))

    def start(self, sim: Simulation) -> None:
        """Set the monitor at once."""
        sim.monitors[self.name] = self.value
        sim.note("monitor", self.name, f"set to {str(self.value).lower()}")
