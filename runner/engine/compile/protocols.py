"""Protocols of a run, `runner.engine.storyboard.simulation.Simulation`: what it offers to
positions, conditions and actions, its storyboard elements, and actions in progress.

Each protocol adds to the one before; `Simulation` is all of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, MutableMapping, Sequence
from enum import StrEnum
from random import Random
from typing import TYPE_CHECKING, NamedTuple, Protocol

if TYPE_CHECKING:
    from runner.engine.motion.on_roads import Roads
    from runner.engine.motion.placement import Placement
    from runner.engine.participants.entity import Displacement, Entities, Entity
    from runner.engine.worlds.base import World
    from runner.engine.worlds.surroundings import Environment, TrafficSignals
    from schemas.common.remarks import Remarks
    from schemas.expressions.values import Value


class Surroundings(Protocol):
    """Context in which positions are resolved."""

    @property
    def roads(self) -> Roads:
        """The road network, and where entities are on it."""
        ...

    @property
    def random(self) -> Random:
        """The run's source of random numbers."""
        ...

    @property
    def remarks(self) -> Remarks:
        """Repairs that only a run can know of, as `Context.repair` is for those that the files
        show."""
        ...


class Instant(Surroundings, Protocol):
    """State of a run that conditions read."""

    @property
    def entities(self) -> Entities:
        """All entities by name, traffic included."""
        ...

    @property
    def time(self) -> float:
        """Simulation time, s."""
        ...

    @property
    def dt(self) -> float:
        """Time step, s."""
        ...

    @property
    def step_index(self) -> int:
        """Number of steps done."""
        ...

    @property
    def changes(self) -> int:
        """Number of calls of `Run.wake`: one for each discrete change of storyboard elements,
        values, contacts and the set of entities."""
        ...

    @property
    def parameters(self) -> MutableMapping[str, Value]:
        """Present values of the global parameters."""
        ...

    @property
    def variables(self) -> MutableMapping[str, Value]:
        """Present values of the variables."""
        ...

    @property
    def user_values(self) -> Mapping[str, str]:
        """Values that come from outside the scenario."""
        ...

    @property
    def environment(self) -> Environment:
        """Weather, time of day and road condition."""
        ...

    @property
    def signals(self) -> TrafficSignals:
        """The traffic signals."""
        ...

    @property
    def displacement(self) -> Displacement:
        """Bound on the displacement of entities."""
        ...

    def touching(self, entity: Entity) -> Sequence[Entity]:
        """Return the entities whose boxes touch an entity's box now, sorted by name."""
        ...


class Run(Instant, Protocol):
    """State and methods of a run for actions."""

    @property
    def initialising(self) -> bool:
        """Whether the initial actions and the events of time 0 are starting: what takes no time
        sets the initial state."""
        ...

    @property
    def monitors(self) -> MutableMapping[str, bool]:
        """Present values of the monitors."""
        ...

    @property
    def world(self) -> World:
        """The simulator."""
        ...

    @property
    def running(self) -> Iterable[Running]:
        """The actions in execution."""
        ...

    def wake(self) -> None:
        """Wake resting conditions: to be called after each change of state that they may read.

        `note`, and all methods below that bring, take out or move entities, do so themselves.
        """
        ...

    def note(self, kind: str, subject: str, text: str = "", time: float | None = None) -> None:
        """Write a line of the event log, at a time within this step (s) or at its end."""
        ...

    def set_environment(self, environment: Environment) -> None:
        """Change weather, time of day and road condition."""
        ...

    def end_actions(self, entity: Entity, reason: str) -> None:
        """End all actions of an entity, as if newer ones had taken their control domains."""
        ...

    def place(self, entity: Entity, placement: Placement) -> None:
        """Place an entity at its present speed; from there it follows its lane, or drives straight
        ahead."""
        ...

    def relocated(self, entity: Entity) -> None:
        """Show an entity, and its trailers, where an action has put it at this time, not only after
        the coming step."""
        ...

    def activate(self, entity: Entity, placement: Placement) -> None:
        """Bring an entity into the world (AddEntityAction), at the speed that it was last asked
        for, its trailers with it."""
        ...

    def deactivate(self, entity: Entity) -> None:
        """Take an entity out of the world (DeleteEntityAction): its running actions end."""
        ...

    def spawn(self, entity: Entity, placement: Placement, speed: float) -> bool:
        """Bring in traffic at a speed (m/s) for the world's own driver; false where that can't
        drive."""
        ...

    def despawn(self, entity: Entity) -> None:
        """Take such traffic out again."""
        ...


class Rest(NamedTuple):
    """Rest of an action at its end, or when the run stops: goal, reached value, and difference.

    Attributes:
        goal, reached: texts with units.
        left: distance from the goal, in its unit; not negative.
        tolerance: the greatest rest that counts as none.
    """

    goal: str
    reached: str
    left: float
    tolerance: float

    def __str__(self) -> str:
        return f"its goal is {self.goal}, it has reached {self.reached}"


class Running(Protocol):
    """An action in execution for one actor (or for none, if global)."""

    __slots__ = ()

    def rest(self) -> Rest | None:
        """Return what is left of its goal, by default nothing: after the step that has led to its
        end, or where the run stops."""
        return None

    def follows(self) -> Entity | None:
        """Return the entity that the action reads in every step, by default none."""
        return None

    def step(self, dt: float) -> bool:
        """Act on the interval from now to now + dt (s); true when the action's goal is reached at
        its end."""
        ...

    def stop(self) -> None:
        """Give back whatever is held, by default nothing; called once, when the action ends, is
        overridden or stopped."""
        return


class ElementState(StrEnum):
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


class StoryboardElement(Protocol):
    """A story, act, maneuver group, maneuver, event or action."""

    @property
    def kind(self) -> str:
        """Kind of the element: story, act, maneuver group, maneuver, event or action
        (StoryboardElementType)."""
        ...

    @property
    def path(self) -> str:
        """Name with the names of the enclosing elements, joined by `::` as in a
        StoryboardElementRef."""
        ...

    @property
    def names(self) -> tuple[str, ...]:
        """The name with the names of the enclosing elements, from the story inwards."""
        ...

    @property
    def state(self) -> ElementState:
        """The state now."""
        ...

    @property
    def transitions(self) -> Sequence[Transition]:
        """The transitions of this step."""
        ...

    @property
    def seen_state(self) -> ElementState:
        """State at the beginning of the current step, which conditions read."""
        ...

    @property
    def seen_transitions(self) -> Sequence[Transition]:
        """The transitions of the step before."""
        ...
