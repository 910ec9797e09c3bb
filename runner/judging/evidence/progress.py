"""Progress of a storyboard: planned events, started events, and reasons for the others."""

from __future__ import annotations

import math
from collections.abc import Container, Iterator, Sequence
from typing import TYPE_CHECKING

from runner.engine.actions.values import CustomCommandAction, ModifyAction, SetAction
from runner.engine.compile.element import PrivateAction
from runner.engine.compile.protocols import ElementState, Instant, Transition
from runner.engine.conditions.by_value import (
    ParameterCondition,
    SimulationTimeCondition,
    StoryboardElementStateCondition,
)
from runner.engine.storyboard.story_elements import ActionElement, Element
from runner.engine.storyboard.storyboard import Act, Event, Storyboard

if TYPE_CHECKING:
    from runner.engine.compile.element import Action, Condition
    from runner.engine.participants.entity import Entity
    from runner.engine.storyboard.simulation import Simulation
    from runner.engine.storyboard.triggers import TimedCondition, Trigger


def idleness(board: Storyboard, end: Instant) -> Iterator[str]:
    """One sentence on each reason that keeps elements from starting.

    Args:
        board: the storyboard as the run has left it.
        end: the last instant.
    """
    waiting: dict[str, list[Act | Event]] = {}
    elements: list[Act | Event] = [
        *board.acts,
        *(event for act in board.acts for event in act.events),
    ]
    for element in elements:
        if Transition.START in element.first:
            continue
        reason = element.trigger.missed(end) if element.trigger is not None else ""
        if reason:
            waiting.setdefault(reason, []).append(element)
    for reason, (first, *others) in waiting.items():
        more = f" (and {len(others)} more)" if others else ""
        yield (
            f"{first.kind} {first.name!r}{more} does not start: {reason} was "
            "true too early, and did "
            "not rise again: the first check is no edge, conditionEdge='none' needs none"
        )


def untested_remarks(sim: Simulation) -> Iterator[str]:
    """A sentence on events that waited when the storyboard ended the run, neither by the time alone
    nor by a mishap."""
    # A contact or the end of the road may end a scene early: what it left out is no gap in it.
    mishap = any(timed.condition.mishap for timed in _fired(sim))
    if sim.finished and not mishap and not out_of_time(sim) and first_event(sim) < math.inf:
        yield from left_out(sim)


def ended_idle(sim: Simulation) -> bool:
    """Whether the stories ended the run, without an event that acts and without the stop trigger of
    an act."""
    acts = sim.storyboard.acts
    acted = any(
        Transition.START in event.first and not _acts_on_nothing(event)
        for act in acts
        for event in act.events
    )
    return (
        sim.finished
        and not _fired(sim)
        and not acted
        and not any(Transition.STOP in act.first for act in acts)
    )


def left_out(sim: Simulation) -> Iterator[str]:
    """A sentence on events that were waiting when the run ended, where there are some."""
    waiting = [
        event
        for event in scene_events(sim)
        if Transition.START not in event.first and _waits(event, sim)
    ]
    if waiting:
        yield f"{waiting[0].where}: not all events have started: {idle(waiting, sim)}"


def endless(sim: Simulation, ego: Entity | None) -> Iterator[str]:
    """Sentence on a running action of others if the stop trigger waits for its end and a limit of
    the run came first."""
    trigger = sim.storyboard.stop_trigger
    if sim.finished or trigger is None:
        return
    # Groups are alternatives (ConditionGroup): with one that can still come true nothing is
    # missing.
    awaited = [_running(group, sim, ego) for group in trigger.groups]
    if awaited and all(awaited):
        event = awaited[0]
        assert event is not None
        yield (
            f"{event.where}: {event.kind} {event.name!r} was still running, for whose end the "
            "stop trigger waits"
        )


def unmet(sim: Simulation) -> Iterator[str]:
    """A sentence on an element that never started and that the stop trigger waits for in each of
    its groups."""
    trigger = sim.storyboard.stop_trigger
    if sim.finished or trigger is None:
        return
    # Events that wait for a contact need not start: waiting for one of them is no lack.
    wanted = {element for event in scene_events(sim) for element in (event, *event.children)}
    awaited = [_never_started(group, wanted) for group in trigger.groups]
    if awaited and all(awaited):
        element = awaited[0]
        assert element is not None
        name = f"{element.kind} {element.name!r}"
        yield f"the stop trigger waits for {name}, which never started: {end_of(sim)} ended the run"


def _never_started(group: Sequence[TimedCondition], wanted: Container[Element]) -> Element | None:
    """Element of a sound run that has not started, if a group of conditions waits for its state."""
    for timed in group:
        condition = timed.condition
        if isinstance(condition, StoryboardElementStateCondition):
            element = condition.element
            # `wanted` has events and actions only: acts, stories and groups count by themselves.
            outer = not isinstance(element, Event | ActionElement)
            if isinstance(element, Element) and not element.first and (outer or element in wanted):
                return element
    return None


def without_effect(sim: Simulation) -> Iterator[str]:
    """Sentence on a storyboard if its events have empty actions and custom commands alone, without
    effect here."""
    events = [event for act in sim.storyboard.acts for event in act.events]
    named = [event for event in events if event.actions and _is_without_effect(event)]
    others = [event for event in events if not _acts_on_nothing(event)]
    if named and not others:
        first = named[0]
        has = "no action but a custom command, which nothing here executes"
        if not any(element.actions for element in first.actions):
            has = "empty actions alone, and no other event acts"
        yield f"{first.where}: event {first.name!r} has {has}"


def _is_without_effect(event: Event) -> bool:
    actions = [action for element in event.actions for action in element.actions]
    return all(isinstance(action, CustomCommandAction) for action in actions)


def _running(group: Sequence[TimedCondition], sim: Simulation, ego: Entity | None) -> Event | None:
    """Running event of others if a group of conditions waits for its end."""
    for timed in group:
        condition = timed.condition
        if isinstance(condition, StoryboardElementStateCondition) and not condition.evaluate(sim):
            event = (
                condition.element.parent
                if isinstance(condition.element, ActionElement)
                else condition.element
            )
            if (
                isinstance(event, Event)
                and event.state is ElementState.RUNNING
                and ego not in event.group.acted
            ):
                return event
    return None


def scene_events(sim: Simulation) -> list[Event]:
    """Events of the scene that a sound run may have.

    Those that wait for a contact, for the end of the road, or for another event that does, are
    none; nor are those without actions, and those that only switch controllers, as they hand over
    the ego and change nothing about it.
    """
    events = [event for act in sim.storyboard.acts for event in act.events]
    mishaps: set[Element] = set()
    # An event that waits for the state of one that is a mishap is a mishap itself.
    for event in events:  # an event that waits for a later one is rare, and counts
        if any(
            _awaits_mishap(trigger, mishaps) for trigger in (event.trigger, _act_of(event).trigger)
        ):
            mishaps |= {event, *event.children}
    return [event for event in events if event not in mishaps and not _acts_on_nothing(event)]


def mishap_events(sim: Simulation) -> list[Event]:
    """Events that wait for a contact; empty where the storyboard has other events too."""
    if scene_events(sim):
        return []
    events = [event for act in sim.storyboard.acts for event in act.events]
    return [event for event in events if event.trigger and _awaits_mishap(event.trigger, ())]


def mishap_awaited(sim: Simulation) -> Iterator[str]:
    """Sentence on a storyboard if its events wait for a contact alone and none has started."""
    waiting = mishap_events(sim)
    events = [event for act in sim.storyboard.acts for event in act.events]
    if waiting and not any(Transition.START in event.first for event in events):
        reason = (
            f"event {waiting[0].name!r} waits for a mishap; at their velocities the ego has one"
        )
        yield f"{waiting[0].where}: {end_of(sim)} ended the run: {reason}"


def _awaits_mishap(trigger: Trigger | None, mishaps: Container[Element]) -> bool:
    """Whether each group of a trigger waits for a mishap, or for the state of one of these
    elements.
    """

    def follows(condition: Condition) -> bool:
        return (
            isinstance(condition, StoryboardElementStateCondition) and condition.element in mishaps
        )

    groups = trigger.groups if trigger is not None else []
    # All conditions of a group must hold, so that one mishap among them decides it.
    return bool(groups) and all(
        any(timed.condition.mishap or follows(timed.condition) for timed in group)
        for group in groups
    )


def _acts_on_nothing(event: Event) -> bool:
    """Whether an event has no action, or none but switches of controllers and custom commands."""
    return all(_changes_nothing(action) for element in event.actions for action in element.actions)


def _changes_nothing(action: Action) -> bool:
    # CustomCommandAction is for a simulator that knows its type: none here executes it.
    if isinstance(action, CustomCommandAction):
        return True
    return isinstance(action, PrivateAction) and action.activates_controller


def _act_of(event: Event) -> Act:
    act = event.group.parent
    assert isinstance(act, Act)
    return act


def _waits(event: Event, sim: Simulation) -> bool:
    """Whether an event waited when the run ended: neither skipped nor stopped before, not about to
    start, of this variant."""
    if any(_never(trigger, sim) for trigger in (event.trigger, _act_of(event).trigger)):
        return False
    groups = event.trigger.groups if event.trigger is not None else []
    # Conditions with a delay or an edge remember: asking them once more would change them.
    due = any(
        all(not timed.keeps_memory and timed.evaluate(sim) for timed in group) for group in groups
    )
    return not due and (
        event.state is not ElementState.COMPLETE
        or event.first.get(Transition.STOP, -math.inf) >= sim.time
    )


def _never(trigger: Trigger | None, sim: Simulation) -> bool:
    """Whether each group of a trigger waits for another variant."""
    groups = trigger.groups if trigger is not None else []
    return bool(groups) and all(
        any(_is_of_another_variant(timed.condition, sim) for timed in group) for group in groups
    )


def _is_of_another_variant(condition: Condition, sim: Simulation) -> bool:
    """Whether a condition waits for another value of a parameter, which nothing sets."""
    if not isinstance(condition, ParameterCondition) or condition.evaluate(sim):
        return False
    actions = [
        action
        for act in sim.storyboard.acts
        for event in act.events
        for element in event.actions
        for action in element.actions
    ]
    # ParameterSetAction and ParameterModifyAction (both deprecated since 1.2) alone change one.
    return not any(
        isinstance(action, SetAction | ModifyAction) and action.target.name == condition.name
        for action in actions
    )


def out_of_time(sim: Simulation) -> bool:
    """Whether a limit of time ended the run: that of the run, or a stop trigger by the simulation
    time alone."""
    fired = _fired(sim)
    return not sim.finished or (
        bool(fired) and all(isinstance(timed.condition, SimulationTimeCondition) for timed in fired)
    )


def _fired(sim: Simulation) -> Sequence[TimedCondition]:
    """Conditions by which the stop trigger ended the run."""
    trigger = sim.storyboard.stop_trigger
    return trigger.fired if trigger is not None else ()


def first_event(sim: Simulation) -> float:
    """Time (s) at which the first event started; infinite where none did."""
    return min(
        (event.first.get(Transition.START, math.inf) for event in scene_events(sim)),
        default=math.inf,
    )


def idle(awaited: list[Event], sim: Simulation) -> str:
    """Sentence on events that have not started: end of the run, and condition of the first of
    them."""
    first = awaited[0]
    act = _act_of(first)
    waiting = act.trigger if Transition.START not in act.first else first.trigger
    what = (
        f"{first.kind} {first.name!r} waited for {waiting.describe(sim)}"
        if waiting is not None
        else f"{first.name!r} waited"
    )
    more = f" (and {len(awaited) - 1} more)" if len(awaited) > 1 else ""
    return f"the run ended at {sim.time:.2f} s, by {end_of(sim)}; {what}{more}"


def end_of(sim: Simulation) -> str:
    """Cause of the end of the run, in words."""
    trigger = sim.storyboard.stop_trigger
    if not sim.finished:
        return "a limit of the run"
    return trigger.reason if trigger is not None else "the end of all stories"
