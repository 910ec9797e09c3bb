"""Storyboard elements and triggers in many runs at once: `story_elements`, `storyboard` and
`triggers` with masks of runs.

A method takes the runs (n,) in which its counterpart there is called, and does the same in them; a
run never sees the others.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np

from runner.engine.compile.array_protocols import (
    COMPLETE,
    END,
    RUNNING,
    SKIP,
    STANDBY,
    START,
    STOP,
    ArrayProcess,
    ArrayRun,
)
from runner.engine.compile.element import GlobalAction
from runner.engine.participants.rows import RunRows
from runner.engine.storyboard.story_elements import ActionElement, Element
from runner.engine.storyboard.storyboard import Act, Event, ManeuverGroup
from runner.engine.storyboard.triggers import OneShotCondition, TimedCondition, Trigger
from schemas.common.array_types import BoolArray
from schemas.expressions.columns import NotInArrays, NumberColumn

if TYPE_CHECKING:
    from runner.engine.compile.element import Action
    from runner.engine.participants.rows import EntityRows

_EPSILON = 1e-6


class StoryboardArrays(ArrayRun, Protocol):
    """State and methods of many runs for storyboard elements."""

    elements: dict[Element, ArrayElement]
    changed: dict[ArrayElement, None]
    """elements with transitions in this step"""

    def add_process(
        self,
        process: ArrayProcess,
        element: ArrayActionElement,
        actor: EntityRows | None,
        domains: tuple[str, ...],
    ) -> None:
        """Take an action in, for one of its actors."""
        ...

    def begin_process(self, process: ArrayProcess, rows: BoolArray) -> None:
        """Have a process act in some runs."""
        ...

    def take_over(self, actor: EntityRows, domain: str, rows: BoolArray) -> None:
        """End the owner of a control domain of an entity, in some runs."""
        ...

    def give(
        self, process: ArrayProcess, actor: EntityRows, domains: tuple[str, ...], rows: BoolArray
    ) -> None:
        """Make a process the owner of control domains."""
        ...

    def release(self, process: ArrayProcess, rows: BoolArray) -> None:
        """End a process in some runs."""
        ...


class ArrayElement(RunRows):
    """A storyboard element in many runs; arrays (n,) with the names of `Element`.

    Attributes:
        started: runs in which it has started.
    """

    def __init__(
        self, element: Element, parent: ArrayElement | None, run: StoryboardArrays
    ) -> None:
        self.element, self.parent, self.run = element, parent, run
        self.children: list[ArrayElement] = []
        n = run.n
        self.state, self.seen_state = np.zeros(n, np.int8), np.zeros(n, np.int8)
        self.transitions, self.seen_transitions = np.zeros(n, np.int8), np.zeros(n, np.int8)
        self.started = np.zeros(n, bool)
        if parent is not None:
            parent.children.append(self)
        run.elements[element] = self
        run.own(self)

    def change(self, rows: BoolArray, state: int, transition: int) -> None:
        """Go to a state by a transition."""
        self.state[rows] = state
        # Transitions are bits: several can happen in one step.
        self.transitions[rows] |= transition
        if transition == START:
            self.started |= rows
        self.run.changed[self] = None

    def publish(self) -> None:
        """Make the current states those that conditions see."""
        self.seen_state = self.state.copy()
        self.seen_transitions, self.transitions = (
            self.transitions,
            np.zeros_like(self.transitions),
        )

    def start(self, rows: BoolArray) -> None:
        """standby → running, and the children after it."""
        self.change(rows, RUNNING, START)
        for child in self.children:
            child.arm(rows)
        self.child_completed(rows)

    def arm(self, rows: BoolArray) -> None:
        """The parent is running."""
        self.start(rows)

    def stop(self, rows: BoolArray) -> None:
        """→ complete by stopTransition, children included."""
        rows = rows & (self.state != COMPLETE)
        if rows.any():
            for child in self.children:
                child.stop(rows)
            self.change(rows, COMPLETE, STOP)

    def child_completed(self, rows: BoolArray) -> None:
        """End where every child is complete."""
        rows = rows & (self.state == RUNNING)
        for child in self.children:
            rows = rows & (child.state == COMPLETE)
        if rows.any():
            self.end(rows)

    def end(self, rows: BoolArray) -> None:
        """running → complete, and tell the parent."""
        self.change(rows, COMPLETE, END)
        if self.parent is not None:
            self.parent.child_completed(rows)

    def rearm(self, rows: BoolArray) -> None:
        """Back to standby without a transition, children included."""
        self.state[rows] = STANDBY
        self.run.changed[self] = None
        for child in self.children:
            child.rearm(rows)


class ArrayActionElement(ArrayElement):
    """An Action of an event, or of the Init section.

    Args:
        actors: of its event; those of an initial action.

    Raises:
        NotInArrays: an action plays in single runs only.
    """

    def __init__(
        self,
        element: ActionElement,
        parent: ArrayElement | None,
        run: StoryboardArrays,
        actors: Sequence[EntityRows],
    ) -> None:
        super().__init__(element, parent, run)
        if element.whole:
            raise NotInArrays("actors that are a selection of several act in single runs only")
        self._processes: list[tuple[ArrayProcess, EntityRows | None, tuple[str, ...]]] = []
        for action in element.actions:
            for actor in [None] if isinstance(action, GlobalAction) else actors:
                process = _process(action, actor, run, element)
                domains = () if isinstance(action, GlobalAction) else action.claims()
                self._processes.append((process, actor, domains))
                run.add_process(process, self, actor, domains)

    def execute(self, rows: BoolArray) -> None:
        """Start in some runs; complete at once where nothing is left to run."""
        self.change(rows, RUNNING, START)
        for process, actor, domains in self._processes:
            if actor is not None:
                for domain in domains:
                    self.run.take_over(actor, domain, rows)
            self.run.begin_process(process, rows)
            left = process.start(rows)
            # Where `start` leaves nothing to run the action is complete at once.
            process.active &= ~rows | left
            if actor is not None:
                self.run.give(process, actor, domains, left)
        self._over(rows)

    def _over(self, rows: BoolArray) -> None:
        rows = rows & (self.state == RUNNING)
        for process, _, _ in self._processes:
            rows = rows & ~process.active
        if rows.any():
            self.end(rows)

    def finished(self, process: ArrayProcess, rows: BoolArray) -> None:
        """One of the processes has reached its goal."""
        self.run.release(process, rows)
        self._over(rows)

    def override(self, process: ArrayProcess, rows: BoolArray) -> None:
        """A newer action takes a control domain from one of the processes."""
        self.run.release(process, rows)
        over = rows & (self.state == RUNNING)
        for other, _, _ in self._processes:
            over = over & ~other.active
        if over.any():
            self.change(over, COMPLETE, STOP)
        if self.parent is not None:
            self.parent.child_completed(rows)

    def stop(self, rows: BoolArray) -> None:
        """Stop all processes, → complete by stopTransition."""
        for process, _, _ in self._processes:
            active = rows & process.active
            if active.any():
                self.run.release(process, active)
        super().stop(rows)


def _process(
    action: Action, actor: EntityRows | None, run: StoryboardArrays, element: ActionElement
) -> ArrayProcess:
    try:
        return action.in_arrays(run) if isinstance(action,
            GlobalAction) else action.in_arrays(actor, run)  # type: ignore[arg-type]  # fmt: skip
    except NotInArrays as error:
        if error.path is None and element.node is not None:
            node = element.node
            raise NotInArrays(
                error.message, path=node.path, line=node.line, element=node.tag
            ) from None
        raise


class ArrayTrigger:
    """A trigger in many runs.

    Raises:
        NotInArrays: a condition is evaluated in single runs only.
    """

    def __init__(self, trigger: Trigger, run: StoryboardArrays, where: str) -> None:
        self.groups = [
            [_TimedConditionArrays(timed, run, where) for timed in group]
            for group in trigger.groups
        ]
        self.fired = np.zeros(run.n, np.int64)
        """index of the first group that was true when it was evaluated last (n,)"""

    def fires(self, rows: BoolArray) -> BoolArray:
        """Evaluate where elements wait (n,): the runs in which it fires."""
        found = np.zeros_like(rows)
        fired = np.zeros(len(rows), np.int64)
        for number, group in enumerate(self.groups):
            true = rows
            for condition in group:
                true = true & condition.evaluate(rows)
            # The first true group in document order, as in one run.
            fired[true & ~found] = number
            found = found | true
        self.fired = fired
        return found

    def rearm(self, rows: BoolArray) -> None:
        """Forget all earlier evaluations."""
        for group in self.groups:
            for condition in group:
                condition.rearm(rows)


class _TimedConditionArrays(RunRows):
    """`TimedCondition` in many runs: values are kept for the steps of its longest delay."""

    def __init__(self, timed: TimedCondition, run: StoryboardArrays, where: str) -> None:
        self._run, self._edge = run, timed.edge
        self.condition = timed.condition
        if isinstance(timed, OneShotCondition):
            raise NotInArrays("triggers of files for CARLA are evaluated in single runs only")
        try:
            self._holds: Callable[[], BoolArray] = timed.condition.in_arrays(run)
        except NotInArrays as error:
            raise NotInArrays(f"{where}: {error.message}" if where else error.message) from None
        self._delayed = isinstance(timed.delay, NumberColumn) or timed.delay > 0.0
        n = run.n
        self._previous = np.full(n, -1, np.int8)
        delay = np.asarray(run.value(timed.delay), float) * np.ones(n)
        # The least number of steps that last as long as the delay, within the same rounding as in
        # one run.
        self._back = np.ceil((delay - _EPSILON) / run.dt - 1e-9).astype(np.int64)
        """steps of the delay"""
        longest = int(self._back.max(initial=0))
        self._same = longest if (self._back == longest).all() else None
        """steps of the delay where it is one for all runs"""
        self._history = np.zeros((longest + 1, n), bool)
        self._column = np.arange(n)
        self._began = np.zeros(n, np.int64)
        """step from which on evaluations count"""
        self._armed = np.zeros(n, bool)
        run.own(self)

    def take(self, kept: BoolArray) -> None:
        """Keep some runs only."""
        history = self._history
        super().take(kept)
        self._history, self._column = history[:, kept], np.arange(int(kept.sum()))

    def rearm(self, rows: BoolArray) -> None:
        """Forget all earlier evaluations."""
        self._previous[rows] = -1
        self._armed[rows] = False

    def evaluate(self, rows: BoolArray) -> BoolArray:
        """Evaluate at the current time, in the runs that are asked for (n,)."""
        value = self._holds()
        if self._edge != "none":
            before = self._previous
            # -1 stands for no evaluation yet: it is neither, so the first evaluation is no edge
            # (7.6.3).
            rising, falling = (before == 0) & value, (before == 1) & ~value
            self._previous = np.where(rows, value, before).astype(np.int8)
            value = {"rising": rising, "falling": falling}.get(self._edge, rising | falling)
        return self._earlier(value, rows) if self._delayed else value

    def _earlier(self, value: BoolArray, rows: BoolArray) -> BoolArray:
        """The value of `delay` ago; false where it was not evaluated then."""
        step, history = self._run.step_index, self._history
        new = rows & ~self._armed
        if new.any():
            self._began[new], self._armed = step, self._armed | rows
        # A ring buffer of values by step; the longest delay among the runs sets its length.
        history[step % len(history)] = value
        if self._same is not None:
            at = step - self._same
            kept: BoolArray = history[at % len(history)] & (at >= self._began)
            return kept
        asked = np.flatnonzero(rows)
        back = self._back[asked]
        place = step % len(history) - back
        place[place < 0] += len(history)
        found: BoolArray = np.zeros_like(rows)
        found[asked] = history[place, asked] & (step - back >= self._began[asked])
        return found


class ArrayEvent(ArrayElement):
    """An Event in many runs."""

    def __init__(self, event: Event, parent: ArrayElement, run: StoryboardArrays) -> None:
        super().__init__(event, parent, run)
        group = event.group
        if group.select_triggering:
            raise NotInArrays("actors that triggers select are known in single runs only")
        self.event = event
        self._executions = np.zeros(run.n, np.int64)
        actors = [run.entities[actor.name] for actor in group.actors]
        self._actions = [ArrayActionElement(action, self, run, actors) for action in event.actions]
        self.trigger = (
            ArrayTrigger(event.trigger, run, event.where) if event.trigger is not None else None
        )

    @property
    def waits(self) -> BoolArray:
        """The runs in which the trigger may start it now."""
        assert self.parent is not None
        return (self.state == STANDBY) & (self.parent.state == RUNNING)

    def arm(self, rows: BoolArray) -> None:
        """Wait for the trigger."""
        self._executions[rows] = 0
        if self.trigger is not None:
            self.trigger.rearm(rows)

    def begin(self, rows: BoolArray) -> None:
        """Start, or be skipped, because the trigger has fired."""
        assert self.parent is not None
        others = [child for child in self.parent.children if child is not self]
        self._executions[rows] += 1
        if self.event.priority == "skip":
            busy = np.zeros_like(rows)
            for other in others:
                busy |= other.state == RUNNING
            self._skip(rows & busy)
            rows = rows & ~busy
        if self.event.priority in ("override", "overwrite"):
            for other in others:
                running = rows & (other.state == RUNNING)
                if running.any():
                    other.stop(running)
        if rows.any():
            self._execute(rows)

    def _skip(self, rows: BoolArray) -> None:
        left = rows & (self._executions < self.event.maximum)
        if left.any():
            self.change(left, STANDBY, SKIP)
        if self.trigger is not None:
            self.trigger.rearm(rows)
        over = rows & ~left
        if over.any():
            self.change(over, COMPLETE, SKIP)
            if self.parent is not None:
                self.parent.child_completed(over)

    def _execute(self, rows: BoolArray) -> None:
        self.change(rows, RUNNING, START)
        for action in self._actions:
            action.rearm(rows)
        for action in self._actions:
            running = rows & (self.state == RUNNING)
            if running.any():
                action.execute(running)
        self.child_completed(rows)

    def end(self, rows: BoolArray) -> None:
        """running → standby while executions are left, else → complete."""
        left = rows & (self._executions < self.event.maximum)
        if left.any():
            self.change(left, STANDBY, END)
            if self.trigger is not None:
                self.trigger.rearm(left)
        if (rows & ~left).any():
            super().end(rows & ~left)

    def child_completed(self, rows: BoolArray) -> None:
        """End where all actions are complete, but not while they are still being started."""
        for action in self._actions:
            rows = rows & (action.state != STANDBY)
        super().child_completed(rows)


class ArrayGroup(ArrayElement):
    """A ManeuverGroup in many runs."""

    def __init__(self, group: ManeuverGroup, parent: ArrayElement, run: StoryboardArrays) -> None:
        super().__init__(group, parent, run)
        self._maximum = group.maximum
        self._executions = np.zeros(run.n, np.int64)
        self._again = np.zeros(run.n, bool)

    def start(self, rows: BoolArray) -> None:
        """Count the execution and start the maneuvers."""
        self._executions[rows] += 1
        super().start(rows)

    def end(self, rows: BoolArray) -> None:
        """running → standby while executions are left, to start again in the next step; else →
        complete."""
        left = rows & (self._executions < self._maximum)
        if left.any():
            self.change(left, STANDBY, END)
            self._again |= left
        if (rows & ~left).any():
            super().end(rows & ~left)

    def restart(self) -> None:
        """Start again what ended in the last step."""
        rows, self._again = self._again, np.zeros_like(self._again)
        if not rows.any():
            return
        assert self.parent is not None
        rows = rows & (self.state == STANDBY) & (self.parent.state == RUNNING)
        if rows.any():
            for child in self.children:
                child.rearm(rows)
            self.start(rows)


class ArrayAct(ArrayElement):
    """An Act in many runs."""

    def __init__(self, act: Act, parent: ArrayElement, run: StoryboardArrays) -> None:
        super().__init__(act, parent, run)
        self.trigger = ArrayTrigger(act.trigger, run, "") if act.trigger is not None else None
        self.stop_trigger = (
            ArrayTrigger(act.stop_trigger, run, "") if act.stop_trigger is not None else None
        )

    def arm(self, rows: BoolArray) -> None:
        """Wait for the start trigger."""

    def evaluate(self, rows: BoolArray) -> None:
        """Start or stop it, where its triggers fire."""
        waiting, running = rows & (self.state == STANDBY), rows & (self.state == RUNNING)
        if waiting.any():
            fired = self.trigger.fires(waiting) if self.trigger is not None else waiting
            if fired.any():
                self.start(fired)
                # An act that has just started is asked for its stop trigger in the same step, as in
                # `Act.fire`.
                running = running | (fired & (self.state == RUNNING))
        if self.stop_trigger is not None and running.any():
            fired = self.stop_trigger.fires(running)
            if fired.any():
                self.stop(fired)
                if self.parent is not None:
                    self.parent.child_completed(fired)
