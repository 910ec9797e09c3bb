"""The storyboard: element states and transitions at run time (OpenSCENARIO XML 1.3, 8.3 and 8.4).

Within one step all triggers are evaluated first, then events start in document order; conditions on
element states see the states as they were when the step began, so the order of elements in the file
does not matter to them. An entity is added before the actions of the same step that act on it,
whatever their order in the file.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from runner.engine.compile.element import Action, PrivateAction
from runner.engine.compile.protocols import ElementState, Transition
from runner.engine.storyboard.story_elements import ActionElement, Element, StoryboardRun
from runner.engine.storyboard.triggers import Trigger, Watch

if TYPE_CHECKING:
    from collections.abc import Iterator

    from runner.engine.compile.element import Position
    from runner.engine.motion.placement import Placement
    from runner.engine.participants.entity import Entity


class Event(Element):
    """An Event: waits for its trigger, respects the priority among the events of its maneuver, may
    execute repeatedly."""

    kind = "event"

    def __init__(
        self, name: str, parent: Maneuver, priority: str, maximum: int, where: str = ""
    ) -> None:
        super().__init__(name, parent)
        self.where = where
        """file and line of the element"""
        self.priority = priority
        self.maximum = maximum
        self.trigger: Trigger | None = None
        self.executions = 0

    @property
    def group(self) -> ManeuverGroup:
        """The maneuver group whose actors this event acts on."""
        maneuver = self.parent
        assert maneuver is not None and isinstance(maneuver.parent, ManeuverGroup)
        return maneuver.parent

    @property
    def actions(self) -> list[ActionElement]:
        """Its actions in document order."""
        return [child for child in self.children if isinstance(child, ActionElement)]

    @property
    def waits(self) -> bool:
        """Whether the trigger may start it now."""
        return (
            self.state is ElementState.STANDBY
            and self.parent is not None
            and self.parent.state is ElementState.RUNNING
        )

    def arm(self, run: StoryboardRun) -> None:
        """Wait for the trigger (it is evaluated in this same step)."""
        self.executions = 0
        if self.trigger is not None:
            self.trigger.rearm()

    def begin(self, run: StoryboardRun) -> None:
        """Start, or be skipped, because the trigger has fired."""
        reason = self.trigger.reason if self.trigger is not None else "with its act"
        others = (
            [e for e in self.parent.children if e is not self and e.state is ElementState.RUNNING]
            if self.parent
            else []
        )
        self.executions += 1
        # A skipped event counts as an execution: `maximumExecutionCount` then limits skips too, and
        # an event that is skipped for the last time completes.
        if self.priority == "skip" and others:
            self._skip(run, reason)
            return
        # `overwrite` is the name of the priority up to 1.1, deprecated by 1.2 in favour of
        # `override`.
        if self.priority in ("override", "overwrite"):
            for other in others:
                other.stop(run, f"overridden by {self.path}")
        self._execute(run, reason)

    def _skip(self, run: StoryboardRun, reason: str) -> None:
        left = self.executions < self.maximum
        self.change(
            run, ElementState.STANDBY if left else ElementState.COMPLETE, Transition.SKIP, reason
        )
        if self.trigger is not None:
            self.trigger.rearm()
        if not left and self.parent is not None:
            self.parent.child_completed(run)

    def _execute(self, run: StoryboardRun, reason: str) -> None:
        actors = self.group.actors_for(self)
        self.change(run, ElementState.RUNNING, Transition.START, reason)
        for action in self.children:
            action.rearm(run)
        # `sorted` is stable: actions that add an entity precede those that may act on it, all else
        # stays in document order.
        for action in sorted(self.actions, key=lambda action: not action.adds):
            if self.state is ElementState.RUNNING:
                action.execute(run, actors)
        # Actions that took no time are complete by now; while they were being started the event
        # could not end, see `child_completed` below.
        self.child_completed(run)

    def end(self, run: StoryboardRun) -> None:
        """running → standby while executions are left (8.4.2.1), else → complete."""
        if self.executions < self.maximum:
            self.change(run, ElementState.STANDBY, Transition.END)
            if self.trigger is not None:
                self.trigger.rearm()
        else:
            super().end(run)

    def reset(self) -> None:
        """Reset executions and trigger."""
        super().reset()
        self.executions = 0
        if self.trigger is not None:
            self.trigger.reset()

    def child_completed(self, run: StoryboardRun) -> None:
        """End when all actions are complete, but not while they are still being started."""
        started = all(action.state is not ElementState.STANDBY for action in self.children)
        if started:
            super().child_completed(run)


class Maneuver(Element):
    """A Maneuver: runs until all its events are complete."""

    kind = "maneuver"


class ManeuverGroup(Element):
    """A ManeuverGroup: actors, and maneuvers that may execute repeatedly."""

    kind = "maneuverGroup"

    def __init__(
        self, name: str, parent: Act, maximum: int, actors: list[Entity], select_triggering: bool
    ) -> None:
        super().__init__(name, parent)
        self.maximum = maximum
        self.actors = actors
        self.select_triggering = select_triggering
        self.executions = 0
        self.acted: dict[Entity, None] = {}
        """all actors so far, those selected by triggers included"""

    def actors_for(self, event: Event) -> list[Entity]:
        """The actors of an event that starts now, those selected by its trigger (or its act's)
        included."""
        selected: tuple[Entity, ...] = ()
        if self.select_triggering:
            # An event without a start trigger starts with its act, so the act's trigger selects.
            trigger = event.trigger or (
                self.parent.trigger if isinstance(self.parent, Act) else None
            )
            selected = trigger.triggering if trigger is not None else ()
        found = dict.fromkeys((*self.actors, *selected))
        self.acted |= found
        return list(found)

    def start(self, run: StoryboardRun, reason: str = "") -> None:
        """Count the execution and start the maneuvers."""
        self.executions += 1
        super().start(run, reason)

    def end(self, run: StoryboardRun) -> None:
        """running → standby while executions are left, to start again in the next step; else →
        complete."""
        if self.executions < self.maximum:
            self.change(run, ElementState.STANDBY, Transition.END)
            # In the same step its conditions on element states would never see the group in
            # standby, and a group of actions without duration would execute all its repetitions at
            # once.
            run.call_next_step(self._restart)
        else:
            super().end(run)

    def _restart(self, run: StoryboardRun) -> None:
        # A stop trigger may have ended the act, and with it this group, since the call was left
        # behind.
        if (
            self.state is ElementState.STANDBY
            and self.parent is not None
            and self.parent.state is ElementState.RUNNING
        ):
            for child in self.children:
                child.rearm(run)
            self.start(run)

    def reset(self) -> None:
        """Reset: no executions, no actors."""
        super().reset()
        self.executions = 0
        self.acted.clear()


class Act(Element):
    """An Act: start and stop trigger over its maneuver groups."""

    kind = "act"

    def __init__(self, name: str, parent: Story) -> None:
        super().__init__(name, parent)
        self.trigger: Trigger | None = None
        self.stop_trigger: Trigger | None = None
        self._events: list[Event] | None = None

    @property
    def events(self) -> list[Event]:
        """All events of the act in document order."""
        if self._events is None:
            self._events = [
                event
                for group in self.children
                for maneuver in group.children
                for event in maneuver.children
                if isinstance(event, Event)
            ]
        return self._events

    def reset(self) -> None:
        """The triggers have never been looked at."""
        super().reset()
        for trigger in (self.trigger, self.stop_trigger):
            if trigger is not None:
                trigger.reset()

    def arm(self, run: StoryboardRun) -> None:
        """Wait for the start trigger."""

    @property
    def waits(self) -> bool:
        """Whether it waits for its start trigger or, once it runs, for its stop trigger."""
        running = self.state is ElementState.RUNNING
        return self.stop_trigger is not None if running else self.state is ElementState.STANDBY

    def fire(self, run: StoryboardRun) -> None:
        """Start by the start trigger, or stop by the stop trigger, which is evaluated in either
        case."""
        stops = self.state is ElementState.RUNNING
        if not stops:
            self.start(run, self.trigger.reason if self.trigger is not None else "with its story")
        # Start and stop trigger are both true in one step: the act starts and stops in it, since
        # the stop trigger is evaluated from the start on and must not wait for the next step.
        if self.state is not ElementState.RUNNING or self.stop_trigger is None:
            return
        if stops or self.stop_trigger.fires(run):
            self.stop(run, self.stop_trigger.reason)
            if self.parent is not None:
                self.parent.child_completed(run)


class Story(Element):
    """A Story: runs from the beginning until all its acts are complete."""

    kind = "story"


class Storyboard:
    """Init actions, stories and the stop trigger that ends the run.

    The storyboard itself ends by its stop trigger only; without one the run goes on to its time
    limit. A scenario for CARLA's scenario_runner whose stop trigger holds no conditions ends when
    all stories have.
    """

    waits = True
    """its stop trigger may end it at any time"""

    def __init__(self) -> None:
        self.init: list[tuple[Entity | None, ActionElement]] = []
        self.stories: list[Story] = []
        self.stop_trigger: Trigger | None = None
        self.ends_with_stories = False
        self._stop: Watch[Storyboard] = Watch()
        self._acts: Watch[Act] = Watch()
        self._events: Watch[Event] = Watch()
        self._places: dict[Element, int] = {}
        """places of acts and events in the document"""
        self._arming: list[Event] = []
        """events that may have begun to wait since the last step of triggers"""
        self._until, self._changes = -math.inf, 0
        """the time until which nothing is to be evaluated while `Run.changes` is this"""

    @property
    def acts(self) -> list[Act]:
        """All acts in document order."""
        return [act for story in self.stories for act in story.children if isinstance(act, Act)]

    @property
    def actors(self) -> dict[str, tuple[str, ...]]:
        """Names of the actors of each maneuver group, by the group's path: declared, and selected
        by triggers so far."""
        groups = [
            group for act in self.acts for group in act.children if isinstance(group, ManeuverGroup)
        ]
        return {
            group.path: tuple(
                entity.name for entity in {**dict.fromkeys(group.actors), **group.acted}
            )
            for group in groups
        }

    def elements(self) -> list[Element]:
        """All named elements, depth first in document order."""
        ordered: list[Element] = []
        pending: list[Element] = list(reversed(self.stories))
        while pending:
            element = pending.pop()
            ordered.append(element)
            pending.extend(reversed(element.children))
        return ordered

    def reset(self) -> None:
        """Restore the state before a run."""
        for element in (*(element for _, element in self.init), *self.elements()):
            element.reset()
        self._stop.clear()
        self._acts.clear()
        self._events.clear()
        self._arming.clear()
        if self.stop_trigger is not None:
            self.stop_trigger.reset()

    def begin(self, run: StoryboardRun) -> None:
        """Run the initial actions, then start the stories."""
        for actor, element in ordered_init(self.init):
            element.execute(run, [actor] if actor is not None else [])
        # Acts and events are watched by two lists; places number both in one document order.
        acts = self.acts
        self._places = {
            element: place
            for place, element in enumerate(
                (*acts, *(event for act in acts for event in act.events))
            )
        }
        if self.stop_trigger is not None:
            self._stop.add(0, self, self.stop_trigger)
        for story in self.stories:
            story.start(run)
        for act in acts:
            self._acts.add(self._places[act], act, act.trigger)

    def changed(self, element: Element) -> None:
        """Note that an element has changed its state: it may wait for a trigger from now on."""
        self._until = -math.inf
        # Any change of state may end the waiting of elements below it.
        self._acts.stale = self._events.stale = True
        if isinstance(element, Event):
            self._arming.append(element)
        elif isinstance(element, Maneuver):
            self._arming += [child for child in element.children if isinstance(child, Event)]

    def evaluate(self, run: StoryboardRun) -> bool:
        """One step of triggers; true when the storyboard's stop trigger ends the run.

        All triggers look at the same instant: no event starts before every waiting one has been
        looked at.
        """
        # Nothing can fire before `_until` unless the run changes: most steps of most scenarios end
        # here.
        if run.time < self._until and run.changes == self._changes:
            return False
        if self.stop_trigger is not None and self._stop.due(run):
            if not any(timed.condition.mishap for timed in self.stop_trigger.fired):
                run.leave_off()  # after a mishap nobody expects the goals to be reached
            for story in self.stories:
                story.stop(run, self.stop_trigger.reason)
            return True
        for act in self._acts.due(run):
            act.fire(run)
            # Now its stop trigger is awaited in place of the start trigger.
            self._acts.add(self._places[act], act, act.stop_trigger)
        for event in self._arming:
            if event.waits:
                self._events.add(self._places[event], event, event.trigger)
        self._arming = []
        due = self._events.due(run)
        # All due events were found before the first one starts, so what one of them changes cannot
        # fire another in this step. Some may not wait any more: an earlier event has overridden or
        # stopped them.
        for event in _adding_first(due) if len(due) > 1 else due:
            if event.waits:
                event.begin(run)
        # With everything dormant the whole evaluation rests until the earliest of the ends.
        if not (self._arming or self._events.awake or self._acts.awake or self._stop.awake):
            self._changes = run.changes
            self._until = min(self._stop.quiet, self._acts.quiet, self._events.quiet)
        ends = self.ends_with_stories and all(
            story.state is ElementState.COMPLETE for story in self.stories
        )
        if ends:
            run.leave_off()
        return ends


def ordered_init(
    init: list[tuple[Entity | None, ActionElement]],
) -> list[tuple[Entity | None, ActionElement]]:
    """Initial actions in an order in which every state that one reads has been set.

    Document order, except that an action that refers to another entity waits for that entity's own
    actions in the same control domain and for those that place it (relative positions and speeds
    may precede what they refer to). Circular references keep document order; the position then says
    that the other entity has no place yet.
    """
    pending, done = list(init), []
    while pending:
        # In a circle nothing is ready: the first in the document is taken, so that the loop ends.
        ready = next((item for item in pending if not _waits(item, pending)), pending[0])
        pending.remove(ready)
        done.append(ready)
    return done


def _waits(
    item: tuple[Entity | None, ActionElement], pending: list[tuple[Entity | None, ActionElement]]
) -> bool:
    actor, element = item
    for action in element.actions:
        needed = {id(entity) for entity in action.references()}
        for other, others in pending if needed else ():
            # The actor's own actions keep document order; entities that the action does not refer
            # to cannot matter to it.
            if other is not None and (other is actor or id(other) not in needed):
                continue
            if any(
                _prepares(earlier, action, needed)
                for earlier in others.actions
                if earlier is not action
            ):
                return True
    return False


def _prepares(earlier: Action, later: Action, needed: set[int]) -> bool:
    if isinstance(earlier, PrivateAction):
        # A relative speed needs the speed of the other entity, so actions in the same control
        # domain count; a position needs its place only.
        return earlier.places or (
            isinstance(later, PrivateAction)
            and not set(earlier.claims()).isdisjoint(later.claims())
        )
    return any(id(entity) in needed for entity, _ in earlier.puts())


def _adding_first(due: list[Event]) -> list[Event]:
    """Events that start in one step: those that add an absent entity before the first one that acts
    on it, else as they are."""
    # Events without AddEntityAction stay in document order; only those whose actors are added in
    # this same step move behind the event that adds them.
    adding = {
        event: added
        for event in due
        if (added := {entity for action in event.actions for entity in action.adds})
    }
    order: dict[Event, None] = {}
    for event in due:
        actors = event.group.actors
        order |= dict.fromkeys(
            other
            for other, added in adding.items()
            if other is not event and not added.isdisjoint(actors)
        )
        order[event] = None
    return list(order)


# actions and their actors, before any run -------------------------------------------------------


def check_actors(storyboard: Storyboard) -> None:
    """Check every action against its certain actors.

    Raises:
        InvalidFile: one makes no sense for one of its actors.
    """
    starts = list(_starts(storyboard))
    puts: dict[Entity, list[Position | None]] = {}
    for action, actors in starts:
        for entity, position in _puts(action, actors):
            puts.setdefault(entity, []).append(position)
    places = {entity: _fixed(positions) for entity, positions in puts.items()}
    selects = any(event.group.select_triggering for act in storyboard.acts for event in act.events)
    for action, actors in starts:
        if isinstance(action, PrivateAction):
            for actor in actors:
                # If triggers select actors, any entity may be placed by any action: its places are
                # unknown, not none.
                action.check(actor, None if selects else places.get(actor, []))


def placeable(storyboard: Storyboard) -> set[Entity] | None:
    """Entities that some action can put somewhere; None where triggers select actors, which are
    known in a run only."""
    if any(event.group.select_triggering for act in storyboard.acts for event in act.events):
        return None
    return {entity for action, actors in _starts(storyboard) for entity, _ in _puts(action, actors)}


def _starts(storyboard: Storyboard) -> Iterator[tuple[Action, list[Entity]]]:
    """Every action, with the actors that it is sure to have."""
    for actor, element in storyboard.init:
        for action in element.actions:
            yield action, [actor] if actor is not None else []
    for act in storyboard.acts:
        for event in act.events:
            for child in event.children:
                if isinstance(child, ActionElement):
                    for action in child.actions:
                        yield action, event.group.actors


def _puts(action: Action, actors: list[Entity]) -> Iterator[tuple[Entity, Position | None]]:
    if isinstance(action, PrivateAction):
        for actor in actors:
            yield from action.puts(actor)
    else:
        yield from action.puts()


def _fixed(positions: list[Position | None]) -> list[Placement] | None:
    """The places of positions; None where one of them changes."""
    fixed = [
        position.fixed
        for position in positions
        if position is not None and position.fixed is not None
    ]
    return fixed if len(fixed) == len(positions) else None
