"""Conditions on time, on values (OpenSCENARIO XML 1.3, ByValueCondition), and on the state of
storyboard elements."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from typing import TYPE_CHECKING

import numpy as np

from runner.engine.compile.element import AWAKE, UNDISTURBED, Condition, Dormancy
from runner.engine.compile.protocols import ElementState, StoryboardElement, Transition
from runner.engine.compile.registry import condition
from runner.engine.conditions.comparison import RULES, TOLERANCE, Comparison, compared
from runner.engine.worlds.surroundings import read_date
from schemas.expressions.columns import NotInArrays, NumberColumn
from schemas.expressions.values import Value, number
from schemas.expressions.values import holds as compare
from xosc.document.node import Node, names_of, nearest
from xosc.resolve.parameters import typed_value
from xosc.rules.values import DECLARED_TYPE_UID

if TYPE_CHECKING:
    from runner.engine.compile.array_protocols import ArrayRun, ElementRows, NamedValue
    from runner.engine.compile.protocols import Instant
    from runner.engine.compile.registry import Context
    from schemas.common.array_types import BoolArray
    from xosc.resolve.parameters import ParameterDeclaration


@condition("SimulationTimeCondition")
class SimulationTimeCondition(Condition):
    """Compares the simulation time (s).

    In scenarios for CARLA the time counts from when the trigger begins to wait (`measure_from`).
    """

    def __init__(self, comparison: Comparison) -> None:
        self.comparison = comparison
        self.stays_true = comparison.symbol in (">", "≥")
        self._since = 0.0

    def reset(self) -> None:
        """Count from the beginning of the run."""
        super().reset()
        self._since = 0.0

    def measure_from(self, run: Instant) -> None:
        """Count from now on."""
        self._since = run.time

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> SimulationTimeCondition:
        """Read rule and value."""
        return cls(Comparison.from_xml(node, "s"))

    def dormant_until(self, run: Instant) -> Dormancy:
        """Return the time at which the condition becomes true; then it stays so."""
        if not self.stays_true:
            return AWAKE
        begin = self._since + self.comparison.value - 2.0 * TOLERANCE
        return Dormancy() if self.evaluate(run) else Dormancy(begin)

    def evaluate(self, run: Instant) -> bool:
        """Whether the comparison is true now."""
        return self.comparison.holds(run.time - self._since)

    def in_arrays(self, run: ArrayRun) -> Callable[[], BoolArray]:
        """The comparison, whose value may vary between the runs."""
        return lambda: self.comparison.holds_arrays(np.full(run.n, run.time), run)

    def describe(self, run: Instant) -> str:
        """The simulation time."""
        return self.comparison.describe("simulation time", run.time - self._since)


@condition("TimeOfDayCondition")
class TimeOfDayCondition(Condition):
    """Compares the date and time that an EnvironmentAction has set, which moves with the simulation
    if animated.

    False while none has been set.
    """

    def __init__(self, rule: str, value: datetime) -> None:
        self.rule = rule
        self.value = value

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> TimeOfDayCondition:
        """Read rule and dateTime."""
        return cls(node.choice("rule", RULES), read_date(node, "dateTime"))

    def evaluate(self, run: Instant) -> bool:
        """Whether the comparison is true now; the tolerance is that of times."""
        now = run.environment.time_of_day(run.time)
        return now is not None and Comparison(self.rule, 0.0).holds(
            (now - self.value).total_seconds()
        )

    def in_arrays(self, run: ArrayRun) -> Callable[[], BoolArray]:
        """The comparison, the same in all runs."""
        return lambda: np.full(run.n, self.evaluate(run.single))

    def describe(self, run: Instant) -> str:
        """The time of day."""
        now = run.environment.time_of_day(run.time)
        seen = now.isoformat(timespec="milliseconds") if now is not None else "undefined"
        return f"time of day = {seen} {RULES[self.rule].symbol} {self.value.isoformat()}"


class _Expected:
    """`value rule expected` for values of any type: numbers with the tolerance, all else exactly.

    Order between texts is defined only where both are numbers; without it the comparison is false.

    Args:
        text: whether the value is declared as a text: it is equal to the same text alone.
    """

    def __init__(self, rule: str, expected: Value, text: bool = False) -> None:
        self.rule = rule
        self.expected = expected
        equality = text and rule in ("equalTo", "notEqualTo")
        self._number = None if equality else _as_number(expected)
        self._comparison = Comparison(rule, self._number) if self._number is not None else None
        self._true: list[bool] = []
        """for each value that occurs in many runs"""

    def holds(self, value: Value) -> bool:
        """Whether the comparison is true."""
        if self._comparison is not None:
            seen = _as_number(value)
            if seen is not None:
                return self._comparison.holds(seen)
        try:
            return compare(self.rule, value, self.expected)
        except ValueError:
            return False

    def holds_arrays(self, named: NamedValue, run: ArrayRun) -> BoolArray:
        """`holds` for the values of many runs (n,)."""
        found: BoolArray
        if not isinstance(self.expected, NumberColumn):
            self._true += [self.holds(value) for value in named.values[len(self._true) :]]
            found = np.array(self._true)[named.index]
            return found
        assert self._comparison is not None
        numbers = [_as_number(value) for value in named.values]
        if None in numbers:
            raise NotInArrays("texts are compared with a number that varies")
        return self._comparison.holds_arrays(np.array(numbers, float)[named.index], run)

    def describe(self, what: str, value: Value | None) -> str:
        """Describe a comparison."""
        seen = "undefined" if value is None else str(value)
        wanted = f"{RULES[self.rule].symbol} {self.expected}"
        return compared(what, seen, wanted, value is not None and self.holds(value))


def _as_number(value: Value) -> float | None:
    if isinstance(value, bool | datetime):
        return None
    if isinstance(value, str):
        try:
            return number(value)
        except ValueError:
            return None
    return value


class _NamedValueCondition(Condition):
    """Compares the present value of something with a name."""

    def in_arrays(self, run: ArrayRun) -> Callable[[], BoolArray]:
        """The comparison of each value that occurs."""
        named, expected = run.named(self.what, self.name), self.expected
        return lambda: expected.holds_arrays(named, run)

    what = ""

    def __init__(self, name: str, expected: _Expected) -> None:
        self.name = name
        self.expected = expected
        self._compared: tuple[Value | None, bool] = (None, False)
        """the value that was looked at last, and whether the comparison is true for it"""

    @abstractmethod
    def value(self, run: Instant) -> Value | None:
        """The present value, None where there is none."""

    def evaluate(self, run: Instant) -> bool:
        """Whether the comparison is true; false where there is no value."""
        value = self.value(run)
        before, held = self._compared
        if value is not before:
            held = value is not None and self.expected.holds(value)
            self._compared = value, held
        return held

    def describe(self, run: Instant) -> str:
        """The present value."""
        return self.expected.describe(f"{self.what} {self.name}", self.value(run))


def _declared(
    node: Node, attribute: str, declared: Mapping[str, ParameterDeclaration], context: Context
) -> tuple[str, _Expected]:
    """Name of a declared parameter or variable, and the value to compare with, read as its type
    says."""
    name = node.get(attribute)
    if name not in declared:
        raise node.invalid(f"{attribute}={name!r} is not declared in this scenario")
    rule, kind = node.choice("rule", RULES), declared[name].type
    try:
        expected = typed_value(node, kind, DECLARED_TYPE_UID, context.remarks)
        compare(rule, expected, expected)  # complains where the rule has no meaning for the type
    except ValueError as error:
        raise node.invalid(f"value: {error}") from None
    return name, _Expected(rule, expected, kind == "string")


@condition("ParameterCondition")
class ParameterCondition(_NamedValueCondition):
    """Compares a parameter, by its type."""

    what = "parameter"

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> ParameterCondition:
        """Read parameterRef, rule and value."""
        return cls(*_declared(node, "parameterRef", context.document.parameters, context))

    def dormant_until(self, run: Instant) -> Dormancy:
        """The next change that an action makes."""
        return UNDISTURBED

    def value(self, run: Instant) -> Value | None:
        """The parameter as it was set last."""
        return run.parameters[self.name]


@condition("VariableCondition")
class VariableCondition(_NamedValueCondition):
    """Compares a variable, by its type."""

    what = "variable"

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> VariableCondition:
        """Read variableRef, rule and value."""
        return cls(*_declared(node, "variableRef", context.document.variables, context))

    def dormant_until(self, run: Instant) -> Dormancy:
        """Return a rest without a limit: an action that sets the variable wakes the condition."""
        return UNDISTURBED

    def value(self, run: Instant) -> Value | None:
        """The variable as it was set last."""
        return run.variables[self.name]


@condition("UserDefinedValueCondition")
class UserDefinedValueCondition(_NamedValueCondition):
    """Compares a value from outside the scenario: as numbers if both are numbers, else as texts."""

    what = "user-defined value"

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> UserDefinedValueCondition:
        """Read name, rule and value."""
        return cls(node.get("name"), _Expected(node.choice("rule", RULES), node.get("value")))

    def value(self, run: Instant) -> Value | None:
        """The value, None while none has been given."""
        return run.user_values.get(self.name)

    def in_arrays(self, run: ArrayRun) -> Callable[[], BoolArray]:
        """False: nothing outside gives values to many runs."""
        return lambda: np.zeros(run.n, bool)


class _SignalCondition(Condition):
    """Compares the state of something about traffic signals with a name."""

    what = ""

    def __init__(self, name: str, expected: str) -> None:
        self.name = name
        self.expected = expected

    @abstractmethod
    def state(self, run: Instant) -> str | None:
        """The present state."""

    def evaluate(self, run: Instant) -> bool:
        """Whether the state is the expected one."""
        return self.state(run) == self.expected

    def describe(self, run: Instant) -> str:
        """The present state."""
        return (
            f"{self.what} {self.name} is {self.state(run) or 'undefined'}, {self.expected} expected"
        )


@condition("TrafficSignalCondition")
class TrafficSignalCondition(_SignalCondition):
    """True while a traffic signal of the road network is in the state."""

    what = "traffic signal"

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> TrafficSignalCondition:
        """Read name (the signal's id) and state."""
        return cls(context.signals.signal(node, "name"), node.get("state"))

    def state(self, run: Instant) -> str | None:
        """The signal's state, None while nothing has set any."""
        return run.signals.states.get(self.name)


@condition("TrafficSignalControllerCondition")
class TrafficSignalControllerCondition(_SignalCondition):
    """True while a traffic signal controller is in the phase."""

    what = "traffic signal controller"

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> TrafficSignalControllerCondition:
        """Read the controller's name and the phase."""
        return cls(*context.signals.phase(node))

    def state(self, run: Instant) -> str | None:
        """The name of the present phase."""
        return run.signals.phases.get(self.name)


_KINDS = ("story", "act", "maneuverGroup", "maneuver", "event", "action")
_STATES = tuple(state.value for state in ElementState)
_TRANSITIONS = tuple(transition.value for transition in Transition)


@condition("StoryboardElementStateCondition")
class StoryboardElementStateCondition(Condition):
    """True while a storyboard element is in a state, or in the step after it made a transition.

    The element is named by its name or, where that is not unique among the elements of its type, by
    the end of its path (`Act::Group::Maneuver::Event`). Of several that a name fits, the one meant
    is that nearest to the condition: within the same maneuver, else the same group, act or story
    (maneuvers from catalogues may be used more than once).
    """

    element: StoryboardElement
    around: bool = False
    """whether the element contains the condition: then it has always done its part of a step before
    the condition looks"""

    def __init__(self, state: str) -> None:
        self.state = state
        self._is_state = state in _STATES

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> StoryboardElementStateCondition:
        """Read reference, type and state; the element is looked up once the
        storyboard is complete.
        """
        kind = node.choice("storyboardElementType", _KINDS)
        name = node.get("storyboardElementRef")
        self = cls(node.choice("state", _STATES + _TRANSITIONS))

        def find() -> None:
            self.element = find_element(node, name, kind, context.storyboard_elements())
            own = self.element.names
            self.around = names_of(node.element)[: len(own)] == own

        context.late(find)
        return self

    def dormant_until(self, run: Instant) -> Dormancy:
        """Return a rest without a limit from the first step on: a change of state ends it."""
        return UNDISTURBED if run.step_index > 0 else AWAKE

    def evaluate(self, run: Instant) -> bool:
        """Whether the element was in the state, or had made the transition, when this step began.

        Elements that contain the condition are seen as they are now: an event can start in the very
        step of its act.
        """
        element = self.element
        if self._is_state:
            return self.state == (element.state if self.around else element.seen_state)
        if (
            self.around and run.step_index > 0
        ):  # before the first step, stories have started already
            return self.state in element.transitions
        return self.state in element.seen_transitions or (
            self.around and self.state in element.transitions
        )

    def in_arrays(self, run: ArrayRun) -> Callable[[], BoolArray]:
        """The element's states and transitions."""
        element: ElementRows

        from runner.engine.compile.array_protocols import STATES, TRANSITIONS

        def find() -> None:
            nonlocal element
            element = run.element(self.element)

        def evaluate() -> BoolArray:
            found: BoolArray
            if self._is_state:
                seen = element.state if self.around else element.seen_state
                found = seen == STATES[ElementState(self.state)]
                return found
            wanted = TRANSITIONS[Transition(self.state)]
            if self.around and run.step_index > 0:
                found = (element.transitions & wanted) != 0
                return found
            seen = element.seen_transitions | (element.transitions if self.around else 0)
            found = (seen & wanted) != 0
            return found

        run.late(find)
        return evaluate

    def describe(self, run: Instant) -> str:
        """The element's state and transitions."""
        element = self.element
        seen = ", ".join((str(element.seen_state), *element.seen_transitions))
        return f"{element.kind} {element.path} is in {seen}, {self.state} expected"


def find_element(
    node: Node, name: str, kind: str, elements: Sequence[StoryboardElement]
) -> StoryboardElement:
    """Return the only storyboard element of a type that a name or the end of a path refers to.

    Raises:
        InvalidFile: there is none, or more than one are equally near to the condition.
    """
    found = nearest(
        name, names_of(node.element), [(e.names, e) for e in elements if e.kind == kind]
    )
    if not found:
        raise node.invalid(f"storyboardElementRef={name!r} is no {kind} of this storyboard")
    if len(found) > 1:
        paths = ", ".join(e.path for e in found[:4])
        raise node.invalid(
            f"storyboardElementRef={name!r} is ambiguous: {paths}; name it with those "
            "around it, as a path"
        )
    return found[0]
