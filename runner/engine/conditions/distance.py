"""Conditions on distances and on times derived from them (OpenSCENARIO XML 1.3, EntityCondition and
6.4).

Distances are compared without their sign. How each is measured is said in
`runner.engine.motion.spacing`.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from runner.engine.compile.element import EntityCondition, NearCondition
from runner.engine.compile.registry import condition
from runner.engine.conditions.comparison import TOLERANCE, Comparison
from runner.engine.motion import spacing
from runner.engine.participants.entity import Entity, Separation
from runner.engine.participants.rows import RunRows
from schemas.common.errors import InvalidFile
from schemas.expressions.columns import NotInArrays
from xosc.document.node import Node

if TYPE_CHECKING:
    from collections.abc import Callable

    from runner.engine.compile.array_protocols import ArrayRun
    from runner.engine.compile.element import Position
    from runner.engine.compile.protocols import Instant
    from runner.engine.compile.registry import Context
    from runner.engine.motion.placement import Placement
    from runner.engine.participants.rows import EntityRows
    from schemas.common.array_types import BoolArray, FloatArray, IntArray

_TYPES = {
    "longitudinal": "longitudinal",
    "lateral": "lateral",
    "euclidianDistance": "euclidean",
    "cartesianDistance": "euclidean",
}
_FAR = 50.0
"""Distance (m) in the plane, beyond twice a way along roads, from which that way is certainly
longer"""
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
        """The distance, signed where it has a direction (see `runner.engine.motion.spacing`); None
        where it is undefined."""
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

    def between_arrays(
        self, run: ArrayRun, a: EntityRows, b: EntityRows | PlaceRows, below: FloatArray | float
    ) -> FloatArray:
        """`between` in many runs (n,); NaN where it is undefined, or in the plane certainly not
        `below` a distance (m)."""
        found, known = (
            spacing.euclidean_arrays(a, b, self.freespace)
            if self.kind == "euclidean"
            else spacing.directed_arrays(
                a, b, self.kind == "longitudinal", self.system, self.freespace
            )
        )
        left = run.going & ~known
        if left.any() and np.ndim(below) == 0 and below == math.inf:
            near = left
        elif left.any():
            near = left & (np.hypot(b.x - a.x, b.y - a.y) - a.reach - b.reach <= 2.0 * below + _FAR)
        else:
            return found
        found = np.where(left, np.nan, found)
        for row in np.flatnonzero(near):
            value = self.between(run.single, a.load(row), b.load(row))
            found[row] = math.nan if value is None else value
        return found

    def closing_arrays(self, run: ArrayRun, a: EntityRows, b: EntityRows | PlaceRows) -> FloatArray:
        """`closing` in many runs (n,); NaN where it is undefined."""
        found = np.full(run.n, np.nan)
        for row in np.flatnonzero(run.going):
            value = self.closing(run.single, a.load(row), b.load(row))
            found[row] = math.nan if value is None else value
        return found

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
        """Whether it moves as participants do, or not at all; a position that is relative to one
        may move faster."""
        return self.position is None or self.position.fixed is not None

    def find(self, run: Instant, actor: Entity) -> Entity | Placement | None:
        """Return the current entity or place; None for an absent entity, or a position relative to
        one."""
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

    def in_arrays(self, run: ArrayRun) -> EntityRows | PlaceRows:
        """The entity or place in many runs.

        Raises:
            NotInArrays: the place depends on entities.
        """
        if self.entity is not None:
            return run.entities[self.entity.name]
        assert self.position is not None
        return run.own(PlaceRows(self.position, run.sets))


class PlaceRows(RunRows):
    """A place in many runs: x, y, z (n,), m."""

    reach = 0.0

    def __init__(self, position: Position, sets: IntArray) -> None:
        if position.at_set(0).fixed is None:
            raise NotInArrays(
                f"{position.node.tag} is a place relative to entities, which conditions know in "
                "single runs only"
            )
        if position.fixed is not None:
            places = [position.fixed] * len(sets)
        else:
            known = {int(number): position.at_set(int(number)).fixed for number in np.unique(sets)}
            places = [known[int(number)] for number in sets]  # type: ignore[misc]
        self._places = np.empty(len(sets), object)
        self._places[:] = [(place,) for place in places]
        self.x, self.y, self.z = (
            np.array([getattr(place, name) for place in places]) for name in "xyz"
        )

    def load(self, row: Any) -> Placement:
        """The place in a run."""
        place: Placement = self._places[row][0]
        return place


class _Measured(EntityCondition):
    """Compares a quantity between an entity and a target; false if the quantity is undefined."""

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

    def between_arrays(
        self, entity: EntityRows, target: EntityRows | PlaceRows, run: ArrayRun
    ) -> FloatArray:
        """`between` in many runs (n,); NaN where it is undefined, or is certainly too great for the
        comparison."""
        raise NotInArrays(f"{type(self).__name__} is evaluated in single runs only")

    def in_arrays(self, entity: EntityRows, run: ArrayRun) -> Callable[[], BoolArray]:
        """The comparison."""
        target = self.target.in_arrays(run)
        return lambda: self.comparison.holds_arrays(self.between_arrays(entity, target, run), run)

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
        """Half of the way to where a distance, straight or along a plain road, is short enough:
        both go it."""
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

    def between_arrays(
        self, entity: EntityRows, target: EntityRows | PlaceRows, run: ArrayRun
    ) -> FloatArray:
        """The distance without its sign."""
        below = run.value(self.comparison.greatest)
        return np.abs(self.measure.between_arrays(run, entity, target, below))


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
    """True while the reference point is within a circle about a position (deprecated by the
    standard for DistanceCondition)."""

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

    def in_arrays(self, entity: EntityRows, run: ArrayRun) -> Callable[[], BoolArray]:
        """The runs in which the entity is inside the circle."""
        place = self.target.in_arrays(run)

        def evaluate() -> BoolArray:
            distance = np.hypot(place.x - entity.x, place.y - entity.y)
            found: BoolArray = distance < run.value(self.tolerance) + TOLERANCE
            return found

        return evaluate

    def describe(self, entity: Entity, run: Instant) -> str:
        """The distance from the circle's centre."""
        return Comparison("lessOrEqual", self.tolerance, "m").describe(
            f"distance {entity.name}–position", self._distance(entity, run)
        )


@condition("TimeHeadwayCondition")
class TimeHeadwayCondition(_Measured):
    """Compares distance by own speed (s): undefined unless the other is ahead and the entity drives
    forward."""

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

    def between_arrays(
        self, entity: EntityRows, target: EntityRows | PlaceRows, run: ArrayRun
    ) -> FloatArray:
        """The time headway."""
        distance = self.measure.between_arrays(run, entity, target, math.inf)
        ahead = spacing.directed_arrays(entity, target, True, "entity", False)[0] > TOLERANCE
        if self.measure.kind == "longitudinal":
            ahead = np.where(distance != 0.0, distance > 0.0, ahead)
        valid = ahead & (entity.speed >= _STILL)
        return np.divide(np.abs(distance), entity.speed, out=np.full(run.n, np.nan), where=valid)

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

    def between_arrays(
        self, entity: EntityRows, target: EntityRows | PlaceRows, run: ArrayRun
    ) -> FloatArray:
        """The time to collision."""
        distance = self.measure.between_arrays(run, entity, target, math.inf)
        speed = self.measure.closing_arrays(run, entity, target)
        return np.divide(np.abs(distance), speed, out=np.full(run.n, np.nan), where=speed > _STILL)
