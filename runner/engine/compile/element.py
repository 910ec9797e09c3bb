"""Contracts of positions, conditions and actions: what their classes offer to the interpreter.

A position is an object that resolves to a place in a run, a condition a logical expression that
describes itself with current values.

An action class is built once from its element (`from_xml`) and holds no state. `start` applies it;
what takes simulation time comes back as a `Running`, one for each actor, with the state of this
execution.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from runner.engine.participants.entity import LATERAL as LATERAL
from schemas.expressions.columns import NotInArrays, current
from schemas.expressions.values import MARK

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from runner.engine.compile.array_protocols import ArrayProcess, ArrayRun, ArraySteps
    from runner.engine.compile.protocols import Instant, Run, Running, Surroundings
    from runner.engine.motion.placement import Placement
    from runner.engine.participants.entity import Entity
    from runner.engine.participants.rows import EntityRows
    from schemas.common.array_types import BoolArray, FloatArray
    from xosc.document.node import Node


class Position(ABC):
    """A position of the standard.

    Attributes:
        node: its element, for complaints.
        fixed: where it is, for positions that are the same throughout every run.
        oriented: whether the file prescribes an orientation.
        grounded: whether the height is that of the road's surface.
        repaired: whether it was read with a repair for its one of many parameter sets.
    """

    repaired = False

    def __init__(self, node: Node) -> None:
        self.node = node
        self.fixed: Placement | None = None
        self.oriented = node.find("Orientation") is not None
        self.grounded = True

    @abstractmethod
    def resolve(self, run: Surroundings | None, actor: Entity | None = None) -> Placement:
        """Return the current place.

        Args:
            run: the run; positions with `fixed` need none.
            actor: the entity concerned, for shapes that begin where it is.

        Raises:
            InvalidFile: there is no such place at the moment: with the line of the position's
                element.
        """

    def at_set(self, number: int) -> Position:
        """The position in one of the parameter sets for which the scenario was read."""
        return self

    def stations(
        self, run: ArrayRun, first: int, varying: Mapping[str, FloatArray]
    ) -> FloatArray | None:
        """s (m) of the place in many runs (n,), where it differs from that in one of them by s
        alone; NaN where not.

        None for positions that say nothing of it.

        Args:
            first: row of that run.
            varying: attributes of the element that vary, by name (n,).
        """
        return None

    def references(self) -> tuple[Entity, ...]:
        """Entities whose place must be known before this position can be resolved."""
        return ()

    def current(self, entity: Entity) -> Entity:
        """The entity referred to, once it has a place."""
        if not entity.placed:
            raise self.node.invalid(
                f"the position is relative to {entity.name!r}, which has no position yet"
            )
        return entity


class FixedPosition(Position):
    """A position that does not depend on anything that happens."""

    fixed: Placement

    def __init__(self, node: Node, placement: Placement) -> None:
        super().__init__(node)
        self.fixed = placement

    def resolve(self, run: Surroundings | None, actor: Entity | None = None) -> Placement:
        """The place."""
        return self.fixed


class _Rebuilt:
    """Objects of an element in each of the parameter sets for which the scenario is read.

    Args:
        node: the element, with the marks of columns.
        build: makes an object of it, and says whether it was repaired.
    """

    def __init__(self, node: Node, build: Callable[[Node], tuple[Any, bool]]) -> None:
        self._node, self._build = node, build
        self._varying = [
            (inner.element, name, current().of(str(text)).view(np.ndarray))
            for inner in node.iter()
            for name, text in inner.element.attrib.items()
            if str(text).startswith(MARK)
        ]
        self._number, self.repaired = -1, False
        self.known = self.at(0)

    def attributes(self, node: Node) -> dict[str, FloatArray] | None:
        """Values of the attributes that vary, in each set, by name; None where they are not all of
        a node."""
        if any(element is not node.element for element, _, _ in self._varying):
            return None
        return {str(name): values for _, name, values in self._varying}

    def at(self, number: int) -> Any:
        """Return the object of a set."""
        if number != self._number:
            for element, name, values in self._varying:
                element.set(name, repr(float(values[number])))
            self._number, (self.known, self.repaired) = number, self._build(self._node)
        return self.known


class VaryingPosition(Position):
    """A position with numbers that vary between the parameter sets for which the scenario is read.

    Args:
        node: its element, with the marks of columns.
        build: makes a position of an element, and says whether it was repaired.
    """

    def __init__(self, node: Node, build: Callable[[Node], tuple[Position, bool]]) -> None:
        super().__init__(node)
        self._rebuilt = _Rebuilt(node, build)
        self._known: Position = self._rebuilt.known

    def at_set(self, number: int) -> Position:
        """Built of the numbers of that set."""
        found: Position = self._rebuilt.at(number)
        found.repaired = self._rebuilt.repaired
        return found

    def stations(
        self, run: ArrayRun, first: int, varying: Mapping[str, FloatArray]
    ) -> FloatArray | None:
        """Stations by the position whose attributes vary; none where those of inner elements do."""
        found = self._rebuilt.attributes(self.node)
        if found is None:
            return None
        sets = {name: values[run.sets] for name, values in found.items()}
        return self._known.stations(run, first, sets)

    def references(self) -> tuple[Entity, ...]:
        """Return those of the first set."""
        return self._known.references()

    def resolve(self, run: Surroundings | None, actor: Entity | None = None) -> Placement:
        """Refused: it is at another place in each set."""
        raise NotInArrays(f"{self.node.tag} varies between the runs")


class Dormancy(NamedTuple):
    """End of the time in which a value stays: the first of these.

    Attributes:
        time: simulation time, s.
        way: total displacement, m (`runner.engine.participants.entity.Displacement`).
        undisturbed: whether it also ends with the next change of `Run.changes`.
    """

    time: float = math.inf
    way: float = math.inf
    undisturbed: bool = False

    def both(self, other: Dormancy) -> Dormancy:
        """Return the time until which both values stay."""
        return Dormancy(
            min(self.time, other.time),
            min(self.way, other.way),
            self.undisturbed or other.undisturbed,
        )


AWAKE = Dormancy(-math.inf)
"""The value may change in the next step."""
UNDISTURBED = Dormancy(undisturbed=True)
"""The value changes with `Run.changes` only."""


class Condition(ABC):
    """A ByValueCondition, or a ByEntityCondition with its triggering entities."""

    triggering: tuple[Entity, ...] = ()
    """Entities for which the last evaluation was true (by-entity conditions)."""

    stays_true: bool = False
    """Whether the expression stays true for the rest of a run once it is."""

    mishap: bool = False
    """Whether a run in which the expression becomes true has gone wrong: a contact, an entity off
    the road or at its end."""

    def reset(self) -> None:
        """A run begins: forget what the last one has left."""
        self.triggering = ()

    def measure_from(self, run: Instant) -> None:
        """Count times and distances from now on instead of from the beginning of the run; most
        conditions count nothing."""
        return

    def dormant_until(self, run: Instant) -> Dormancy:
        """Return the time until which the expression keeps its present value; by default now."""
        return AWAKE

    @abstractmethod
    def evaluate(self, run: Instant) -> bool:
        """The logical expression at the simulation's current time."""

    def in_arrays(self, run: ArrayRun) -> Callable[[], BoolArray]:
        """Return a function that evaluates the expression in many runs at once: masks (n,) at their
        current time.

        Raises:
            NotInArrays: it is evaluated in single runs only, as by default.
        """
        raise _single(self)

    @abstractmethod
    def describe(self, run: Instant) -> str:
        """The expression with the values of now, e.g. `time headway Ego–Lead = 1.31 s < 1.5 s`."""


class EntityCondition(ABC):
    """The expression inside a ByEntityCondition, for one triggering entity."""

    mishap: ClassVar[bool] = False
    """Same as `Condition.mishap`"""

    def reset(self) -> None:
        """A run begins: forget what the last one has left, by default nothing."""
        return

    def measure_from(self, entities: Sequence[Entity]) -> None:
        """Count distances of these entities from now on; most conditions count nothing."""
        return

    def dormant_until(self, entity: Entity, run: Instant) -> Dormancy:
        """Return the time until which the expression keeps its value for this entity; by default
        now."""
        return AWAKE

    @abstractmethod
    def holds(self, entity: Entity, run: Instant) -> bool:
        """Whether the expression is true for this entity now; an undefined
        quantity makes it false.
        """

    def in_arrays(self, entity: EntityRows, run: ArrayRun) -> Callable[[], BoolArray]:
        """Same as `Condition.in_arrays`, for this entity."""
        raise _single(self)

    @abstractmethod
    def describe(self, entity: Entity, run: Instant) -> str:
        """The expression for this entity with the values of now."""


class NearCondition(EntityCondition):
    """Expression that holds only near a target: far from it the expression may rest."""

    @abstractmethod
    def way(self, entity: Entity, run: Instant) -> float:
        """Return the distance (m) each entity may move before the expression, now false, can hold
        for this entity; 0 if unknown."""

    def dormant_until(self, entity: Entity, run: Instant) -> Dormancy:
        """End of the way on which it is certainly not near."""
        way = self.way(entity, run) if run.displacement.followed else 0.0
        return Dormancy(way=run.displacement.after(way)) if way > 0.0 else AWAKE


class ByEntityCondition(Condition):
    """An EntityCondition over its triggering entities.

    Args:
        entities: the triggering entities (selections already expanded).
        every: triggeringEntitiesRule: `all` (true) or `any` (false).
        condition: the expression for one entity.
    """

    def __init__(self, entities: list[Entity], every: bool, condition: EntityCondition) -> None:
        self.entities = entities
        self.every = every
        self.condition = condition
        self.mishap = condition.mishap
        self._only = entities[0] if len(entities) == 1 else None

    def reset(self) -> None:
        """Reset the expression as well."""
        super().reset()
        self.condition.reset()

    def measure_from(self, run: Instant) -> None:
        """Let the expression count from now on."""
        self.condition.measure_from(self.entities)

    def dormant_until(self, run: Instant) -> Dormancy:
        """Return the time until which no value of a present entity changes; one
        that appears ends it.
        """
        found = Dormancy()
        for entity in self.entities:
            if entity.active:
                found = found.both(self.condition.dormant_until(entity, run))
        # who appears is a displacement too
        return found if found.way < math.inf else found.both(UNDISTURBED)

    def evaluate(self, run: Instant) -> bool:
        """True when the expression holds for any, or all, of the entities that are present."""
        only = self._only
        if only is not None:
            held = only.active and self.condition.holds(only, run)
            self.triggering = (only,) if held else ()
            return held
        holds = self.condition.holds
        self.triggering = found = tuple(
            [entity for entity in self.entities if entity.active and holds(entity, run)]
        )
        return len(found) == len(self.entities) if self.every else bool(found)

    def in_arrays(self, run: ArrayRun) -> Callable[[], BoolArray]:
        """The expressions of all entities, combined."""
        expressions = [self.condition.in_arrays(run.entities[e.name], run) for e in self.entities]
        combine = np.logical_and if self.every else np.logical_or

        def evaluate() -> BoolArray:
            found = np.full(run.n, self.every)
            for holds in expressions:
                found = combine(found, holds())
            return found

        return evaluate

    def describe(self, run: Instant) -> str:
        """The expressions of the entities that triggered, or of all of them if none did."""
        shown = self.triggering or [entity for entity in self.entities if entity.active]
        return (
            "; ".join(self.condition.describe(entity, run) for entity in shown)
            or "no triggering entity is present"
        )


LONGITUDINAL, LIGHTING, ANIMATION = "longitudinal", "lighting", "animation"
"""Control domains of an entity (OpenSCENARIO XML 1.3, 6.6.1): at most one action owns each at a
time."""


def need_places(node: Node, *entities: Entity) -> None:
    """Make sure that entities are somewhere before an action deals with where they are.

    Raises:
        InvalidFile: one of them has no position yet.
    """
    for entity in entities:
        if not entity.placed:
            raise node.invalid(
                f"{entity.name} has no position yet; a TeleportAction has to come first"
            )


class PrivateAction(ABC):
    """An action on one entity.

    Attributes:
        run_by_run: whether each of many runs executes it by itself, as a single run does: what it
            makes of itself holds nothing of a run but its actor and the entities it refers to.
    """

    domains: ClassVar[tuple[str, ...]] = ()
    run_by_run: ClassVar[bool] = False

    @property
    def repaired(self) -> bool:
        """Whether the one of many parameter sets that was asked for last was read with a repair."""
        return False

    @property
    def places(self) -> bool:
        """Whether it gives the actor a new place; initial actions are ordered by it."""
        return False

    @property
    def activates_controller(self) -> bool:
        """Whether it decides when a system under test drives the actor."""
        return False

    def claims(self) -> tuple[str, ...]:
        """Control domains that this action takes over from their owners (standard 7.5.1)."""
        return self.domains

    def references(self) -> Iterable[Entity]:
        """Entities whose state `start` reads; initial actions are ordered by it."""
        return ()

    def puts(self, actor: Entity) -> Iterable[tuple[Entity, Position | None]]:
        """Return the entities that it teleports, with None for a place known only in a run."""
        return [(actor, None)] if self.places else []

    def check(self, actor: Entity, starts: Sequence[Placement] | None) -> None:  # noqa: B027  (most actions suit every actor)
        """Complain before any run about what this actor can never do.

        Args:
            starts: all places where actions can put the actor; None where only a run knows.

        Raises:
            InvalidFile: the action makes no sense for this actor.
        """

    @abstractmethod
    def start(self, actor: Entity, run: Run) -> Running | None:
        """Begin for this actor now; None when the action is complete at once."""

    def in_arrays(self, actor: EntityRows, run: ArrayRun) -> ArrayProcess:
        """Make of it what does the same for this actor in many runs at once.

        Raises:
            NotInArrays: it plays in single runs only, as by default.
        """
        from runner.engine.compile.array_protocols import RunByRun

        if self.run_by_run:
            return RunByRun(self, actor, run)
        raise _single(self)

    def steps_in_arrays(self, actor: EntityRows, run: ArrayRun) -> ArraySteps | None:
        """Make its steps in many runs, in each of which it begins by itself; None where they are
        done run by run too."""
        return None

    def at_set(self, number: int) -> PrivateAction:
        """The action in one of the parameter sets for which the scenario was read."""
        from runner.engine.compile.array_protocols import picked

        found: PrivateAction = picked(self, number)
        return found


class VaryingAction(PrivateAction):
    """An action with numbers that vary between parameter sets, executed run by run.

    Args:
        node: its element, with the marks of columns.
        build: makes an action of an element, and says whether it was repaired.
    """

    run_by_run = True

    def __init__(self, node: Node, build: Callable[[Node], tuple[PrivateAction, bool]]) -> None:
        self._rebuilt = _Rebuilt(node, build)
        self._first: PrivateAction = self._rebuilt.known

    @property
    def repaired(self) -> bool:
        """Whether the set that was asked for last was read with a repair."""
        return self._rebuilt.repaired

    @property
    def places(self) -> bool:
        """Return it as in the first set."""
        return self._first.places

    @property
    def activates_controller(self) -> bool:
        """Return it as in the first set."""
        return self._first.activates_controller

    def steps_in_arrays(self, actor: EntityRows, run: ArrayRun) -> ArraySteps | None:
        """Return those of the first set."""
        return self._first.steps_in_arrays(actor, run)

    def claims(self) -> tuple[str, ...]:
        """Return those of the first set."""
        return self._first.claims()

    def references(self) -> Iterable[Entity]:
        """Return those of the first set."""
        return self._first.references()

    def puts(self, actor: Entity) -> Iterable[tuple[Entity, Position | None]]:
        """Places that only a run knows."""
        return [(entity, None) for entity, _ in self._first.puts(actor)]

    def at_set(self, number: int) -> PrivateAction:
        """Built of the numbers of that set."""
        found: PrivateAction = self._rebuilt.at(number)
        return found

    def start(self, actor: Entity, run: Run) -> Running | None:
        """Refused: it is another one in each set."""
        raise NotInArrays(f"{type(self._first).__name__} varies between the runs")


class GlobalAction(ABC):
    """An action on the simulation at large."""

    def references(self) -> Iterable[Entity]:
        """Same as `PrivateAction.references`."""
        return ()

    def puts(self) -> Iterable[tuple[Entity, Position | None]]:
        """Return the entities that it teleports, with None for a place known only in a run."""
        return []

    @abstractmethod
    def start(self, run: Run) -> Running | None:
        """Begin now; None when the action is complete at once."""

    def in_arrays(self, run: ArrayRun) -> ArrayProcess:
        """Same as `PrivateAction.in_arrays`."""
        raise _single(self)


def _single(element: object) -> NotInArrays:
    return NotInArrays(f"{type(element).__name__} plays in single runs only")


Action = PrivateAction | GlobalAction
