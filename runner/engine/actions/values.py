"""Actions on parameters, variables and monitors, custom commands, and actions on the environment
and traffic signals.

The first three differ in the table that they change. Conditions, systems under test and SUMO's
drivers see the others.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, MutableMapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from runner.engine.compile.array_protocols import ArrayProcess
from runner.engine.compile.element import GlobalAction
from runner.engine.compile.registry import action
from runner.engine.worlds.surroundings import Environment
from schemas.common.errors import InvalidFile
from schemas.expressions.values import Value, typed
from xosc.document.node import Node
from xosc.resolve.parameters import typed_value
from xosc.rules.values import DECLARED_TYPE_UID

if TYPE_CHECKING:
    from runner.engine.compile.array_protocols import ArrayRun, NamedValue
    from runner.engine.compile.protocols import Run
    from runner.engine.compile.registry import Context
    from schemas.common.array_types import BoolArray, IntArray


_NUMBERS = ("double", "int", "unsignedInt", "unsignedShort")
_CHANGES: dict[str, Callable[[float, float], float]] = {
    "AddValue": operator.add,
    "MultiplyByValue": operator.mul,
}


class _Target(NamedTuple):
    """The parameter or variable that an action changes: `what` it is, its name and its type."""

    what: str
    name: str
    type: str

    @classmethod
    def of(cls, node: Node, context: Context) -> _Target:
        """Return the target of the enclosing ParameterAction or VariableAction; it must be
        declared."""
        above = node.parent
        assert above is not None
        what = above.tag.removesuffix("Action").lower()
        types = context.parameter_types if what == "parameter" else context.variable_types
        name = above.get(f"{what}Ref")
        if name not in types:
            raise above.invalid(f"{what}Ref={name!r} is not a {what} that the scenario declares")
        return cls(what, name, types[name])

    def table(self, run: Run) -> MutableMapping[str, Value]:
        """The table of values that it is in."""
        return run.parameters if self.what == "parameter" else run.variables

    def write(self, run: Run, value: Value) -> None:
        """Put a value into the table; ParameterConditions and VariableConditions see it."""
        self.table(run)[self.name] = value
        run.note(self.what, self.name, f"set to {value}")


@action("ParameterAction/SetAction", "VariableAction/SetAction")
@dataclass(frozen=True, slots=True)
class SetAction(GlobalAction):
    """Sets a parameter or variable; conditions see the value, attributes keep that of the
    beginning."""

    target: _Target
    value: Value

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> SetAction:
        """Build from the SetAction of a ParameterAction or VariableAction."""
        target = _Target.of(node, context)
        try:
            return cls(target, typed_value(node, target.type, DECLARED_TYPE_UID, context.remarks))
        except ValueError as error:
            raise node.invalid(f"value: {error}") from None

    def start(self, run: Run) -> None:
        """Set the value at once."""
        self.target.write(run, self.value)

    def in_arrays(self, run: ArrayRun) -> ArrayProcess:
        """Set, in many runs."""

        def put(named: NamedValue, rows: IntArray) -> None:
            value = run.value(self.value)
            values = value[rows].tolist() if isinstance(value, np.ndarray) else [value] * len(rows)
            named.put(rows, values)

        return _Writing(self.target, put, run)


@action("ParameterAction/ModifyAction", "VariableAction/ModifyAction")
@dataclass(frozen=True, slots=True)
class ModifyAction(GlobalAction):
    """Adds to or multiplies a parameter or variable that is a number; integers stay integers."""

    node: Node
    target: _Target
    change: Callable[[float, float], float]
    operand: float

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> ModifyAction:
        """Build from the ModifyAction of a ParameterAction or VariableAction."""
        target = _Target.of(node, context)
        if target.type not in _NUMBERS:
            raise node.invalid(
                f"only numbers can be modified, this {target.what} is a {target.type}"
            )
        rule = node.need("Rule").only()
        if rule.tag not in _CHANGES:
            raise rule.invalid(f"{' or '.join(_CHANGES)} is expected")
        return cls(node, target, _CHANGES[rule.tag], rule.finite("value"))

    def start(self, run: Run) -> None:
        """Modify the value at once."""
        before = self.target.table(run)[self.target.name]
        self.target.write(run, self.modified(before, self.operand))

    def modified(self, before: Value, operand: float) -> Value:
        """Return the value after a modification by an operand."""
        assert isinstance(before, float | int)
        after = self.change(before, operand)
        target = self.target
        try:
            return typed(target.type, repr(after if target.type == "double" else round(after)))
        except (ValueError, OverflowError):
            raise self.node.invalid(
                f"{target.what} {target.name} would become {after:g}, which is no {target.type}"
            ) from None

    def in_arrays(self, run: ArrayRun) -> ArrayProcess:
        """Modify, in many runs; one in which that gives no value is left."""

        def put(named: NamedValue, rows: IntArray) -> None:
            operands = np.broadcast_to(run.value(self.operand), run.n)
            for row in rows:
                try:
                    after = self.modified(named.values[named.index[row]], float(operands[row]))
                except InvalidFile:
                    run.leave(np.arange(run.n) == row)
                    continue
                named.put(np.array([row]), [after])

        return _Writing(self.target, put, run)


class _Writing(ArrayProcess):
    """An action on a parameter or variable in many runs.

    Args:
        put: called with it and the rows (k,) in which it gets a value.
    """

    def __init__(
        self, target: _Target, put: Callable[[NamedValue, IntArray], None], run: ArrayRun
    ) -> None:
        super().__init__(run)
        self._named, self._write, self._run = run.named(target.what, target.name), put, run

    def start(self, rows: BoolArray) -> BoolArray:
        """Write at once."""
        self._write(self._named, np.flatnonzero(rows & self._run.going))
        return np.zeros_like(rows)


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

    def start(self, run: Run) -> None:
        """Set the monitor at once."""
        run.monitors[self.name] = self.value
        run.note("monitor", self.name, f"set to {str(self.value).lower()}")

    def in_arrays(self, run: ArrayRun) -> ArrayProcess:
        """Do nothing: many runs have no event log."""
        return ArrayProcess(run)


@action("CustomCommandAction")
@dataclass(frozen=True, slots=True)
class CustomCommandAction(GlobalAction):
    """Write type and content to the event log, for the other party of the contract."""

    type: str
    content: str

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> CustomCommandAction:
        """Build from a CustomCommandAction element."""
        return cls(node.get("type"), node.text())

    def start(self, run: Run) -> None:
        """Complete at once."""
        run.note("userDefined", self.type, self.content)

    def in_arrays(self, run: ArrayRun) -> ArrayProcess:
        """Do nothing: many runs have no event log."""
        return ArrayProcess(run)


@action("EnvironmentAction")
@dataclass(frozen=True, slots=True)
class EnvironmentAction(GlobalAction):
    """Sets time of day, weather and road condition, where its Environment names them."""

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

    def in_arrays(self, run: ArrayRun) -> ArrayProcess:
        """Apply at once, in all runs: it is an initial action."""
        return _Weather(self.environment, run)


class _Weather(ArrayProcess):
    """An EnvironmentAction in many runs."""

    def __init__(self, environment: Node, run: ArrayRun) -> None:
        super().__init__(run)
        self._environment, self._run = environment, run

    def start(self, rows: BoolArray) -> BoolArray:
        """Apply; runs in which it comes later than in others are left."""
        run = self._run
        if run.time > 0.0:
            run.leave(rows)
        else:
            run.environment = run.environment.after(self._environment, run.time)
        return np.zeros_like(rows)


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
