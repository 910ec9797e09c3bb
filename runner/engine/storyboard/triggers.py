"""Triggers: condition groups, condition edges and delays (OpenSCENARIO XML 1.3, 7.6)."""

from __future__ import annotations

import math
import sys
from bisect import bisect_left
from collections import deque
from collections.abc import Callable, Sequence
from heapq import heappop, heappush
from typing import TYPE_CHECKING, Generic, Protocol, Self, TypeVar

from runner.engine.compile.element import AWAKE, Condition, Dormancy
from xosc.document.carla import is_criterion
from xosc.document.node import Node
from xosc.rules.storyboard import EMPTY_ELEMENTS_UID

if TYPE_CHECKING:
    from runner.engine.compile.protocols import Instant
    from runner.engine.participants.entity import Entity

EDGES = ("none", "rising", "falling", "risingOrFalling")
# Times are multiples of the step rounded to 1e-9 s; a delay that is served at this very step may
# miss it by the rounding of `time - delay`.
_EPSILON = 1e-6
_RETRY = 8
"""Steps from one look whether a trigger is dormant to the next; doubled while it is not"""
_LONGEST = 128
"""Most steps between two of these looks"""
_WORTH = 4
"""Steps for which a trigger has to be dormant to be left alone: less costs more than it spares"""


class ConditionContext(Protocol):
    """Context in which triggers are built."""

    def timed_condition(self, node: Node) -> TimedCondition:
        """The condition that a Condition element is, with its edge and delay."""
        ...

    def repair(self, node: Node, rule: str, text: str, cause: str = "") -> None:
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
            # Whether the present stretch of true values began with the first evaluation, which is
            # no edge: `missed` then knows that the rise is in the past.
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
        """The value of `delay` ago, with this one added to the history, where it is not the same as
        the one before."""
        # Only changes are kept, so the history stays short for any delay. Its first entry is the
        # value that was valid `delay` ago.
        history, then = self._history, time - self.delay + _EPSILON
        if not history or history[-1][1] != value:
            history.append((time, value))
        while len(history) > 1 and history[1][0] <= then:
            history.popleft()
        since, value = history[0]
        return value and since <= then

    def dormant_until(self, run: Instant) -> Dormancy:
        """End of the time in which it is false and remembers nothing new."""
        history, edge = self._history, self.edge != "none"
        if self.delay > 0.0:
            since, value = history[-1]
            # Two epsilons before the end of the delay, so that rounding never lets it sleep through
            # the step in which `_delayed` finds the value.
            if value and not edge and len(history) <= 2:  # true, which counts after the delay
                served = Dormancy(since + self.delay - 2.0 * _EPSILON)
                return self.condition.dormant_until(run).both(served)
            settled = len(history) == 1 and not value
        else:
            # An edge that has not fired stays away while the expression does not change, true or
            # false; without an edge only false means that the trigger cannot fire.
            settled = edge or not self.condition.evaluate(run)
        return self.condition.dormant_until(run) if settled else AWAKE

    @property
    def missed(self) -> bool:
        """Whether it waits for a rise that has been, and that there can be only one of, or was true
        throughout."""
        # A rise still in the history counts later: the delay has not let it through yet.
        true = self.edge == "rising" and self._previous is True
        past = true and (self._held or self.condition.stays_true)
        return past and not any(rose for _, rose in self._history)

    def describe(self, run: Instant) -> str:
        """Reason for which it fired: name, expression with values, edge and delay."""
        text = self.condition.describe(run)
        if self.edge != "none":
            text += f" ({self.edge})"
        if self.delay:
            text += f", {self.delay:g} s ago"
        return f"{self.name}: {text}" if self.name else text


class Trigger:
    """Condition groups: the trigger fires if all conditions of one group are true.

    `triggering` holds the entities that made the by-entity conditions of the firing group true,
    `fired` that group.
    """

    def __init__(self, groups: list[list[TimedCondition]]) -> None:
        self.groups = groups
        self.triggering: tuple[Entity, ...] = ()
        self.fired: Sequence[TimedCondition] = ()
        self.reason = ""

    @classmethod
    def from_xml(cls, node: Node | None, context: ConditionContext) -> Trigger | None:
        """Build from a StartTrigger or StopTrigger element; None where it is absent or empty.

        Criteria in a StopTrigger are no conditions (see `runner.judging.criteria`); a group of
        nothing else never fires.
        """
        if node is None:
            return None
        # CARLA's scenario_runner writes its pass criteria as conditions of stop triggers; they
        # judge the run and must not end it.
        stop = node.tag == "StopTrigger"
        groups: list[list[TimedCondition]] = []
        for group in node.children("ConditionGroup"):
            conditions = group.children("Condition")
            if not conditions:
                context.repair(
                    group,
                    EMPTY_ELEMENTS_UID,
                    "an element Condition is expected inside; without one the group is left out",
                    "empty",
                )
            groups.append(
                [
                    context.timed_condition(condition)
                    for condition in conditions
                    if not (stop and is_criterion(condition))
                ]
            )
        groups = [group for group in groups if group]
        return cls(groups) if groups else None

    def take_any(self) -> None:
        """Fire when any condition of any group is true, as CARLA's scenario_runner does where it
        stops acts."""
        self.groups = [[condition] for group in self.groups for condition in group]

    def reset(self) -> None:
        """Restore the state before a run."""
        self.triggering = ()
        self.fired = ()
        self.reason = ""
        for group in self.groups:
            for condition in group:
                condition.reset()

    def rearm(self) -> None:
        """Forget all earlier evaluations (the owning element enters standby anew)."""
        for group in self.groups:
            for condition in group:
                condition.rearm()

    def missed(self, run: Instant) -> str:
        """Return the reason why it can never fire, with the false conditions of each group; empty
        while it can."""
        vain = [[condition for condition in group if condition.missed][:1] for group in self.groups]
        return " and ".join(condition.describe(run) for (condition,) in vain) if all(vain) else ""

    def describe(self, run: Instant) -> str:
        """Describe the awaited conditions with current values."""
        return " or ".join(
            " and ".join(condition.describe(run) for condition in group) for group in self.groups
        )

    def fires(self, run: Instant) -> bool:
        """Evaluate at the current time. Conditions with memory are evaluated in each step."""
        fired = None
        for group in self.groups:
            true = True
            for condition in group:
                # Edges and delays miss a change if they skip a step, so conditions with memory are
                # evaluated also where the group is false already. The first true group fires, in
                # document order.
                if (true or condition.keeps_memory) and not condition.evaluate(run):
                    true = False
            if true and fired is None:
                fired = group
        if fired is None:
            return False
        # A dict keeps the order of conditions and drops entities named twice; the order of a set
        # would vary from process to process, and with it that of the actors.
        self.triggering = tuple(dict.fromkeys(e for c in fired for e in c.condition.triggering))
        self.fired = fired
        self.reason = " and ".join(condition.describe(run) for condition in fired)
        return True

    def dormant_until(self, run: Instant) -> Dormancy:
        """Return the time until which the trigger does not fire, and its conditions need not be
        evaluated; asked after it has not fired."""
        until = Dormancy()
        for group in self.groups:
            remembering = [condition for condition in group if condition.keeps_memory]
            ends = [condition.dormant_until(run) for condition in remembering or group]
            # one false condition keeps a group from being true; each with a memory has to keep it
            for end in ends if remembering else [max(ends, key=_by_length)]:
                until = until.both(end)
        return until


def _by_length(end: Dormancy) -> tuple[bool, float, float, bool]:
    # Displacements come in each step of a moving scenario, so an end by time alone counts as
    # longer.
    return end.way == math.inf, end.time, end.way, not end.undisturbed


class Triggered(Protocol):
    """A storyboard element that may wait for a trigger."""

    @property
    def waits(self) -> bool:
        """Whether it waits for its trigger now."""
        ...


Waiting = TypeVar("Waiting", bound=Triggered)


class _Watched(Generic[Waiting]):
    """Waiting element: its place in the document, and the step of the next look whether its trigger
    is dormant."""

    __slots__ = ("element", "pause", "place", "retry", "trigger")

    def __init__(self, place: int, element: Waiting, trigger: Trigger | None) -> None:
        self.place, self.element, self.trigger = place, element, trigger
        self.retry, self.pause = 0, _RETRY


class Watch(Generic[Waiting]):
    """Waiting elements in document order. Only the triggers that may fire now are evaluated.

    The others are dormant until a time, a total displacement or a change of the run
    (`Trigger.dormant_until`), and cost nothing in a step.

    Attributes:
        awake: places of those to be evaluated, ascending.
        stale: for the caller, to be set when elements may have ceased to wait.
    """

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Watch nothing."""
        self._watched: dict[int, _Watched[Waiting]] = {}
        self.awake: list[int] = []
        self._by_time: list[tuple[float, int]] = []
        self._by_way: list[tuple[float, int]] = []
        self._undisturbed: list[int] = []
        self._changes = 0
        """`Run.changes` since these are"""
        self._retry = 0
        """step in which one of those awake is looked at next whether it is dormant"""
        self.stale = False

    def add(self, place: int, element: Waiting, trigger: Trigger | None) -> None:
        """Watch the trigger of an element from now on, in its place of the document."""
        self._watched[place] = _Watched(place, element, trigger)
        self._rouse(place)

    def due(self, run: Instant) -> list[Waiting]:
        """Evaluate once a step: elements that wait and whose triggers fire, in document order."""
        # Heaps: the earliest end is first, so a step in which nothing wakes costs two comparisons.
        if self._by_time and self._by_time[0][0] <= run.time:
            self._wake(self._by_time, run.time)
        if self._by_way and self._by_way[0][0] <= run.displacement.total:
            self._wake(self._by_way, run.displacement.total)
        if self._undisturbed and run.changes != self._changes:
            for place in self._undisturbed:
                self._rouse(place)
            self._undisturbed = []
        if self.stale:
            self.stale = False
            # Elements that were stopped, or have started, are dropped here and not where it
            # happens: several may change in one step.
            self.awake = [place for place in self.awake if self._watched[place].element.waits]
        fired = []
        for place in self.awake:
            watched = self._watched[place]
            if watched.trigger is None or watched.trigger.fires(run):
                fired.append(watched.element)
                # A fired trigger is not asked for its dormancy in the same step: the element is
                # about to change.
                watched.retry = run.step_index + 1
                self._retry = min(self._retry, watched.retry)
        if self.awake and run.step_index >= self._retry:
            self._settle(run)
        return fired

    @property
    def quiet(self) -> float:
        """Time (s) until which nothing is to be evaluated while `Run.changes` stays; in the past
        where that is not known."""
        if self.awake or self._by_way:
            return -math.inf
        return self._by_time[0][0] if self._by_time else math.inf

    def _wake(self, sleeping: list[tuple[float, int]], reached: float) -> None:
        while sleeping and sleeping[0][0] <= reached:
            self._rouse(heappop(sleeping)[1])

    def _rouse(self, place: int) -> None:
        watched = self._watched[place]
        index = bisect_left(self.awake, place)
        if watched.element.waits and self.awake[index : index + 1] != [place]:
            self.awake.insert(index, place)
        # Step 0 is always past: it is asked in this step whether it is dormant again.
        watched.retry = self._retry = 0

    def _settle(self, run: Instant) -> None:
        """Put triggers to rest that can't fire for a while."""
        awake, self._retry = [], sys.maxsize
        for place in self.awake:
            watched = self._watched[place]
            if watched.retry <= run.step_index and self._sleeps(run, watched):
                continue
            awake.append(place)
            self._retry = min(self._retry, watched.retry)
        self.awake = awake

    def _sleeps(self, run: Instant, watched: _Watched[Waiting]) -> bool:
        """Whether a trigger that has not fired is left alone from now on."""
        # Without a trigger it is due in every step in which it waits.
        if watched.trigger is None:
            watched.retry = sys.maxsize
            return False
        until = watched.trigger.dormant_until(run)
        near = until.way < math.inf and run.displacement.reaches(until.way, _WORTH)
        if near or until.time <= run.time + _WORTH * run.dt:
            # Doubling bounds the cost of triggers that are awake for long: they are asked every
            # `_LONGEST` steps only.
            watched.retry = run.step_index + watched.pause
            watched.pause = min(2 * watched.pause, _LONGEST)
            return False
        watched.pause = _RETRY
        if until.time < math.inf:
            heappush(self._by_time, (until.time, watched.place))
        if until.way < math.inf:
            heappush(self._by_way, (until.way, watched.place))
        if until.undisturbed:
            self._undisturbed.append(watched.place)
            self._changes = run.changes
        return True


class OneShotCondition(TimedCondition):
    """A condition that stays true once it has been.

    It is looked at from `delay` seconds on after its trigger has begun to wait, without regard to
    its edge; times and distances count from there.
    """

    __slots__ = ("_begun", "_measuring", "_reason")

    def __init__(self, name: str, condition: Condition, edge: str, delay: float) -> None:
        # scenario_runner ticks the behaviour of a condition until it has succeeded once, and reads
        # no edge.
        super().__init__(name, condition, "none", delay)
        self.keeps_memory = True
        self.evaluate = self._lasting

    def rearm(self) -> None:
        """Forget that it has been true."""
        super().rearm()
        self._begun: float | None = None
        self._measuring = False
        self._reason = ""

    def dormant_until(self, run: Instant) -> Dormancy:
        """Nothing for certain."""
        return AWAKE

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
        """Reason and time at which it has become true; the expression with the
        values of now before that.
        """
        return self._reason or super().describe(run)
