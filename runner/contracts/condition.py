"""Contract of conditions: a logical expression that describes itself with current values."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar

if TYPE_CHECKING:
    from runner.contracts.run import Instant
    from runner.participants.entity import Entity


_SLEEPLESS = 8
"""Steps between attempts to let a condition sleep: with all entities near, every attempt fails."""


class Condition(ABC):
    """A ByValueCondition, or a ByEntityCondition with its triggering entities."""

    triggering: tuple[Entity, ...] = ()
    """Entities for which the last evaluation was true (by-entity conditions)."""

    stays_true: bool = False
    """Whether the expression stays true for the rest of a run once it is."""

    mishap: bool = False
    """Whether a run in which the expression becomes true has gone wrong: a contact, an entity off the road or at its end."""

    def reset(self) -> None:
        """A run begins: forget what the last one has left."""
        self.triggering = ()

    def measure_from(self, run: Instant) -> None:
        """Count times and distances from now on instead of from the beginning of the run; most conditions count nothing."""
        return

    def keeps(self, run: Instant) -> float:
        """Time (s) before which the expression keeps its present value while `run.changes` stays; by default it keeps none."""
        return -math.inf

    def false_until(self, run: Instant) -> float:
        """Time (s) before which the expression is false whatever happens; `-inf` if unknown."""
        return -math.inf

    def false_within(self, run: Instant) -> float:
        """Total displacement (m, see `Displacement`) before which the expression is false whatever happens; `-inf` if unknown."""
        return -math.inf

    @abstractmethod
    def evaluate(self, run: Instant) -> bool:
        """The logical expression at the simulation's current time."""

    @abstractmethod
    def describe(self, run: Instant) -> str:
        """The expression with the values of now, e.g. `time headway Ego–Lead = 1.31 s < 1.5 s`."""


class EntityCondition(ABC):
    """The expression inside a ByEntityCondition, for one triggering entity."""

    mishap: ClassVar[bool] = False
    """As `Condition.mishap`"""

    def reset(self) -> None:
        """A run begins: forget what the last one has left, by default nothing."""
        return

    def measure_from(self, entities: Sequence[Entity]) -> None:
        """Count distances of these entities from now on; most conditions count nothing."""
        return

    def keeps(self, entity: Entity, run: Instant) -> float:
        """As `Condition.keeps`, for this entity."""
        return -math.inf

    @abstractmethod
    def holds(self, entity: Entity, run: Instant) -> bool:
        """Whether the expression is true for this entity now; an undefined quantity makes it false."""

    @abstractmethod
    def describe(self, entity: Entity, run: Instant) -> str:
        """The expression for this entity with the values of now."""


class NearCondition(EntityCondition):
    """An expression that holds only near to something: where that is far, it need not be looked at for a while."""

    @abstractmethod
    def way(self, entity: Entity, run: Instant) -> float:
        """Return the distance (m) each entity may move before the expression, now false, can hold for this entity; 0 if
        unknown."""


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
        self._near = condition if isinstance(condition, NearCondition) else None
        self._asleep = -math.inf

    def reset(self) -> None:
        """Reset the expression as well."""
        super().reset()
        self._asleep = -math.inf
        self.condition.reset()

    def measure_from(self, run: Instant) -> None:
        """Let the expression count from now on."""
        self.condition.measure_from(self.entities)

    def keeps(self, run: Instant) -> float:
        """While it keeps its value for each of the entities that are present."""
        return min((self.condition.keeps(entity, run) for entity in self.entities if entity.active), default=math.inf)

    def false_within(self, run: Instant) -> float:
        """Until an entity comes near."""
        return self._asleep

    def evaluate(self, run: Instant) -> bool:
        """True when the expression holds for any, or all, of the entities that are present."""
        if self._near is not None and run.displacement.total < self._asleep:
            return False
        holds, only = self.condition.holds, self._only
        if only is None:
            held = tuple([entity for entity in self.entities if entity.active and holds(entity, run)])
        else:
            held = (only,) if only.active and holds(only, run) else ()
        self.triggering = held
        if self._near is not None and not held and run.step_index % _SLEEPLESS == 0:
            self._asleep = run.displacement.after(self._way(self._near, run))
        return len(held) == len(self.entities) if self.every else bool(held)

    def _way(self, condition: NearCondition, run: Instant) -> float:
        """Return the distance each entity may move before the expression, false for all, can hold for one of them."""
        return min((condition.way(entity, run) for entity in self.entities if entity.active), default=0.0)

    def describe(self, run: Instant) -> str:
        """The expressions of the entities that triggered, or of all of them if none did."""
        shown = self.triggering or [entity for entity in self.entities if entity.active]
        return "; ".join(self.condition.describe(entity, run) for entity in shown) or "no triggering entity is present"
