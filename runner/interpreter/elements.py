"""What all storyboard elements share: states and transitions; and actions in execution (OpenSCENARIO XML 1.3, 8.3, 8.4.1)."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from typing import TYPE_CHECKING, ClassVar

from runner.contracts.action import Action, GlobalAction, PrivateAction, Running

if TYPE_CHECKING:
    from runner.interpreter.simulation import Simulation
    from runner.participants.entity import Entity


class State(StrEnum):
    """State of a storyboard element (StoryboardElementState)."""

    STANDBY = "standbyState"
    RUNNING = "runningState"
    COMPLETE = "completeState"


class Transition(StrEnum):
    """Transition between states (StoryboardElementState)."""

    START = "startTransition"
    END = "endTransition"
    STOP = "stopTransition"
    SKIP = "skipTransition"


class Element:
    """A storyboard element with its state.

    `seen_state` and `seen_transitions` are what conditions may look at: the state at the beginning of the
    current step and the transitions of the step before.
    """

    kind: ClassVar[str] = ""

    def __init__(self, name: str, parent: Element | None) -> None:
        self.name = name
        self.parent = parent
        self.children: list[Element] = []
        self.state = State.STANDBY
        self.transitions: list[Transition] = []
        self.seen_state = State.STANDBY
        self.seen_transitions: tuple[Transition, ...] = ()
        if parent is not None:
            parent.children.append(self)

    @property
    def path(self) -> str:
        """Name with the names of the enclosing elements, joined by `::` as in a StoryboardElementRef."""
        above = self.parent.path if self.parent else ""
        return f"{above}::{self.name}" if above else self.name

    def change(self, sim: Simulation, state: State, transition: Transition, reason: str = "") -> None:
        """Go to a state by a transition, for the conditions and the event log to see."""
        self.state = state
        self.transitions.append(transition)
        sim.element_changed(self, transition, reason)

    def publish(self) -> None:
        """Make the current state the one that conditions see."""
        self.seen_state = self.state
        self.seen_transitions = tuple(self.transitions)
        self.transitions.clear()

    def start(self, sim: Simulation, reason: str = "") -> None:
        """standby → running, and the children after it."""
        self.change(sim, State.RUNNING, Transition.START, reason)
        for child in self.children:
            child.arm(sim)
        self.child_completed(sim)

    def arm(self, sim: Simulation) -> None:
        """The parent is running: begin (or, for elements with a trigger, begin to wait)."""
        self.start(sim)

    def stop(self, sim: Simulation, reason: str = "") -> None:
        """→ complete by stopTransition, children included."""
        if self.state is State.COMPLETE:
            return
        for child in self.children:
            child.stop(sim, reason)
        self.change(sim, State.COMPLETE, Transition.STOP, reason)

    def child_completed(self, sim: Simulation) -> None:
        """End when every child is complete."""
        if self.state is State.RUNNING and all(child.state is State.COMPLETE for child in self.children):
            self.end(sim)

    def end(self, sim: Simulation) -> None:
        """running → complete, and tell the parent."""
        self.change(sim, State.COMPLETE, Transition.END)
        if self.parent is not None:
            self.parent.child_completed(sim)

    def reset(self) -> None:
        """Back to standby without a transition, children included: the parent executes anew."""
        self.state = State.STANDBY
        for child in self.children:
            child.reset()


class Process:
    """One action in execution, for one actor or for the simulation."""

    __slots__ = ("actor", "domains", "element", "running")

    def __init__(self, element: ActionElement, actor: Entity | None, running: Running, domains: tuple[str, ...]) -> None:
        self.element = element
        self.actor = actor
        self.running = running
        self.domains = domains

    def release(self) -> None:
        """Give back the control domains and whatever the action holds."""
        if self.actor is not None:
            for domain in self.domains:
                if self.actor.controls.get(domain) is self:
                    del self.actor.controls[domain]
        self.running.stop()


class ActionElement(Element):
    """An Action of an event, or (with the storyboard as its parent) of the Init section."""

    kind = "action"

    def __init__(self, name: str, parent: Element | None, actions: Sequence[Action], whole: bool = False) -> None:
        super().__init__(name, parent)
        self.actions = actions
        self.whole = whole
        """Whether the actors are one EntitySelection: a conflict for one is a conflict for all (standard 7.5.1)."""
        self._processes: list[Process] = []

    def execute(self, sim: Simulation, actors: Sequence[Entity], reason: str = "") -> None:
        """Start for these actors; complete at once when nothing is left to run."""
        self.change(sim, State.RUNNING, Transition.START, reason)
        for action in self.actions:
            if isinstance(action, GlobalAction):
                self._begin(sim, None, action.start(sim), ())
            else:
                for actor in actors:
                    self._start_private(sim, action, actor)
        if self.state is State.RUNNING and not self._processes:
            self.end(sim)

    def _start_private(self, sim: Simulation, action: PrivateAction, actor: Entity) -> None:
        domains = action.claims()
        for domain in domains:
            owner = actor.controls.get(domain)
            if owner is not None:
                owner.element.override(sim, owner, f"overridden by {self.path}")
        self._begin(sim, actor, action.start(actor, sim), domains)

    def _begin(self, sim: Simulation, actor: Entity | None, running: Running | None, domains: tuple[str, ...]) -> None:
        if running is None:
            return
        process = Process(self, actor, running, domains)
        self._processes.append(process)
        sim.processes.append(process)
        if actor is not None:
            actor.controls.update(dict.fromkeys(domains, process))

    def finished(self, sim: Simulation, process: Process) -> None:
        """One of the processes has reached its goal."""
        self._drop(sim, process)
        if self.state is State.RUNNING and not self._processes:
            self.end(sim)

    def override(self, sim: Simulation, process: Process, reason: str) -> None:
        """A newer action takes a control domain from one of the processes: as if stopped (standard 7.5.1)."""
        if self.whole:
            self.stop(sim, reason)
        else:
            self._drop(sim, process)
        if not self._processes and self.state is State.RUNNING:
            self.change(sim, State.COMPLETE, Transition.STOP, reason)
        if self.parent is not None:
            self.parent.child_completed(sim)

    def stop(self, sim: Simulation, reason: str = "") -> None:
        """Stop all processes, → complete by stopTransition."""
        for process in tuple(self._processes):
            self._drop(sim, process)
        super().stop(sim, reason)

    def _drop(self, sim: Simulation, process: Process) -> None:
        if process in self._processes:
            self._processes.remove(process)
            sim.processes.remove(process)
            process.release()
