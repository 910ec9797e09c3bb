"""Conditions on distances and on times derived from them (OpenSCENARIO XML 1.3, EntityCondition and 6.4).

Distances are compared without their sign. How each is measured is said in
`runner.engine.motion.spacing`.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import TYPE_CHECKING, ClassVar, NamedTuple

from runner.engine.compile.element import EntityCondition, NearCondition
from runner.engine.compile.registry import condition
from runner.engine.conditions.comparison import TOLERANCE, Comparison
from runner.engine.motion import spacing
from runner.engine.participants.entity import Entity, Separation
from schemas.common.errors import InvalidFile
from xosc.document.node import Node

if TYPE_CHECKING:
    from runner.engine.compile.element import Position
    from runner.engine.compile.registry import Context
    from runner.engine.compile.run import Instant
    from runner.engine.motion.placement import Placement

_TYPES = {
    "longitudinal": "longitudinal",
    "lateral": "lateral",
    "euclidianDistance": "euclidean",
    "cartesianDistance": "euclidean",
}
_STILL = 1e-6
"""Speed (m/s) from which a time headway is defined"""


class DistanceMeasure(NamedTuple):
    """Distance measure of a condition.

    Args:
        kind: longitudinal, lateral or euclidean.
        system: the coordinate system.
        freespace: from box to box, not between reference points.
        routing: the routing algorithm between different roads.
    """

    kind: str
    system: str
    freespace: bool
    routing: str

    @classmethod
    def from_xml(cls, node: Node) -> DistanceMeasure:
        """Read the attributes of any version.

        `alongRoute` (1.0, deprecated in 1.1) counts only where neither coordinate system nor
        distance type is given: true means along the road, false straight.
        """
        freespace = node.bool("freespace")
        routing = node.choice("routingAlgorithm", spacing.ROUTINGS, "undefined")
        if (
            not node.has("coordinateSystem")
            and not node.has("relativeDistanceType")
            and node.bool("alongRoute", False)
        ):
            return cls("longitudinal", "road", freespace, routing)
        kind = _TYPES[node.choice("relativeDistanceType", _TYPES, "euclidianDistance")]
        return cls(
            kind, node.choice("coordinateSystem", spacing.SYSTEMS, "entity"), freespace, routing
        )

    def between(self, run: Instant, a: Entity, b: Entity | Placement) -> float | None:
        """The distance, signed where it has a direction (see `runner.engine.motion.spacing`); None where it is undefined."""
        if self.kind == "euclidean":
            return spacing.euclidean(a, b, self.freespace)
        measure = spacing.longitudinal if self.kind == "longitudinal" else spacing.lateral
        return measure(run.roads, a, b, self.system, self.freespace, self.routing)

    def closing(self, run: Instant, a: Entity, b: Entity | Placement) -> float | None:
        """Speed at which the distance shrinks, m/s, in the same coordinate system and dimension."""
        if self.kind == "euclidean":
            return spacing.closing_euclidean(a, b, self.freespace)
        rate = (
            spacing.closing_longitudinal if self.kind == "longitudinal" else spacing.closing_lateral
        )
        return rate(run.roads, a, b, self.system, self.routing)

    def named(self, what: str) -> str:
        """Return its name for descriptions."""
        name = what if self.kind == "euclidean" else f"{self.kind} {what} ({self.system})"
        return f"{name}, box to box," if self.freespace else name


class DistanceTarget:
    """The entity or position that a distance is measured to."""

    def __init__(self, entity: Entity | None, position: Position | None) -> None:
        self.entity = entity
        self.position = position
        self.name = entity.name if entity is not None else "position"

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> DistanceTarget:
        """Read an element that holds an EntityRef or a Position."""
        child = node.only()
        if child.tag == "EntityRef":
            return cls(context.entity(child), None)
        return cls(None, context.position(child))

    @classmethod
    def position_of(cls, node: Node, context: Context) -> DistanceTarget:
        """Read the Position inside a condition."""
        return cls(None, context.position(node.need("Position")))

    @property
    def bound(self) -> bool:
        """Whether it moves as participants do, or not at all; a position that is relative to one may move faster."""
        return self.position is None or self.position.fixed is not None

    def find(self, run: Instant, actor: Entity) -> Entity | Placement | None:
        """Return the current entity or place; None for an absent entity, or a position relative to one."""
        if self.entity is not None:
            return self.entity if self.entity.active and self.entity.placed else None
        assert self.position is not None
        if self.position.fixed is not None:
            return self.position.fixed
        if not all(entity.active for entity in self.position.references()):
            return None
        try:
            return self.position.resolve(run, actor)
        except (
            InvalidFile
        ):  # relative to something that has no such place at the moment: undefined, not wrong
            return None


class _Measured(EntityCondition):
    """Compares what is measured from an entity to a target; false where that is undefined."""

    what: ClassVar[str]
    """what it is called in descriptions"""

    def __init__(
        self, target: DistanceTarget, measure: DistanceMeasure, comparison: Comparison
    ) -> None:
        self.target = target
        self.measure = measure
        self.comparison = comparison

    @abstractmethod
    def between(self, entity: Entity, target: Entity | Placement, run: Instant) -> float | None:
        """The value compared; None where it is undefined."""

    def _value(self, entity: Entity, run: Instant) -> float | None:
        target = self.target.find(run, entity)
        return self.between(entity, target, run) if target is not None else None

    def holds(self, entity: Entity, run: Instant) -> bool:
        """Whether the comparison is true."""
        return self.comparison.holds(self._value(entity, run))

    def describe(self, entity: Entity, run: Instant) -> str:
        """The value compared."""
        what = f"{self.measure.named(self.what)} {entity.name}–{self.target.name}"
        return self.comparison.describe(what, self._value(entity, run))


class _DistanceCondition(_Measured, NearCondition):
    """Compares a distance (m) to a target."""

    what = "distance"

    def __init__(
        self, target: DistanceTarget, measure: DistanceMeasure, comparison: Comparison
    ) -> None:
        super().__init__(target, measure, comparison)
        self._gaps: dict[Entity, Separation] = {}
        """Entities from which a gap between boxes is measured that has to become small"""
        between_boxes = (
            target.entity is not None and measure.kind == "euclidean" and measure.freespace
        )
        self._small_gap = between_boxes and comparison.greatest < math.inf

    def reset(self) -> None:
        """Measure anew."""
        self._gaps.clear()

    def holds(self, entity: Entity, run: Instant) -> bool:
        """Whether the comparison is true."""
        if self._small_gap and self._apart(entity):
            return False
        return super().holds(entity, run)

    def _apart(self, entity: Entity) -> bool:
        """Whether the gap is certainly too great."""
        assert self.target.entity is not None
        if entity not in self._gaps:
            self._gaps[entity] = Separation(entity, self.target.entity)
        return self._gaps[entity].exceeds(self.comparison.greatest)

    def way(self, entity: Entity, run: Instant) -> float:
        """Half of the way to where a distance, straight or along a plain road, is short enough: both go it."""
        target = self.target.find(run, entity) if self.target.bound else None
        measure = self.measure
        if target is None:
            return 0.0
        if measure.kind == "euclidean":
            distance = math.hypot(target.x - entity.x, target.y - entity.y)
        elif (
            run.roads.plain
            and (measure.kind, measure.system) == ("longitudinal", "road")
            and measure.routing != "assignedRoute"
        ):
            distance = abs(measure._replace(freespace=False).between(run, entity, target) or 0.0)
        else:
            return 0.0
        if self.measure.freespace:
            distance -= entity.reach + (target.reach if isinstance(target, Entity) else 0.0)
        return (distance - self.comparison.greatest) / 2

    def between(self, entity: Entity, target: Entity | Placement, run: Instant) -> float | None:
        """The distance without its sign."""
        distance = self.measure.between(run, entity, target)
        return abs(distance) if distance is not None else None


@condition("DistanceCondition")
class DistanceCondition(_DistanceCondition):
    """Compares the distance to a position."""

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> DistanceCondition:
        """Read the position and how to measure."""
        return cls(
            DistanceTarget.position_of(node, context),
            DistanceMeasure.from_xml(node),
            Comparison.from_xml(node, "m"),
        )


@condition("RelativeDistanceCondition")
class RelativeDistanceCondition(_DistanceCondition):
    """Compares the distance to another entity."""

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> RelativeDistanceCondition:
        """Read the entity and how to measure."""
        return cls(
            DistanceTarget(context.entity(node), None),
            DistanceMeasure.from_xml(node),
            Comparison.from_xml(node, "m"),
        )


@condition("ReachPositionCondition")
class ReachPositionCondition(NearCondition):
    """True while the reference point is within a circle about a position (deprecated by the standard for DistanceCondition)."""

    def __init__(self, target: DistanceTarget, tolerance: float) -> None:
        self.target = target
        self.tolerance = tolerance

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> ReachPositionCondition:
        """Read the position and the radius of the circle."""
        return cls(DistanceTarget.position_of(node, context), node.float("tolerance"))

    def _distance(self, entity: Entity, run: Instant) -> float | None:
        place = self.target.find(run, entity)
        return math.hypot(place.x - entity.x, place.y - entity.y) if place is not None else None

    def way(self, entity: Entity, run: Instant) -> float:
        """The way to the circle."""
        distance = self._distance(entity, run) if self.target.bound else None
        return distance - self.tolerance - 2.0 * TOLERANCE if distance is not None else 0.0

    def holds(self, entity: Entity, run: Instant) -> bool:
        """Whether the entity is inside the circle."""
        distance = self._distance(entity, run)
        return distance is not None and distance < self.tolerance + TOLERANCE

    def describe(self, entity: Entity, run: Instant) -> str:
        """The distance from the circle's centre."""
        return Comparison("lessOrEqual", self.tolerance, "m").describe(
            f"distance {entity.name}–position", self._distance(entity, run)
        )


@condition("TimeHeadwayCondition")
class TimeHeadwayCondition(_Measured):
    """Compares distance by own speed (s): undefined unless the other is ahead and the entity drives forward."""

    what = "time headway"

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> TimeHeadwayCondition:
        """Read the entity and how to measure."""
        return cls(
            DistanceTarget(context.entity(node), None),
            DistanceMeasure.from_xml(node),
            Comparison.from_xml(node, "s"),
        )

    def between(self, entity: Entity, target: Entity | Placement, run: Instant) -> float | None:
        """The time headway."""
        if entity.speed < _STILL:
            return None
        distance = self.measure.between(run, entity, target)
        if distance is None or not self._ahead(entity, target, distance, run):
            return None
        return abs(distance) / entity.speed

    def _ahead(
        self, entity: Entity, target: Entity | Placement, distance: float, run: Instant
    ) -> bool:
        if self.measure.kind == "longitudinal" and distance != 0.0:
            return distance > 0.0
        return (spacing.longitudinal(run.roads, entity, target, "entity", False) or 0.0) > TOLERANCE


@condition("TimeToCollisionCondition")
class TimeToCollisionCondition(_Measured):
    """Compares distance by closing speed (s): undefined while the distance does not shrink.

    The closing speed is the rate at which the measured distance shrinks with the present
    velocities.
    """

    what = "time to collision"

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> TimeToCollisionCondition:
        """Read the target (entity or position) and how to measure."""
        target = DistanceTarget.from_xml(node.need("TimeToCollisionConditionTarget"), context)
        return cls(target, DistanceMeasure.from_xml(node), Comparison.from_xml(node, "s"))

    def between(self, entity: Entity, target: Entity | Placement, run: Instant) -> float | None:
        """The time to collision."""
        distance = self.measure.between(run, entity, target)
        if distance is None:
            return None
        speed = self.measure.closing(run, entity, target)
        return abs(distance) / speed if speed is not None and speed > _STILL else None
