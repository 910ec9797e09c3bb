"""Conditions on orientation (OpenSCENARIO XML 1.3): AngleCondition and RelativeAngleCondition."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from runner.engine.compile.element import EntityCondition
from runner.engine.compile.registry import condition
from runner.engine.conditions.comparison import TOLERANCE
from runner.engine.motion.paths import nearest
from runner.engine.motion.placement import wrap
from runner.engine.motion.spacing import trajectory
from runner.engine.participants.entity import Entity
from xosc.document.node import Node

if TYPE_CHECKING:
    from runner.engine.compile.protocols import Instant
    from runner.engine.compile.registry import Context

_TYPES = ("heading", "pitch", "roll")
_SYSTEMS = ("entity", "lane", "road", "trajectory", "world")


class Angles(NamedTuple):
    """An orientation, rad."""

    heading: float
    pitch: float
    roll: float


class Aim(NamedTuple):
    """The angle (rad) that an orientation is compared with: which one, in which coordinate system,
    how exactly."""

    kind: str
    angle: float
    tolerance: float
    system: str

    @classmethod
    def from_xml(cls, node: Node, system: str) -> Aim:
        """Read the attributes; `system` is the default coordinate system."""
        tolerance = node.finite("angleTolerance")
        if tolerance < 0.0:
            raise node.invalid("angleTolerance must not be negative")
        return cls(
            node.choice("angleType", _TYPES),
            node.finite("angle"),
            tolerance,
            node.choice("coordinateSystem", _SYSTEMS, system),
        )

    def of(self, entity: Entity, run: Instant) -> float | None:
        """The entity's angle in the coordinate system, in (−π, π]; None where there is no such
        system."""
        reference = _reference(entity, run, self.system)
        if reference is None:
            return None
        own = Angles(entity.h, entity.pitch, entity.roll)
        return wrap(getattr(own, self.kind) - getattr(reference, self.kind))

    def meets(self, angle: float | None) -> bool:
        """Whether an angle is within the tolerance, all the way round the circle."""
        return angle is not None and abs(wrap(angle - self.angle)) <= self.tolerance + TOLERANCE

    def describe(self, whose: str, angle: float | None) -> str:
        """The angle compared."""
        seen = "undefined" if angle is None else f"{angle:.4g} rad"
        return (
            f"{self.kind} of {whose} ({self.system}) = {seen}, {self.angle:g} ± "
            f"{self.tolerance:g} rad expected"
        )


def _reference(entity: Entity, run: Instant, system: str) -> Angles | None:
    """Orientation of a coordinate system at the entity: roads and lanes point towards +s, in any
    direction of traffic."""
    if system == "world":
        return Angles(0.0, 0.0, 0.0)
    if system == "entity":
        return Angles(entity.h, entity.pitch, entity.roll)
    if system == "trajectory":
        path = trajectory(entity)
        pose = path.at(nearest(path, entity.x, entity.y)) if path is not None else None
        return Angles(pose.h, pose.pitch, pose.roll) if pose is not None else None
    point = run.roads.road_point(entity)
    if point is None or run.roads.network is None:
        return None
    road = run.roads.network.roads[point.road_id]
    pose = road.pose(point.s, point.t)
    drift = 0.0
    if system == "lane":
        drift = math.atan2(
            road.lane_slope(point.s, point.lane_id), 1.0 - road.curvature(point.s) * point.t
        )
    return Angles(pose.h + drift, pose.pitch, pose.roll)


@condition("AngleCondition")
class AngleCondition(EntityCondition):
    """True while an angle of the entity in a coordinate system (default world) is within a
    tolerance of a value."""

    def __init__(self, aim: Aim) -> None:
        self.aim = aim

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> AngleCondition:
        """Read the attributes."""
        return cls(Aim.from_xml(node, "world"))

    def holds(self, entity: Entity, run: Instant) -> bool:
        """Whether the angle is within the tolerance."""
        return self.aim.meets(self.aim.of(entity, run))

    def describe(self, entity: Entity, run: Instant) -> str:
        """The angle compared."""
        return self.aim.describe(entity.name, self.aim.of(entity, run))


@condition("RelativeAngleCondition")
class RelativeAngleCondition(EntityCondition):
    """True while an angle of the triggering entity minus that of the reference entity is within a
    tolerance of a value.

    In road, lane and trajectory coordinates each angle is taken where its entity is, so that two
    vehicles that follow a curve one behind the other have no relative heading. In world and entity
    coordinates (the default) they have.
    """

    def __init__(self, other: Entity, aim: Aim) -> None:
        self.other = other
        self.aim = aim

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> RelativeAngleCondition:
        """Read the attributes."""
        return cls(context.entity(node), Aim.from_xml(node, "entity"))

    def _angle(self, entity: Entity, run: Instant) -> float | None:
        if not self.other.active:
            return None
        aim = self.aim._replace(system="world") if self.aim.system == "entity" else self.aim
        own, other = aim.of(entity, run), aim.of(self.other, run)
        return wrap(own - other) if own is not None and other is not None else None

    def holds(self, entity: Entity, run: Instant) -> bool:
        """Whether the relative angle is within the tolerance."""
        return self.aim.meets(self._angle(entity, run))

    def describe(self, entity: Entity, run: Instant) -> str:
        """The relative angle compared."""
        return self.aim.describe(
            f"{entity.name} relative to {self.other.name}", self._angle(entity, run)
        )
