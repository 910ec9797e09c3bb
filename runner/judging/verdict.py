"""The verdict of a run, and causes for which it is inconclusive: it did not test what its file describes."""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from runner.engine.actions.values import ModifyAction, SetAction
from runner.engine.compile.element import PrivateAction
from runner.engine.compile.run import ElementState, Instant, Transition
from runner.engine.conditions.by_value import (
    ParameterCondition,
    SimulationTimeCondition,
    StoryboardElementStateCondition,
)
from runner.engine.storyboard.departures import egoless, standstill
from runner.engine.storyboard.story_elements import ActionElement
from runner.engine.storyboard.storyboard import Act, Event, Storyboard
from runner.judging.criteria.criterion import (
    Criterion,
    CriterionResult,
    judge_criteria,
    kinds,
    light_states,
)
from runner.judging.measures.measure import Facts
from runner.judging.result import Cause, Verdict
from runner.systems.drivers import SystemDriver, is_called_ego, scripted_at_start

if TYPE_CHECKING:
    from runner.engine.compile.compiler import Scenario
    from runner.engine.compile.element import Condition
    from runner.engine.participants.entity import Entity
    from runner.engine.storyboard.collision import Contacts
    from runner.engine.storyboard.departures import Departures
    from runner.engine.storyboard.simulation import Simulation
    from runner.engine.storyboard.story_elements import Element
    from runner.engine.storyboard.triggers import TimedCondition, Trigger
    from runner.judging.measures.measure import Limit
    from runner.judging.result import RunResult
    from runner.recording import Recording, Track
    from schemas.common.remarks import Remark


CAUSES: Mapping[str, str] = {
    "ignored": "an element or attribute that no version of the standard has was not executed",
    "no-actor": "private actions of a maneuver group have no actor",
    "misplaced": "a position is beyond the end of its road by more than 10 m: the end was taken",
    "absent": "a participant that the storyboard refers to has no action that places it",
    "no-ego": "the system under test drives no vehicle: the scenario has no ego; or it has no participants at all",
    "standing": "nothing sets the ego in motion, neither the scenario, which gives it no speed, nor the system under test",
    "empty": "an action of the storyboard is empty: what a participant was to do is not known",
    "stopped-at-once": "the stop trigger was true at time 0, or the stories ended without an action",
    "no-event": "no event of the storyboard started",
    "unfinished": "a limit of time ended the run while events were waiting, or before the action that the stop trigger waits for",
    "off-road": "the ego left the road, or came to its end, before the first event",
    "performance": "a speed or acceleration beyond the declared Performance, or a pose that no vehicle reaches",
    "parameters": "parameter values outside the constraints that the file declares",
}
"""Causes by name, and their meaning"""
_TOLERANCE = 1.01
"""Share of a limit of the Performance above which it is exceeded"""
_SUSTAINED = 0.5
"""Time (s) for which an acceleration must last: a change within a step is a change of state, and has none"""


def of_remarks(remarks: Iterable[Remark]) -> Iterator[Cause]:
    """Causes that are known before any run: from remarks on files."""
    return (Cause(remark.cause, str(remark)) for remark in remarks if remark.cause)


def at_beginning(
    scenario: Scenario,
    sim: Simulation,
    recording: Recording,
    departures: Departures,
    ego: Entity | None,
    system: str,
) -> Iterator[Cause]:
    """Causes that the initial actions and the triggers at time 0 decide; to be called then or later.

    Args:
        scenario: the compiled scenario.
        sim: its run.
        recording: of the run so far.
        departures: what has looked at the ego.
        ego: None where there is none.
        system: name of the system under test that was asked for, `none` for none.
    """
    yield from of_remarks((*scenario.remarks, *sim.remarks.found))
    yield from (Cause("parameters", str(violation)) for violation in scenario.violations)
    if ego is None and (system != "none" or not sim.entities):
        yield from (Cause("no-ego", text) for text in egoless(sim.entities.values(), system))
    if sim.finished and sim.step_index == 0:
        yield Cause("stopped-at-once", f"the run ended at 0.00 s, by {_end(sim)}")
    yield from _departures(sim, departures)
    yield from _beyond(scenario, recording, ego)


def of_run(
    scenario: Scenario,
    sim: Simulation,
    recording: Recording,
    departures: Departures,
    ego: Entity | None,
    system: str,
) -> Iterator[Cause]:
    """All causes of a run that has ended; arguments as in `at_beginning`."""
    yield from at_beginning(scenario, sim, recording, departures, ego, system)
    if ego is not None and system != "none" and not scripted_at_start(scenario, ego):
        yield from (
            Cause("standing", text) for text in standstill(recording.tracks.get(ego.name), system)
        )
    awaited = [event for event in _events(sim) if Transition.START not in event.first]
    if awaited and _first_event(sim) == math.inf:
        yield Cause("no-event", f"{awaited[0].where}: no event has started: {_idle(awaited, sim)}")
    elif sim.step_index and _ended_idle(sim):
        yield Cause(
            "stopped-at-once",
            f"the run ended at {sim.time:.2f} s, by the end of all stories: no action started",
        )
    elif _out_of_time(sim):
        yield from (Cause("unfinished", text) for text in (*_left_out(sim), *_endless(sim, ego)))


def idleness(board: Storyboard, end: Instant) -> Iterator[str]:
    """One sentence on each reason for which elements can't start any more.

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
        yield f"{first.kind} {first.name!r}{more} can't start: {reason} was true too early, and does not rise again"


def untested_remarks(sim: Simulation) -> Iterator[str]:
    """A sentence on events that waited when the storyboard ended the run, neither by the time alone nor by a mishap."""
    mishap = any(timed.condition.mishap for timed in _fired(sim))
    if sim.finished and not mishap and not _out_of_time(sim) and _first_event(sim) < math.inf:
        yield from _left_out(sim)


def _ended_idle(sim: Simulation) -> bool:
    """Whether the stories ended the run, without an event that acts and without the stop trigger of an act."""
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


def _left_out(sim: Simulation) -> Iterator[str]:
    """A sentence on events that were waiting when the run ended, where there are some."""
    waiting = [
        event
        for event in _events(sim)
        if Transition.START not in event.first and _waits(event, sim)
    ]
    if waiting:
        yield f"{waiting[0].where}: not all events have started: {_idle(waiting, sim)}"


def _endless(sim: Simulation, ego: Entity | None) -> Iterator[str]:
    """A sentence on an action of others whose end the stop trigger waits for, where a limit of the run came first."""
    trigger = sim.storyboard.stop_trigger
    if sim.finished or trigger is None:
        return
    awaited = [_running(group, sim, ego) for group in trigger.groups]
    if awaited and all(awaited):
        event = awaited[0]
        assert event is not None
        yield f"{event.where}: {event.kind} {event.name!r} was still running, for whose end the stop trigger waits"


def _running(group: Sequence[TimedCondition], sim: Simulation, ego: Entity | None) -> Event | None:
    """The event of others that runs and whose end a group of conditions waits for."""
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


def _events(sim: Simulation) -> list[Event]:
    """Events of the scene that a sound run may have.

    Those that wait for a contact, for the end of the road, or for another event that does, are
    none; nor are those without actions, and those that only switch controllers, as they hand over
    the ego and change nothing about it.
    """
    events = [event for act in sim.storyboard.acts for event in act.events]
    mishaps: set[Element] = set()
    for event in events:  # an event that waits for a later one is rare, and counts
        if any(
            _awaits_mishap(trigger, mishaps) for trigger in (event.trigger, _act_of(event).trigger)
        ):
            mishaps |= {event, *event.children}
    return [event for event in events if event not in mishaps and not _acts_on_nothing(event)]


def _awaits_mishap(trigger: Trigger | None, mishaps: Container[Element]) -> bool:
    """Whether each group of a trigger waits for a mishap, or for what one of these elements does."""

    def follows(condition: Condition) -> bool:
        return (
            isinstance(condition, StoryboardElementStateCondition) and condition.element in mishaps
        )

    groups = trigger.groups if trigger is not None else []
    return bool(groups) and all(
        any(timed.condition.mishap or follows(timed.condition) for timed in group)
        for group in groups
    )


def _acts_on_nothing(event: Event) -> bool:
    """Whether an event has no action, or none but switches of controllers."""
    actions = [action for element in event.actions for action in element.actions]
    return all(
        isinstance(action, PrivateAction) and action.activates_controller for action in actions
    )


def _act_of(event: Event) -> Act:
    act = event.group.parent
    assert isinstance(act, Act)
    return act


def _waits(event: Event, sim: Simulation) -> bool:
    """Whether an event waited when the run ended: neither skipped nor stopped before, not about to start, of this variant."""
    if any(_never(trigger, sim) for trigger in (event.trigger, _act_of(event).trigger)):
        return False
    groups = event.trigger.groups if event.trigger is not None else []
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
        for each in event.actions
        for action in each.actions
    ]
    return not any(
        isinstance(action, SetAction | ModifyAction) and action.target.name == condition.name
        for action in actions
    )


def _out_of_time(sim: Simulation) -> bool:
    """Whether a limit of time ended the run: that of the run, or a stop trigger by the simulation time alone."""
    fired = _fired(sim)
    return not sim.finished or (
        bool(fired) and all(isinstance(timed.condition, SimulationTimeCondition) for timed in fired)
    )


def _fired(sim: Simulation) -> Sequence[TimedCondition]:
    """Conditions by which the stop trigger ended the run."""
    trigger = sim.storyboard.stop_trigger
    return trigger.fired if trigger is not None else ()


def _first_event(sim: Simulation) -> float:
    """Time (s) at which the first event started; infinite where none did."""
    return min(
        (event.first.get(Transition.START, math.inf) for event in _events(sim)), default=math.inf
    )


def _idle(awaited: list[Event], sim: Simulation) -> str:
    """Sentence on events that have not started: what ended the run, and what the first of them waited for."""
    first = awaited[0]
    act = _act_of(first)
    waiting = act.trigger if Transition.START not in act.first else first.trigger
    what = (
        f"{first.kind} {first.name!r} waited for {waiting.describe(sim)}"
        if waiting is not None
        else f"{first.name!r} waited"
    )
    more = f" (and {len(awaited) - 1} more)" if len(awaited) > 1 else ""
    return f"the run ended at {sim.time:.2f} s, by {_end(sim)}; {what}{more}"


def _end(sim: Simulation) -> str:
    """Words on what ended the run."""
    trigger = sim.storyboard.stop_trigger
    if not sim.finished:
        return "a limit of the run"
    return trigger.reason if trigger is not None else "the end of all stories"


def _departures(sim: Simulation, departures: Departures) -> Iterator[Cause]:
    """The ego off the road, or at its end, from the first step on or before the first event."""
    first = _first_event(sim) if _events(sim) else 0.0
    for time, text in departures.first.values():
        if time < first or time <= sim.dt:
            yield Cause("off-road", f"{text}, before any event" if time < first else text)


def _beyond(scenario: Scenario, recording: Recording, ego: Entity | None) -> Iterator[Cause]:
    """Participants faster than their Performance allows, an ego that changes its speed faster or jumps; one cause each.

    Others may: `SynchronizeAction`, whose purpose is to arrive in time, is bounded by no
    Performance.
    """
    driver = ego.controls.driver if ego is not None else None
    if isinstance(driver, SystemDriver) and driver.implausible:
        yield Cause("performance", f"{driver.implausible}: no vehicle moves so")
    for track in recording.tracks.values():
        entity = scenario.entities.get(track.name)
        if entity is None or not len(track.columns["time"]):
            continue
        limits, node = entity.declared.performance, entity.declared.node
        where = f"{node.where}: " if node is not None else ""
        speed, time = np.abs(track.columns["speed"]), track.columns["time"]
        fast = np.flatnonzero(speed > _TOLERANCE * limits.max_speed)
        if fast.size:
            told = f"drives at {speed[fast[0]]:.2f} m/s at {time[fast[0]]:.2f} s; its Performance allows {limits.max_speed:g} m/s"
            yield Cause("performance", f"{where}{track.name} {told}")
        elif entity is ego:
            yield from _hasty(track, limits.max_acceleration, limits.max_deceleration, where)


def _hasty(track: Track, most: float, least: float, where: str) -> Iterator[Cause]:
    """Changes of speed beyond the limits (m/s²) in each step of `_SUSTAINED`."""
    speed, time = np.abs(track.columns["speed"]), track.columns["time"]
    steps = round(_SUSTAINED / (time[1] - time[0])) if len(time) > 1 else 0
    if not 0 < steps < len(time):
        return
    change = np.lib.stride_tricks.sliding_window_view(np.diff(speed) / np.diff(time), steps)
    for word, limit, found in (
        ("accelerates", most, change.min(axis=1)),
        ("brakes", least, (-change).min(axis=1)),
    ):
        over = np.flatnonzero(found > _TOLERANCE * limit)
        if over.size:
            told = f"{word} by {found[over[0]]:.2f} m/s² at {time[over[0]]:.2f} s; its Performance allows {limit:g} m/s²"
            yield Cause("performance", f"{where}{track.name} {told}")
            return


def judge(
    scenario: Scenario,
    contacts: Contacts,
    recording: Recording,
    ego: Entity | None,
    causes: tuple[Cause, ...] = (),
) -> Verdict:
    """The verdict of a run: a failure when the ego touched another participant or a criterion failed.

    Args:
        causes: for which it is inconclusive without a failure.
    """
    criteria = _criteria(scenario, contacts, recording, ego)
    collisions = [
        f"collision with {second if first == ego.name else first} at {time:.2f} s"
        for time, first, second in contacts.history
        if ego is not None and ego.name in (first, second)
    ]
    failures = (*collisions, *(str(result) for result in criteria if result.passed is False))
    return Verdict(failures, causes, criteria)


def _criteria(
    scenario: Scenario, contacts: Contacts, recording: Recording, ego: Entity | None
) -> tuple[CriterionResult, ...]:
    """Results of the scenario's criteria for its ego and all others that it calls so."""
    if not scenario.criteria:
        return ()
    egos = [
        entity.name
        for entity in scenario.entities.values()
        if entity is ego or is_called_ego(entity)
    ]
    return judge_criteria(
        scenario.criteria, egos, recording, contacts.history, light_states(scenario.signals.history)
    )


def criteria_remarks(criteria: Sequence[Criterion], verdict: Verdict) -> tuple[str, ...]:
    """Return the remarks on criteria that could not be judged, or whose parameters have no meaning."""
    unused = [
        f"{each.name}: {each.remark}" for each in criteria if each.kind is not None and each.remark
    ]
    return (
        *unused,
        *(f"not judged: {result}" for result in verdict.criteria if result.passed is None),
    )


def red_light_remarks(
    scenario: Scenario, recording: Recording, ego: Entity | None
) -> Iterator[str]:
    """A sentence on an ego that ran a red light, if no criterion of the scenario judges that."""
    if ego is None or not scenario.signals.history:
        return
    kind = kinds()["runningredlighttest"]
    if any(each.kind is kind for each in scenario.criteria):
        return
    criterion = Criterion(kind.name, kind, {}, 0.0, "")
    (found,) = judge_criteria(
        [criterion], [ego.name], recording, (), light_states(scenario.signals.history)
    )
    if found.passed is False:
        yield f"{ego.name} {found.reason}; the scenario has no criterion for that"


def apply_limits(result: RunResult, limits: Sequence[Limit]) -> None:
    """Fail a run by the limits that it does not keep, and remark on those that say nothing about it."""
    if result.ego is None:
        idle = tuple(
            f"{limit.text}: there is no ego to measure" for limit in limits if limit.needs_ego
        )
        result.remarks = (*result.remarks, *idle)
    if not limits:
        return
    criticality = result.criticality
    own = [entry for entry in result.events if entry.subject == result.ego]
    facts = Facts(
        criticality.summary if criticality is not None else None,
        [(entry.kind, f"{entry.subject} {entry.text} at {entry.time:.2f} s") for entry in own],
        result.status,
        result.end_time,
    )
    reasons = tuple(reason for limit in limits if (reason := limit.reason(facts)))
    if reasons:
        result.verdict = replace(result.verdict, failures=(*result.verdict.failures, *reasons))
