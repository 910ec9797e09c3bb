"""Triggers: condition groups, condition edges and delays (OpenSCENARIO XML 1.3, 7.6)."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol, Self

from runner.contracts.condition import Condition
from schemas.rules.empty_elements import UID as EMPTY
from xosc.dialects.carla import is_criterion
from xosc.node import Node

if TYPE_CHECKING:
    from runner.contracts.run import Instant
    from runner.participants.entity import Entity

EDGES = ("none", "rising", "falling", "risingOrFalling")
_EPSILON = 1e-6
_SLEEPLESS = 16
"""Steps from one try to leave conditions alone to the next; twice as many after each try in vain."""
_LONGEST = 128
"""Steps after which conditions that could not be left alone may have become such that can."""


class ConditionContext(Protocol):
    """What triggers are built with."""

    def timed_condition(self, node: Node) -> TimedCondition:
        """The condition that a Condition element is, with its edge and delay."""
        ...

    def repair(self, node: Node, rule: str, text: str) -> None:
        """See `runner.contracts.context.Context`."""
        ...


class TimedCondition:
    """A condition with its edge and delay.

    The edge compares the expression with its previous evaluation; the first evaluation has none, so it never
    is an edge (7.6.3). A delay looks up the edge-filtered value of `delay` seconds ago, false before that.
    """

    __slots__ = ("_history", "_previous", "condition", "delay", "edge", "evaluate", "keeps_memory", "name")

    def __init__(self, name: str, condition: Condition, edge: str, delay: float) -> None:
        self.name = name
        self.condition = condition
        self.edge = edge
        self.delay = delay
        self.keeps_memory = edge != "none" or delay > 0.0
        self.evaluate: Callable[[Instant], bool] = self._remembered if self.keeps_memory else condition.evaluate
        """The condition at the current time; to be called once each step."""
        self.rearm()

    @classmethod
    def from_xml(cls, node: Node, condition: Condition) -> Self:
        """Build from a Condition element and the condition inside it."""
        delay = node.finite("delay", 0.0)
        if delay < 0.0:
            raise node.invalid(f"delay={delay} must not be negative")
        edge = node.choice("conditionEdge", EDGES, "none")
        return cls(node.get("name", ""), condition, edge, delay)

    def reset(self) -> None:
        """As before a run."""
        self.condition.reset()
        self.rearm()

    def rearm(self) -> None:
        """Forget all earlier evaluations."""
        self._previous: bool | None = None
        self._history: deque[tuple[float, bool]] = deque()

    def _remembered(self, run: Instant) -> bool:
        value = self.condition.evaluate(run)
        if self.edge != "none":
            before, self._previous = self._previous, value
            rising, falling = before is False and value, before is True and not value
            value = rising if self.edge == "rising" else falling if self.edge == "falling" else rising or falling
        return self._delayed(run.time, value) if self.delay > 0.0 else value

    def _delayed(self, time: float, value: bool) -> bool:
        """The value of `delay` ago, with this one added to the history, where it is not the same as the one before."""
        history, then = self._history, time - self.delay + _EPSILON
        if not history or history[-1][1] != value:
            history.append((time, value))
        while len(history) > 1 and history[1][0] <= then:
            history.popleft()
        since, value = history[0]
        return value and since <= then

    def outlook(self, run: Instant) -> tuple[bool, float]:
        """What it will be from the next step on, and the time (s) before which that stays while `run.changes` does."""
        until = self.condition.keeps(run)
        if until <= run.time:
            return False, -math.inf
        value = self.edge == "none" and self.condition.evaluate(run)
        return self._delays(run.time, value, until) if self.delay > 0.0 else (value, until)

    def _delays(self, time: float, value: bool, until: float) -> tuple[bool, float]:
        """The outlook of a value that stays until then, once the history has no other, but for one that it has risen from."""
        history = self._history
        if not history or history[-1][1] != value or len(history) > (2 if value else 1):
            return False, -math.inf
        served = history[-1][0] + self.delay - 2.0 * _EPSILON
        waits = value and (len(history) == 2 or served > time - _EPSILON)
        return (False, min(until, served)) if waits else (value, until)

    @property
    def missed(self) -> bool:
        """Whether it waits for a rise that has been, and that there can be only one of."""
        past = self.edge == "rising" and self._previous is True and self.condition.stays_true
        return past and not any(rose for _, rose in self._history)

    def describe(self, run: Instant) -> str:
        """Why it fired: name, expression with values, edge and delay."""
        text = self.condition.describe(run)
        if self.edge != "none":
            text += f" ({self.edge})"
        if self.delay:
            text += f", {self.delay:g} s ago"
        return f"{self.name}: {text}" if self.name else text


class Trigger:
    """Condition groups, any of which fires the trigger when all its conditions are true.

    `triggering` holds the entities that made the by-entity conditions of the firing group true.
    """

    def __init__(self, groups: list[list[TimedCondition]]) -> None:
        self.groups = groups
        self.triggering: tuple[Entity, ...] = ()
        self.reason = ""
        self._look_at_all()

    @classmethod
    def from_xml(cls, node: Node | None, context: ConditionContext) -> Trigger | None:
        """Build from a StartTrigger or StopTrigger element; None where it is absent or empty.

        Criteria in a StopTrigger are no conditions (see `runner.criteria`); a group of nothing else never fires.
        """
        if node is None:
            return None
        stop = node.tag == "StopTrigger"
        groups: list[list[TimedCondition]] = []
        for group in node.children("ConditionGroup"):
            conditions = group.children("Condition")
            if not conditions:
                context.repair(group, EMPTY, "an element Condition is expected inside; without one the group is left out")
            groups.append([context.timed_condition(each) for each in conditions if not (stop and is_criterion(each))])
        groups = [group for group in groups if group]
        return cls(groups) if groups else None

    def take_any(self) -> None:
        """Fire when any condition of any group is true, as CARLA's scenario_runner does where it stops acts."""
        self.groups = [[condition] for group in self.groups for condition in group]
        self._look_at_all()

    def reset(self) -> None:
        """As before a run."""
        self._look_at_all()
        self.triggering = ()
        self.reason = ""
        for group in self.groups:
            for condition in group:
                condition.reset()

    def rearm(self) -> None:
        """Forget all earlier evaluations (the owning element enters standby anew)."""
        self._look_at_all()
        for group in self.groups:
            for condition in group:
                condition.rearm()

    def missed(self, run: Instant) -> str:
        """Why it can fire no more, with the conditions that each group waits for in vain; empty while it can."""
        vain = [[condition for condition in group if condition.missed][:1] for group in self.groups]
        return " and ".join(condition.describe(run) for (condition,) in vain) if all(vain) else ""

    def fires(self, run: Instant) -> bool:
        """Evaluate at the current time. Conditions with memory are evaluated each step, whatever the others say.

        What can't change is left alone (`_rest`) until something happens or the time has come.
        """
        over = self._resting and (run.changes != self._changes or run.time >= self._until)
        if over:
            self._look_at_all()
        fired = None
        for group, conditions, true in self._looking:
            for condition in conditions:
                if (true or condition.keeps_memory) and not condition.evaluate(run):
                    true = False
            if true and fired is None:
                fired = group
        if fired is None:
            if over or (not self._resting and run.step_index >= self._next):
                self._rest(run)
            return False
        self.triggering = tuple(dict.fromkeys(e for c in fired for e in c.condition.triggering))
        self.reason = " and ".join(condition.describe(run) for condition in fired)
        return True

    def rests(self, run: Instant) -> float:
        """Time (s) until which it does not fire, whoever asks, while `run.changes` stays; in the past where that is not known."""
        known = self._resting and not self._looking and self._changes == run.changes
        return self._until if known else -math.inf

    def _look_at_all(self) -> None:
        """Evaluate all conditions from now on."""
        self._next, self._pause = 0, _SLEEPLESS
        self._resting, self._until, self._changes = False, math.inf, 0
        self._looking = [(group, group, True) for group in self.groups]
        """groups, their conditions that are evaluated, and whether the others of the group are true"""

    def _rest(self, run: Instant) -> None:
        """Leave alone what stays as it is: true conditions, and groups with a false one, but for what these have to remember."""
        self._looking, self._until, self._changes = [], math.inf, run.changes
        soon = run.time + _SLEEPLESS * run.dt
        for group in self.groups:
            outlooks = [(condition, *condition.outlook(run)) for condition in group]
            end = max([until for _, value, until in outlooks if not value], default=-math.inf)
            false = end > soon
            counting = [(condition, until) for condition, _, until in outlooks if condition.keeps_memory or not false]
            awake = [condition for condition, until in counting if until <= soon]
            self._until = min([self._until, end if false else math.inf, *(until for _, until in counting if until > soon)])
            if awake:
                self._looking.append((group, awake, not false))
                self._until = min(self._until, run.time + _LONGEST * run.dt)
            self._resting = self._resting or false or len(awake) < len(group)
        self._pause = _SLEEPLESS if self._resting else 2 * self._pause
        self._next = run.step_index + self._pause
