"""Storyboard elements: states and transitions; actions in execution (OpenSCENARIO XML 1.3, 8.3,
8.4.1)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, ClassVar, Protocol

from runner.engine.compile.element import Action, GlobalAction, PrivateAction
from runner.engine.compile.protocols import ElementState, Run, Running, Transition
from xosc.rules.references import ENTITY_POSITION_UID

if TYPE_CHECKING:
    from runner.engine.participants.entity import Entity
    from xosc.document.node import Node


class StoryboardRun(Run, Protocol):
    """State and methods of a run for storyboard elements."""

    @property
    def processes(self) -> list[Process]:
        """The actions in execution, for each actor."""
        ...

    @property
    def ended(self) -> list[Process]:
        """The actions that end with the coming step, in which their entities still move."""
        ...

    def leave_off(self) -> None:
        """Report the rests of the running actions, because the run stops."""
        ...

    def enter(self, entity: Entity) -> None:
        """Bring an entity that has got its first place into the world, its trailers with it."""
        ...

    def element_changed(self, element: Element, transition: Transition, reason: str) -> None:
        """An element has made a transition; conditions see it from the next step on."""
        ...

    def element_rearmed(self, element: Element) -> None:
        """An element is back in standby without a transition; conditions see it from the next step
        on."""
        ...

    def call_next_step(self, call: Callable[[StoryboardRun], None]) -> None:
        """Have something called at the beginning of the next step."""
        ...


class Element:
    """A storyboard element with its state.

    `seen_state` and `seen_transitions` are what conditions may look at: the state at the beginning
    of the current step and the transitions of the step before. `first` is when (s) it first made
    each transition in the run.
    """

    kind: ClassVar[str] = ""

    def __init__(self, name: str, parent: Element | None) -> None:
        self.name = name
        self.parent = parent
        self.children: list[Element] = []
        self.state = ElementState.STANDBY
        self.transitions: list[Transition] = []
        self.seen_state = ElementState.STANDBY
        self.seen_transitions: tuple[Transition, ...] = ()
        self.first: dict[Transition, float] = {}
        if parent is not None:
            parent.children.append(self)

    @property
    def path(self) -> str:
        """Name with the names of the enclosing elements, joined by `::` as in a
        StoryboardElementRef."""
        above = self.parent.path if self.parent else ""
        return f"{above}::{self.name}" if above else self.name

    @property
    def names(self) -> tuple[str, ...]:
        """The name with the names of the enclosing elements, from the story inwards."""
        return (*self.parent.names, self.name) if self.parent is not None else (self.name,)

    def change(
        self, run: StoryboardRun, state: ElementState, transition: Transition, reason: str = ""
    ) -> None:
        """Go to a state by a transition, for the conditions and the event log to see."""
        self.state = state
        self.transitions.append(transition)
        self.first.setdefault(transition, run.time)
        run.element_changed(self, transition, reason)

    def publish(self) -> None:
        """Make the current state visible to conditions."""
        self.seen_state = self.state
        self.seen_transitions = tuple(self.transitions)
        self.transitions.clear()

    def start(self, run: StoryboardRun, reason: str = "") -> None:
        """standby → running, and the children after it."""
        self.change(run, ElementState.RUNNING, Transition.START, reason)
        for child in self.children:
            child.arm(run)
        # An element without children, or whose children were complete at once, ends in the same
        # step.
        self.child_completed(run)

    def arm(self, run: StoryboardRun) -> None:
        """The parent is running: begin (or, for elements with a trigger, begin to wait)."""
        self.start(run)

    def stop(self, run: StoryboardRun, reason: str = "") -> None:
        """→ complete by stopTransition, children included."""
        # A complete element makes no second transition: stopTransition starts from standby or
        # running.
        if self.state is ElementState.COMPLETE:
            return
        for child in self.children:
            child.stop(run, reason)
        self.change(run, ElementState.COMPLETE, Transition.STOP, reason)

    def child_completed(self, run: StoryboardRun) -> None:
        """End when every child is complete."""
        if self.state is ElementState.RUNNING and all(
            child.state is ElementState.COMPLETE for child in self.children
        ):
            self.end(run)

    def end(self, run: StoryboardRun) -> None:
        """running → complete, and tell the parent."""
        self.change(run, ElementState.COMPLETE, Transition.END)
        if self.parent is not None:
            self.parent.child_completed(run)

    def rearm(self, run: StoryboardRun) -> None:
        """Back to standby without a transition, children included: the parent executes anew."""
        self.state = ElementState.STANDBY
        # The standard has no transition from complete to standby, so none is published; conditions
        # on the state have to see standby all the same.
        run.element_rearmed(self)
        for child in self.children:
            child.rearm(run)

    def reset(self) -> None:
        """Restore the state before a run; the storyboard resets children."""
        self.state = self.seen_state = ElementState.STANDBY
        self.transitions.clear()
        self.seen_transitions = ()
        self.first.clear()


class Process:
    """One action in execution, for one actor or for the simulation."""

    __slots__ = ("actor", "domains", "element", "run", "running")

    def __init__(
        self,
        run: StoryboardRun,
        element: ActionElement,
        actor: Entity | None,
        running: Running,
        domains: tuple[str, ...],
    ) -> None:
        self.run = run
        self.element = element
        self.actor = actor
        self.running = running
        self.domains = domains

    def override(self, reason: str) -> None:
        """End the action for this actor: a newer action takes one of the control domains."""
        self.element.override(self.run, self, reason)

    def release(self) -> None:
        """Give back the control domains and other holdings of the action."""
        if self.actor is not None:
            for domain in self.domains:
                if self.actor.controls.owners.get(domain) is self:
                    del self.actor.controls.owners[domain]
        self.running.stop()


class ActionElement(Element):
    """An Action of an event, or (with the storyboard as its parent) of the Init section."""

    kind = "action"

    def __init__(
        self,
        name: str,
        parent: Element | None,
        actions: Sequence[Action],
        whole: bool = False,
        node: Node | None = None,
    ) -> None:
        super().__init__(name, parent)
        self.actions = actions
        self.node = node
        """its element, or that of initial actions"""
        self.whole = whole
        """Whether the actors are one EntitySelection: a conflict for one is a conflict for all
        (standard 7.5.1)."""
        self._processes: list[Process] = []

    @property
    def adds(self) -> list[Entity]:
        """Entities that it adds and that are absent now."""
        # `active` is asked when the event starts, not when the scenario is compiled: an entity that
        # was deleted meanwhile may be added again.
        placed = [
            entity
            for action in self.actions
            if isinstance(action, GlobalAction)
            for entity, _ in action.puts()
        ]
        return [entity for entity in placed if not entity.active]

    def execute(self, run: StoryboardRun, actors: Sequence[Entity], reason: str = "") -> None:
        """Start for those of these actors that are there; complete at once when nothing is left to
        run.

        An action that places its actor brings in one that has had no place so far; one that was
        deleted has to be added again.
        """
        self.change(run, ElementState.RUNNING, Transition.START, reason)
        for action in self.actions:
            if isinstance(action, GlobalAction):
                self._begin(run, None, action.start(run), ())
            else:
                for actor in actors:
                    # An entity without a place so far is brought in by its first position, as in
                    # Init; one that was deleted needs an AddEntityAction.
                    if actor.active or (action.places and not actor.placed):
                        self._start_private(run, action, actor)
                    else:
                        self._leave_out(run, actor)
        if self.state is ElementState.RUNNING and not self._processes:
            self.end(run)

    def _leave_out(self, run: StoryboardRun, actor: Entity) -> None:
        run.note("entity", actor.name, f"is not there: {self.path} leaves it out")
        if self.node is not None:
            text = (
                f"{actor.name!r} is not there at {run.time:.2f} s: the action {self.name!r} does "
                "nothing for it"
            )
            run.remarks.note(self.node.remark(ENTITY_POSITION_UID, text))

    def _start_private(self, run: StoryboardRun, action: PrivateAction, actor: Entity) -> None:
        domains = action.claims()
        for domain in domains:
            # The newest action owns the control domain (7.5.1); ending the old one first lets it
            # give back what it holds before the new one reads the actor's state.
            owner = actor.controls.owners.get(domain)
            if owner is not None:
                owner.override(f"overridden by {self.path}")
        for entity in action.references():
            # A deleted entity keeps its last place: the action refers to that, with a remark.
            if entity.placed and not entity.active and entity is not actor:
                self.lose(run, entity)
        self._begin(run, actor, action.start(actor, run), domains)
        if not actor.active:
            # After the start: only now the actor has the place that the action gives it.
            run.enter(actor)

    def lose(self, run: StoryboardRun, entity: Entity) -> None:
        """Remark that an entity that the action refers to has left the scenario."""
        if self.node is not None:
            text = (
                f"{entity.name!r} is not there at {run.time:.2f} s: the action {self.name!r}"
                " refers to where it was last"
            )
            run.remarks.note(self.node.remark(ENTITY_POSITION_UID, text))

    def _begin(
        self,
        run: StoryboardRun,
        actor: Entity | None,
        running: Running | None,
        domains: tuple[str, ...],
    ) -> None:
        if running is None:
            return
        process = Process(run, self, actor, running, domains)
        self._processes.append(process)
        run.processes.append(process)
        if actor is not None:
            actor.controls.owners.update(dict.fromkeys(domains, process))

    def finished(self, run: StoryboardRun, process: Process) -> None:
        """One of the processes has reached its goal."""
        self._drop(run, process)
        # What is left to its goal is read at the end of the step, after the entity has moved.
        run.ended.append(process)
        if self.state is ElementState.RUNNING and not self._processes:
            self.end(run)

    def override(self, run: StoryboardRun, process: Process, reason: str) -> None:
        """A newer action takes a control domain from one of the processes: as if stopped (standard
        7.5.1)."""
        # 7.5.1: a selection of entities counts as one actor, so a conflict for one of them ends the
        # action for all of them.
        if self.whole:
            self.stop(run, reason)
        else:
            self._drop(run, process)
        if not self._processes and self.state is ElementState.RUNNING:
            self.change(run, ElementState.COMPLETE, Transition.STOP, reason)
        if self.parent is not None:
            self.parent.child_completed(run)

    def stop(self, run: StoryboardRun, reason: str = "") -> None:
        """Stop all processes, → complete by stopTransition."""
        # A copy, since `_drop` removes from the list.
        for process in tuple(self._processes):
            self._drop(run, process)
        super().stop(run, reason)

    def reset(self) -> None:
        """Drop all actions in execution."""
        super().reset()
        self._processes.clear()

    def _drop(self, run: StoryboardRun, process: Process) -> None:
        # `end_actions` holds a copy of the list: the override of one process may have ended its
        # siblings.
        if process in self._processes:
            self._processes.remove(process)
            run.processes.remove(process)
            process.release()
