"""Conditions on the state of one entity: motion, contacts, position on or off the road.

Source: OpenSCENARIO XML 1.3, EntityCondition.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from runner.engine.compile.element import AWAKE, UNDISTURBED, Dormancy, EntityCondition
from runner.engine.compile.registry import condition
from runner.engine.conditions.comparison import TOLERANCE, Comparison, compared
from runner.engine.motion.spacing import velocity
from xosc.document.node import Node
from xosc.rules.storyboard import EMPTY_ELEMENTS_UID
from xosc.rules.values import NOT_NEGATIVE_UID

if TYPE_CHECKING:
    from runner.engine.compile.array_protocols import ArrayRun
    from runner.engine.compile.protocols import Instant
    from runner.engine.compile.registry import Context
    from runner.engine.participants.entity import Entity
    from runner.engine.participants.rows import EntityRows
    from schemas.common.array_types import BoolArray, FloatArray

DIRECTIONS = ("longitudinal", "lateral", "vertical")
OBJECT_TYPES = ("vehicle", "pedestrian", "miscellaneous", "external")


class _Lasting(EntityCondition):
    """A state that has lasted for at least `duration` (s)."""

    def __init__(self, duration: float) -> None:
        self.duration = duration

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> EntityCondition:
        """Read the duration."""
        return cls(_duration(node, context))

    def _lasted(self, since: float) -> bool:
        return since > 0.0 and since >= self.duration - TOLERANCE

    def _lasted_arrays(self, since: FloatArray, run: ArrayRun) -> BoolArray:
        found: BoolArray = (since > 0.0) & (since >= run.value(self.duration) - TOLERANCE)
        return found

    def _text(self, entity: Entity, state: str, since: float) -> str:
        wanted = f"≥ {self.duration:g} s"
        if self._lasted(since):
            return f"{entity.name} {state} for {since:.2f} s {wanted}"
        return f"{entity.name} {state} for {wanted} (is {since:.2f} s)"


def _duration(node: Node, context: Context) -> float:
    duration = float(node.float("duration"))
    if duration < 0.0:
        context.repair(node, NOT_NEGATIVE_UID, f"duration={duration:g} is negative; 0 is assumed")
    return max(duration, 0.0)


@condition("EndOfRoadCondition")
class EndOfRoadCondition(_Lasting):
    """True once the entity has stood at the end of its road for the duration."""

    mishap = True

    def holds(self, entity: Entity, run: Instant) -> bool:
        """Whether the road has ended long enough ago."""
        return self._lasted(entity.road_end)

    def in_arrays(self, entity: EntityRows, run: ArrayRun) -> Callable[[], BoolArray]:
        """The runs in which the road has ended long enough ago."""
        return lambda: self._lasted_arrays(entity.road_end, run)

    def describe(self, entity: Entity, run: Instant) -> str:
        """Time at the end of the road."""
        return self._text(entity, "at the end of the road", entity.road_end)


@condition("StandStillCondition")
class StandStillCondition(_Lasting):
    """True once the entity has stood still (below 1 mm/s) for the duration."""

    def dormant_until(self, entity: Entity, run: Instant) -> Dormancy:
        """Return the time at which the entity, if it stands from now on, has stood for the
        duration; a trailer has what its tractor has."""
        if entity.controls.tractor is not None or self._lasted(entity.standstill):
            return AWAKE
        left = self.duration - entity.standstill - 2.0 * TOLERANCE
        return Dormancy(run.time + left, undisturbed=True)

    def holds(self, entity: Entity, run: Instant) -> bool:
        """Whether it stands long enough."""
        return self._lasted(entity.standstill)

    def in_arrays(self, entity: EntityRows, run: ArrayRun) -> Callable[[], BoolArray]:
        """The runs in which it stands long enough."""
        return lambda: self._lasted_arrays(entity.standstill, run)

    def describe(self, entity: Entity, run: Instant) -> str:
        """Time of standing still."""
        return self._text(entity, "standing still", entity.standstill)


@condition("OffroadCondition")
class OffroadCondition(_Lasting):
    """True once the entity's reference point has been off the road (no lane under it, or one of
    type none) for the duration."""

    mishap = True

    def __init__(self, duration: float) -> None:
        super().__init__(duration)
        self._since: dict[str, float] = {}

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> EntityCondition:
        """Read the duration, and keep time from the beginning of the run."""
        self = cls(_duration(node, context))
        above = node.parent
        by_entity = above.parent if above is not None else None
        entities = (
            context.triggering_entities(by_entity.need("TriggeringEntities"))
            if by_entity is not None
            else []
        )
        context.each_step(lambda run: self._observe(entities, run))
        return self

    def reset(self) -> None:
        """Forget how long each entity has been off the road."""
        self._since.clear()

    def _observe(self, entities: list[Entity], run: Instant) -> None:
        for entity in entities:
            off = entity.active and entity.placed and run.roads.is_off_road(entity)
            self._since[entity.name] = self._since.get(entity.name, 0.0) + run.dt if off else 0.0

    def holds(self, entity: Entity, run: Instant) -> bool:
        """Whether it left the road long enough ago."""
        return self._lasted(self._since.get(entity.name, 0.0))

    def describe(self, entity: Entity, run: Instant) -> str:
        """Time off the road."""
        return self._text(entity, "off the road", self._since.get(entity.name, 0.0))


@condition("CollisionCondition")
class CollisionCondition(EntityCondition):
    """True while the entity touches one of the given entities, or any entity of a type."""

    mishap = True

    def __init__(self, others: frozenset[str], what: str) -> None:
        self.others = others
        self.what = what

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> CollisionCondition:
        """Read the EntityRef (an entity or a selection) or ByType; without either any contact
        counts."""
        if not node.children():
            context.repair(
                node,
                EMPTY_ELEMENTS_UID,
                "EntityRef or ByType is expected; contact with any entity is assumed",
            )
            return cls(frozenset(e.name for e in context.declared.values()), "any entity")
        target = node.only()
        if target.tag == "EntityRef":
            return cls(frozenset(e.name for e in context.entities(target)), target.get("entityRef"))
        if target.tag != "ByType":
            raise target.invalid("EntityRef or ByType is expected")
        kind = target.choice("type", OBJECT_TYPES)
        return cls(
            frozenset(e.name for e in context.declared.values() if e.declared.kind == kind),
            f"any {kind}",
        )

    def dormant_until(self, entity: Entity, run: Instant) -> Dormancy:
        """Return the time until which the set of contacts is unchanged."""
        return UNDISTURBED

    def holds(self, entity: Entity, run: Instant) -> bool:
        """Whether a contact exists now."""
        return any(other.name in self.others for other in run.touching(entity))

    def in_arrays(self, entity: EntityRows, run: ArrayRun) -> Callable[[], BoolArray]:
        """The runs in which a contact exists now."""
        others = [name for name in run.entities if name in self.others and name != entity.name]

        def evaluate() -> BoolArray:
            found = np.zeros(run.n, bool)
            for name in others:
                found |= run.contact(entity.name, name)
            return found

        return evaluate

    def describe(self, entity: Entity, run: Instant) -> str:
        """Describe the collision partner."""
        touched = ", ".join(other.name for other in run.touching(entity)) or "no one"
        return f"collision of {entity.name} with {self.what}: {entity.name} touches {touched}"


@condition("SpeedCondition")
class SpeedCondition(EntityCondition):
    """Compares the entity's speed (m/s): signed along its heading, or the projection of its
    velocity on one of its axes."""

    def __init__(self, comparison: Comparison, direction: str | None) -> None:
        self.comparison = comparison
        self.direction = direction

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> SpeedCondition:
        """Read rule, value and direction (1.2)."""
        return cls(Comparison.from_xml(node, "m/s"), node.choice("direction", DIRECTIONS, None))

    def _speed(self, entity: Entity) -> float:
        if self.direction is None:
            return entity.speed
        return project(entity, *velocity(entity), self.direction)

    def holds(self, entity: Entity, run: Instant) -> bool:
        """Whether the comparison is true."""
        return self.comparison.holds(self._speed(entity))

    def in_arrays(self, entity: EntityRows, run: ArrayRun) -> Callable[[], BoolArray]:
        """The comparison."""

        def speed() -> FloatArray:
            if self.direction is None:
                return entity.speed
            return _project_arrays(entity, entity.vx, entity.vy, self.direction)

        return lambda: self.comparison.holds_arrays(speed(), run)

    def describe(self, entity: Entity, run: Instant) -> str:
        """The speed compared."""
        return self.comparison.describe(
            _called(self.direction, "speed", entity.name), self._speed(entity)
        )


@condition("RelativeSpeedCondition")
class RelativeSpeedCondition(EntityCondition):
    """Compares speed of the triggering entity minus that of the reference entity (m/s).

    With a direction both velocities are projected on that axis of the triggering entity.
    """

    def __init__(self, other: Entity, comparison: Comparison, direction: str | None) -> None:
        self.other = other
        self.comparison = comparison
        self.direction = direction

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> RelativeSpeedCondition:
        """Read entityRef, rule, value and direction (1.2)."""
        direction = node.choice("direction", DIRECTIONS, None)
        return cls(context.entity(node), Comparison.from_xml(node, "m/s"), direction)

    def _speed(self, entity: Entity) -> float | None:
        if not self.other.active:
            return None
        if self.direction is None:
            return entity.speed - self.other.speed
        (vx, vy), (ox, oy) = velocity(entity), velocity(self.other)
        return project(entity, vx - ox, vy - oy, self.direction)

    def holds(self, entity: Entity, run: Instant) -> bool:
        """Whether the comparison is true."""
        return self.comparison.holds(self._speed(entity))

    def in_arrays(self, entity: EntityRows, run: ArrayRun) -> Callable[[], BoolArray]:
        """The comparison."""
        other = run.entities[self.other.name]

        def speed() -> FloatArray:
            if self.direction is None:
                return entity.speed - other.speed
            vx, vy = entity.vx - other.vx, entity.vy - other.vy
            return _project_arrays(entity, vx, vy, self.direction)

        return lambda: self.comparison.holds_arrays(speed(), run)

    def describe(self, entity: Entity, run: Instant) -> str:
        """The relative speed compared."""
        what = _called(self.direction, "relative speed", f"{entity.name}–{self.other.name}")
        return self.comparison.describe(what, self._speed(entity))


@condition("AccelerationCondition")
class AccelerationCondition(EntityCondition):
    """Compares the entity's acceleration (m/s²).

    Without a direction it is the rate of change of the speed along the heading, negative when
    braking, up to version 1.1, which know no direction; from 1.2 on, as the standard says, the
    total acceleration, the magnitude of the vector.
    """

    def __init__(self, comparison: Comparison, direction: str | None) -> None:
        self.comparison = comparison
        self.direction = direction

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> AccelerationCondition:
        """Read rule, value and direction (1.2)."""
        direction = node.choice(
            "direction", DIRECTIONS, "longitudinal" if context.version < (1, 2) else None
        )
        return cls(Comparison.from_xml(node, "m/s²"), direction)

    def _acceleration(self, entity: Entity) -> float:
        if self.direction == "longitudinal":
            return entity.acceleration
        if self.direction is None:
            return math.hypot(entity.ax, entity.ay)
        return project(entity, entity.ax, entity.ay, self.direction)

    def holds(self, entity: Entity, run: Instant) -> bool:
        """Whether the comparison is true."""
        return self.comparison.holds(self._acceleration(entity))

    def in_arrays(self, entity: EntityRows, run: ArrayRun) -> Callable[[], BoolArray]:
        """The comparison."""

        def acceleration() -> FloatArray:
            if self.direction == "longitudinal":
                return entity.acceleration
            if self.direction is None:
                return np.hypot(entity.ax, entity.ay)
            return _project_arrays(entity, entity.ax, entity.ay, self.direction)

        return lambda: self.comparison.holds_arrays(acceleration(), run)

    def describe(self, entity: Entity, run: Instant) -> str:
        """The acceleration compared."""
        return self.comparison.describe(
            _called(self.direction, "acceleration", entity.name), self._acceleration(entity)
        )


@condition("TraveledDistanceCondition")
class TraveledDistanceCondition(EntityCondition):
    """True once the entity has travelled the distance (m) since the beginning of the run.

    In scenarios for CARLA the way counts from when the trigger begins to wait (`measure_from`).
    """

    def __init__(self, distance: float) -> None:
        self.distance = distance
        self._before: dict[str, float] = {}

    def reset(self) -> None:
        """Count from the beginning of the run."""
        self._before.clear()

    def measure_from(self, entities: Sequence[Entity]) -> None:
        """Count from now on."""
        self._before = {entity.name: entity.odometer for entity in entities}

    def _travelled(self, entity: Entity) -> float:
        return entity.odometer - self._before.get(entity.name, 0.0)

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> TraveledDistanceCondition:
        """Read the distance."""
        return cls(node.float("value"))

    def holds(self, entity: Entity, run: Instant) -> bool:
        """Whether it has gone so far."""
        return self._travelled(entity) >= self.distance - TOLERANCE

    def in_arrays(self, entity: EntityRows, run: ArrayRun) -> Callable[[], BoolArray]:
        """The runs in which it has gone so far."""

        def evaluate() -> BoolArray:
            found: BoolArray = entity.odometer >= run.value(self.distance) - TOLERANCE
            return found

        return evaluate

    def describe(self, entity: Entity, run: Instant) -> str:
        """The distance travelled."""
        travelled = self._travelled(entity)
        holds = travelled >= self.distance - TOLERANCE
        what = f"distance travelled by {entity.name}"
        return compared(what, f"{travelled:.2f} m", f"≥ {self.distance:g} m", holds)


def project(entity: Entity, x: float, y: float, direction: str) -> float:
    """Component of a horizontal vector along an entity's axis: positive forward, to the left; 0
    vertically.

    Participants move in the plane of the road under them, which has no component along their
    vertical axis.
    """
    if direction == "vertical":
        return 0.0
    c, s = math.cos(entity.h), math.sin(entity.h)
    return x * c + y * s if direction == "longitudinal" else y * c - x * s


def _project_arrays(entity: EntityRows, x: FloatArray, y: FloatArray, direction: str) -> FloatArray:
    """`project` in many runs (n,)."""
    if direction == "vertical":
        return np.zeros_like(x)
    c, s = np.cos(entity.h), np.sin(entity.h)
    return x * c + y * s if direction == "longitudinal" else y * c - x * s


def _called(direction: str | None, quantity: str, whose: str) -> str:
    return f"{direction} {quantity} of {whose}" if direction else f"{quantity} of {whose}"
