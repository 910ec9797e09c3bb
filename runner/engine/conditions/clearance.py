"""RelativeClearanceCondition: whether lanes beside an entity are free (OpenSCENARIO XML 1.3)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from runner.engine.compile.element import EntityCondition
from runner.engine.compile.registry import condition
from runner.engine.motion.spacing import Bearing, bearing, facing, footprint
from runner.engine.participants.entity import Entity
from xodr.graph.routes import lanes_between
from xosc.document.node import Node

if TYPE_CHECKING:
    from runner.engine.compile.protocols import Instant
    from runner.engine.compile.registry import Context
    from xodr.model import RoadPoint
    from xodr.model.road import Road


class LaneRange(NamedTuple):
    """Lanes relative to the entity's own, positive to its left; infinite where the file sets no
    limit."""

    low: float
    high: float

    @classmethod
    def from_xml(cls, node: Node) -> LaneRange:
        """Read the attributes from and to."""
        low, high = node.int("from", -math.inf), node.int("to", math.inf)
        if low > high:
            raise node.invalid(f"from={low:g} must not be greater than to={high:g}")
        return cls(low, high)


@condition("RelativeClearanceCondition")
class RelativeClearanceCondition(EntityCondition):
    """True while lanes beside the entity are to be checked and they are free over the distances
    checked.

    Lanes are counted from the entity's own, positive to its left, the centre lane left out. Those
    of the ranges that the road has are checked, an opening one from its beginning; lanes against
    the entity's direction are left out unless `oppositeLanes`. With `freeSpace` others count with
    their whole bounding box, without it with their reference point. Distances run from the entity's
    reference point along its lane, on over the border of the road.

    Args:
        forward, backward: distances checked, m.
    """

    def __init__(
        self,
        ranges: tuple[LaneRange, ...],
        others: tuple[Entity, ...],
        forward: float,
        backward: float,
        free_space: bool,
        opposite: bool,
    ) -> None:
        self.ranges = ranges
        self.others = others
        self.forward = forward
        self.backward = backward
        self.free_space = free_space
        self.opposite = opposite

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> RelativeClearanceCondition:
        """Read lanes, entities (all where none is named) and distances (0 where absent)."""
        if context.network is None:
            raise node.invalid("lanes can't be checked: the scenario names no road network")
        ranges = tuple(LaneRange.from_xml(part) for part in node.children("RelativeLaneRange"))
        named = [
            entity
            for reference in node.children("EntityRef")
            for entity in context.entities(reference)
        ]
        forward, backward = node.float("distanceForward", 0.0), node.float("distanceBackward", 0.0)
        if min(forward, backward) < 0.0:
            raise node.invalid("distanceForward and distanceBackward must not be negative")
        return cls(
            ranges or (LaneRange(-math.inf, math.inf),),
            tuple(dict.fromkeys(named)) or tuple(context.declared.values()),
            forward,
            backward,
            node.bool("freeSpace"),
            node.bool("oppositeLanes"),
        )

    def holds(self, entity: Entity, run: Instant) -> bool:
        """Whether the lanes exist and are free."""
        lanes = self._lanes(entity, run)
        return bool(lanes) and self._first_inside(entity, run, lanes) is None

    def describe(self, entity: Entity, run: Instant) -> str:
        """Checked lanes, and the entities in them."""
        lanes = self._lanes(entity, run)
        if not lanes:
            return f"the lanes to be clear beside {entity.name} do not exist"
        inside = self._first_inside(entity, run, lanes)
        named = ", ".join(f"{lane:+d}" if lane else "0" for lane in sorted(lanes))
        state = "clear" if inside is None else f"occupied by {inside.name}"
        return (
            f"lanes {named} of {entity.name} from {-self.backward:g} m to "
            f"{self.forward:g} m are {state}"
        )

    def _lanes(self, entity: Entity, run: Instant) -> frozenset[int]:
        """Relative lanes to be checked; empty where there are none."""
        point = run.roads.road_point(entity)
        if point is None or run.roads.network is None:
            return frozenset()
        road = run.roads.network.roads[point.road_id]
        existing = _lanes_beside(road, point, facing(entity, road, point.s))
        checked = {
            lane for lane in existing if any(low <= lane <= high for low, high in self.ranges)
        }
        own = (
            road.direction(point.lane_id, point.s)
            if point.lane_id
            else facing(entity, road, point.s)
        )
        return frozenset(
            lane
            for lane in checked
            if self.opposite or road.direction(existing[lane], point.s) == own
        )

    def _first_inside(self, entity: Entity, run: Instant, lanes: frozenset[int]) -> Entity | None:
        """Entity in one of the lanes within the distances."""
        own = (entity, entity.controls.trailer, entity.controls.tractor)
        for other in self.others:
            if (
                other.active
                and other.placed
                and other not in own
                and self._inside(entity, other, run, lanes)
            ):
                return other
        return None

    def _inside(self, entity: Entity, other: Entity, run: Instant, lanes: frozenset[int]) -> bool:
        seen = bearing(run.roads, entity, other, lane=True)
        if seen is None or run.roads.network is None:
            return False
        side = facing(entity, run.roads.network.roads[seen.a.road_id], seen.a.s)
        ahead = side * seen.ds
        if not self.free_space:
            return -self.backward <= ahead <= self.forward and side * seen.lanes in lanes
        road = run.roads.network.roads[seen.b.road_id]
        there = footprint(road, seen.b, other.h, other.box, seen.line_b)
        turn = side if seen.aligned else -side
        rear, front = sorted((turn * there.rear, turn * there.front))
        if ahead + rear > self.forward or ahead + front < -self.backward:
            return False
        return any(
            turn * relative + side * seen.lanes in lanes
            for relative in _lanes_under(road, seen, seen.b.t + there.right, seen.b.t + there.left)
        )


def _lanes_beside(road: Road, point: RoadPoint, side: int) -> dict[int, int]:
    """Return the lanes of the road at a point: relative lane, positive to the left when facing
    `side` (±1 for ±s) → lane id."""
    return {side * lanes_between(point.lane_id, lane): lane for lane in road.lane_ids(point.s)}


def _lanes_under(road: Road, seen: Bearing, right: float, left: float) -> list[int]:
    """Lanes that a stretch of t covers, counted from the lane of the reference point towards +t of
    its road."""
    s = seen.b.s
    section = road.section(s)
    lanes_under = []
    for lane_id in road.lane_ids(s):
        lane = section.lanes[lane_id]
        low, high = sorted((lane.inner(s), lane.outer(s)))
        if low < left and high > right:
            lanes_under.append(lanes_between(seen.b.lane_id, lane_id))
    return lanes_under
