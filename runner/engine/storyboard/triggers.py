"""Triggers: condition groups, condition edges and delays (OpenSCENARIO XML 1.3, 7.6)."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from heapq import heappop, heappush
from typing import TYPE_CHECKING, Generic, Protocol, Self, TypeVar

from runner.engine.compile.element import Condition
from xosc.document.carla import is_criterion
from xosc.document.node import Node
from xosc.rules.storyboard import EMPTY_ELEMENTS_UID

if TYPE_CHECKING:
    from runner.engine.compile.run import Instant
    from runner.engine.participants.entity import Entity

EDGES = ("none", "rising", "falling", "risingOrFalling")
_EPSILON = 1e-6
_SLEEPLESS = 16
"""Steps between attempts to let conditions sleep; doubled after each failed attempt."""
_RETRY = 8
"""Steps from one try to find a trigger dormant to the next"""
_LONGEST = 128
"""Steps after which conditions that could not be left alone may have become such that can."""


class ConditionContext(Protocol):
    """Context in which triggers are built."""

    def timed_condition(self, node: Node) -> TimedCondition:
        """The condition that a Condition element is, with its edge and delay."""
        ...

    def repair(self, node: Node, rule: str, text: str) -> None:
        """See `runner.engine.compile.registry.Context`."""
        ...


class TimedCondition:
    """A condition with its edge and delay.

    The edge compares the expression with its previous evaluation; the first evaluation has none, so
    it never is an edge (7.6.3). A delay looks up the edge-filtered value of `delay` seconds ago,
    false before that.
    """

    __slots__ = (
        "_held",
        "_history",
        "_previous",
        "condition",
        "delay",
        "edge",
        "evaluate",
        "keeps_memory",
        "name",
    )

    def __init__(self, name: str, condition: Condition, edge: str, delay: float) -> None:
        self.name = name
        self.condition = condition
        self.edge = edge
        self.delay = delay
        self.keeps_memory = edge != "none" or delay > 0.0
        self.evaluate: Callable[[Instant], bool] = (
            self._remembered if self.keeps_memory else condition.evaluate
        )
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
        """Restore the state before a run."""
        self.condition.reset()
        self.rearm()

    def rearm(self) -> None:
        """Forget all earlier evaluations."""
        self._previous: bool | None = None
        self._held = False
        self._history: deque[tuple[float, bool]] = deque()

    def _remembered(self, run: Instant) -> bool:
        value = self.condition.evaluate(run)
        if self.edge != "none":
            before, self._previous = self._previous, value
            if before is not value:
                self._held = before is None and value
            rising, falling = before is False and value, before is True and not value
            value = (
                rising
                if self.edge == "rising"
                else falling
                if self.edge == "falling"
                else rising or falling
            )
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
        """Return the value from the next step on, and the time (s) until which it holds while `run.changes` is unchanged."""
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

    def dormancy(self, run: Instant) -> tuple[float, float]:
        """The time (s) and the total displacement (m) before either of which it is false and remembers nothing new."""
        history = self._history
        remembers = len(history) != 1 or history[0][1]
        if (self.edge != "none" and self._previous is not False) or (
            self.delay > 0.0 and remembers
        ):
            return -math.inf, -math.inf
        return self.condition.false_until(run), self.condition.false_within(run)

    @property
    def missed(self) -> bool:
        """Whether it waits for a rise that has been, and that there can be only one of, or was true throughout."""
        true = self.edge == "rising" and self._previous is True
        past = true and (self._held or self.condition.stays_true)
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

    `triggering` holds the entities that made the by-entity conditions of the firing group true,
    `fired` that group.
    """

    def __init__(self, groups: list[list[TimedCondition]]) -> None:
        self.groups = groups
        self.triggering: tuple[Entity, ...] = ()
        self.fired: Sequence[TimedCondition] = ()
        self.reason = ""
        self._look_at_all()

    @classmethod
    def from_xml(cls, node: Node | None, context: ConditionContext) -> Trigger | None:
        """Build from a StartTrigger or StopTrigger element; None where it is absent or empty.

        Criteria in a StopTrigger are no conditions (see `runner.judging.criteria`); a group of
        nothing else never fires.
        """
        if node is None:
            return None
        stop = node.tag == "StopTrigger"
        groups: list[list[TimedCondition]] = []
        for group in node.children("ConditionGroup"):
            conditions = group.children("Condition")
            if not conditions:
                context.repair(
                    group,
                    EMPTY_ELEMENTS_UID,
                    "an element Condition is expected inside; without one the group is left out",
                )
            groups.append(
                [
                    context.timed_condition(each)
                    for each in conditions
                    if not (stop and is_criterion(each))
                ]
            )
        groups = [group for group in groups if group]
        return cls(groups) if groups else None

    def take_any(self) -> None:
        """Fire when any condition of any group is true, as CARLA's scenario_runner does where it stops acts."""
        self.groups = [[condition] for group in self.groups for condition in group]
        self._look_at_all()

    def reset(self) -> None:
        """Restore the state before a run."""
        self._look_at_all()
        self.triggering = ()
        self.fired = ()
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
        """Return the reason why it can never fire, with the false conditions of each group; empty while it can."""
        vain = [[condition for condition in group if condition.missed][:1] for group in self.groups]
        return " and ".join(condition.describe(run) for (condition,) in vain) if all(vain) else ""

    def describe(self, run: Instant) -> str:
        """Describe the awaited conditions with current values."""
        return " or ".join(
            " and ".join(condition.describe(run) for condition in group) for group in self.groups
        )

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
        self.fired = fired
        self.reason = " and ".join(condition.describe(run) for condition in fired)
        return True

    def rests(self, run: Instant) -> float:
        """Earliest time (s) at which it may fire while `run.changes` is unchanged; in the past if unknown."""
        known = self._resting and not self._looking and self._changes == run.changes
        return self._until if known else -math.inf

    def dormancy(self, run: Instant) -> tuple[float, float]:
        """The time (s) and the total displacement (m, see `Displacement`) before both of which it does not fire.

        Whatever happens until then, its conditions need not be evaluated. Both are in the past
        where that is not known.
        """
        until = within = math.inf
        now, here = run.time, run.displacement.total
        for group in self.groups:
            remembering = [condition for condition in group if condition.keeps_memory]
            bounds = [condition.dormancy(run) for condition in remembering or group]
            false = [
                (time > now, time if time > now else math.inf, way)
                for time, way in bounds
                if time > now or way > here
            ]
            if not false or (remembering and len(false) < len(bounds)):
                return -math.inf, -math.inf
            for timed, time, way in false if remembering else [max(false)]:
                until, within = min(until, time), within if timed else min(within, way)
        return until, within

    def _look_at_all(self) -> None:
        """Evaluate all conditions from now on."""
        self._next, self._pause = 0, _SLEEPLESS
        self._resting, self._until, self._changes = False, math.inf, 0
        self._looking = [(group, group, True) for group in self.groups]
        """groups, their conditions that are evaluated, and whether the others of the group are true"""

    def _rest(self, run: Instant) -> None:
        """Skip conditions whose value cannot change: true ones, and groups with a false one, except those with a memory."""
        self._looking, self._until, self._changes = [], math.inf, run.changes
        soon = run.time + _SLEEPLESS * run.dt
        for group in self.groups:
            outlooks = [(condition, *condition.outlook(run)) for condition in group]
            end = max([until for _, value, until in outlooks if not value], default=-math.inf)
            false = end > soon
            counting = [
                (condition, until)
                for condition, _, until in outlooks
                if condition.keeps_memory or not false
            ]
            awake = [condition for condition, until in counting if until <= soon]
            self._until = min(
                [
                    self._until,
                    end if false else math.inf,
                    *(until for _, until in counting if until > soon),
                ]
            )
            if awake:
                self._looking.append((group, awake, not false))
                self._until = min(self._until, run.time + _LONGEST * run.dt)
            self._resting = self._resting or false or len(awake) < len(group)
        self._pause = _SLEEPLESS if self._resting else 2 * self._pause
        self._next = run.step_index + self._pause


class Triggered(Protocol):
    """A storyboard element that may wait for a trigger."""

    @property
    def waits(self) -> bool:
        """Whether it waits for its trigger now."""
        ...


Waiting = TypeVar("Waiting", bound=Triggered)


class Watch(Generic[Waiting]):
    """Waiting elements in document order. Only the triggers that may fire now are evaluated.

    The others are dormant until a time or a total displacement (`Trigger.dormancy`), or rest until
    something happens (`Trigger.rests`); they cost nothing in a step.
    """

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Watch nothing."""
        self._watched: dict[int, tuple[Waiting, Trigger | None]] = {}
        self._awake: dict[int, bool] = {}
        """places of those to be evaluated, and whether they have not been so far"""
        self._by_time: list[tuple[float, int]] = []
        self._by_way: list[tuple[float, int]] = []
        self._resting: list[int] = []
        self._until, self._changes = math.inf, 0
        """the time (s) until which `_resting` rest while `Run.changes` is this"""

    def add(self, place: int, element: Waiting, trigger: Trigger | None) -> None:
        """Watch the trigger of an element from now on, in its place of the document."""
        self._watched[place] = (element, trigger)
        self._awake[place] = True

    def due(self, run: Instant) -> Iterator[Waiting]:
        """Evaluate once a step: elements that wait and whose triggers fire, in document order."""
        self._wake(run)
        for place in sorted(self._awake):
            element, trigger = self._watched[place]
            if not element.waits:
                del self._awake[place]
            elif trigger is None or trigger.fires(run):
                yield element
            else:
                self._settle(run, place, trigger)

    def _wake(self, run: Instant) -> None:
        while self._by_time and self._by_time[0][0] <= run.time:
            self._awake[heappop(self._by_time)[1]] = True
        while self._by_way and self._by_way[0][0] <= run.displacement.total:
            self._awake[heappop(self._by_way)[1]] = True
        if self._resting and (run.changes != self._changes or run.time >= self._until):
            self._awake |= dict.fromkeys(self._resting, True)
            self._resting, self._until = [], math.inf

    def _settle(self, run: Instant, place: int, trigger: Trigger) -> None:
        """Evaluate no more what can't fire for a while."""
        if self._awake[place] or run.step_index % _RETRY == 0:
            self._awake[place] = False
            time, way = trigger.dormancy(run)
            if time > run.time and way > run.displacement.total:
                if time < math.inf:
                    heappush(self._by_time, (time, place))
                if way < math.inf:
                    heappush(self._by_way, (way, place))
                del self._awake[place]
                return
        until = trigger.rests(run)
        if until > run.time:
            if not self._resting:
                self._changes = run.changes
            self._resting.append(place)
            self._until = min(self._until, until)
            del self._awake[place]

    @property
    def quiet(self) -> float:
        """Time (s) until which nothing is to be evaluated while `Run.changes` stays; in the past where that is not known."""
        if self._awake or self._by_way:
            return -math.inf
        return min(self._until, self._by_time[0][0] if self._by_time else math.inf)


class OneShotCondition(TimedCondition):
    """A condition that stays true once it has been.

    It is looked at from `delay` seconds on after its trigger has begun to wait, without regard to
    its edge; times and distances count from there.
    """

    __slots__ = ("_begun", "_measuring", "_reason")

    def __init__(self, name: str, condition: Condition, edge: str, delay: float) -> None:
        super().__init__(name, condition, "none", delay)
        self.keeps_memory = True
        self.evaluate = self._lasting

    def rearm(self) -> None:
        """Forget that it has been true."""
        super().rearm()
        self._begun: float | None = None
        self._measuring = False
        self._reason = ""

    def outlook(self, run: Instant) -> tuple[bool, float]:
        """Nothing for certain."""
        return False, -math.inf

    def dormancy(self, run: Instant) -> tuple[float, float]:
        """Nothing for certain."""
        return -math.inf, -math.inf

    def _lasting(self, run: Instant) -> bool:
        """Whether it has been true since its trigger waits; to be called once each step."""
        if self._begun is None:
            self._begun = run.time
        if self._reason or run.time < self._begun + self.delay:
            return bool(self._reason)
        if not self._measuring:
            self._measuring = True
            self.condition.measure_from(run)
        if self.condition.evaluate(run):
            self._reason = f"{super().describe(run)} at {run.time:.2f} s"
        return bool(self._reason)

    def describe(self, run: Instant) -> str:
        """Why and when it has become true; the expression with the values of now before that."""
        return self._reason or super().describe(run)
