"""Positions in road and lane coordinates, absolute and relative to an entity.

Road coordinates (s, t) and lane ids are those of OpenDRIVE: they do not depend on the direction of
traffic. Only the heading does: a lane position faces the way that the lane's traffic drives.
"""

from __future__ import annotations

import math
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from runner.engine.compile import registry
from runner.engine.compile.element import FixedPosition, Position
from runner.engine.motion.placement import Placement, lane_heading
from runner.engine.positions.world import Orientation, on_road
from xodr.model import PERMANENT, TEMPORARY, RoadError, RoadPoint
from xosc.document.node import TO_RIGHT
from xosc.rules.positions import LANE_DISTANCE_UID, LANE_UID, ROAD_LENGTH_UID

if TYPE_CHECKING:
    from collections.abc import Mapping

    from runner.engine.compile.array_protocols import ArrayRun
    from runner.engine.compile.protocols import Surroundings
    from runner.engine.compile.registry import Context
    from runner.engine.participants.entity import Entity
    from schemas.common.array_types import FloatArray
    from xodr.graph.network import RoadNetwork
    from xodr.graph.travel import Choose
    from xodr.model.road import Road
    from xosc.document.node import Node

LAYERS = (PERMANENT, TEMPORARY)
"""Layers of lanes, as the attribute `layer` names them."""
_MISPLACED = 10.0
"""Distance (m) beyond the end of a road above which a position there is another scene: two
vehicles' lengths."""
_TOLERANCE = 1e-3
"""Tolerance (m) of s beyond the end of its road: files are rounded."""


def lane_placement(network: RoadNetwork, point: RoadPoint, orientation: Orientation) -> Placement:
    """Placement that faces the direction of the lane's traffic, unless an orientation is given."""
    road = network.road_of(point)
    h = lane_heading(road, point)
    if point.lane_id and road.direction(point.lane_id, point.s) < 0:
        h += math.pi
    return on_road(network, point, h, orientation)


def read_lane_id(node: Node) -> int:
    """The attribute laneId, an OpenDRIVE lane id."""
    return int(node.int("laneId"))


def misplaced(beyond: float) -> str:
    """Cause of an inconclusive run where a position is so far (m) beyond the end that takes its
    place; empty for a little."""
    return "misplaced" if beyond > _MISPLACED else ""


def _road_and_s(node: Node, context: Context) -> tuple[Road, float]:
    """The road, and s on it: beyond an end of the road that end is meant."""
    s = float(node.finite("s"))
    try:
        road = context.need_network(node).road(node.get("roadId"))
    except RoadError as error:
        raise node.invalid(error.message) from None
    if not -_TOLERANCE <= s <= road.length + _TOLERANCE:
        end = "its beginning" if s < 0.0 else "its end"
        text = (
            f"s={s:g} is not on road {road.id!r}, which is {road.length:.3f} m "
            f"long; {end} is assumed"
        )
        context.repair(node, ROAD_LENGTH_UID, text, misplaced(max(-s, s - road.length)))
    return road, min(max(s, 0.0), road.length)


@registry.position("RoadPosition")
class RoadPosition(FixedPosition):
    """s and t on a road."""

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> RoadPosition:
        """Read the attributes and check them against the road network."""
        network = context.need_network(node)
        road, s = _road_and_s(node, context)
        point = road.point(s, node.finite("t"))
        return cls(
            node, on_road(network, point, road.heading(s), Orientation.from_xml(node, context))
        )


@registry.position("LanePosition")
class LanePosition(FixedPosition):
    """s on a lane of a road, at an offset from the lane's centre (positive towards +t).

    Lane ids are those of the temporary layer where there is one, or of the `layer` that is named;
    without a name, an entity that prefers the permanent layer (PreferredLaneLayerAction) is put on
    that.
    """

    permanent: Placement | None = None

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> LanePosition:
        """Read the attributes and check them against the road network."""
        network = context.need_network(node)
        road, s = _road_and_s(node, context)
        layer = node.choice("layer", LAYERS, None)
        orientation, lane_id, offset = (
            Orientation.from_xml(node, context),
            read_lane_id(node),
            node.finite("offset", 0.0),
        )

        def placed(on: str) -> Placement:
            return lane_placement(
                network, network.lane_point(road.id, lane_id, s, offset, on), orientation
            )

        permanent = None
        if layer is None and road.permanent is not None:
            with suppress(RoadError):
                permanent = placed(PERMANENT)
        try:
            found = cls(node, placed(layer or TEMPORARY)._replace(layered=layer is not None))
        except RoadError as error:
            if permanent is None:
                raise node.invalid(error.message) from None
            found = cls(node, permanent._replace(layered=True))
            context.repair(
                node, LANE_UID, f"{error.message}; the lane of the permanent layer is assumed"
            )
        found.permanent = permanent
        if lane_id == 0:
            text = (
                "laneId='0' is the centre lane, which has no width: the place is where lanes meet"
            )
            context.remarks.note(node.remark(LANE_UID, text))
        return found

    def stations(
        self, run: ArrayRun, first: int, varying: Mapping[str, FloatArray]
    ) -> FloatArray | None:
        """The attribute s, where nothing else varies."""
        return varying["s"] if varying.keys() == {"s"} else None

    def resolve(self, run: Surroundings | None, actor: Entity | None = None) -> Placement:
        """The place, on the layer that the actor prefers where none is named."""
        if (
            self.permanent is not None
            and actor is not None
            and actor.controls.preferred_layer == PERMANENT
        ):
            return self.permanent
        return self.fixed


class _RelativeRoadPosition(Position):
    """Base of the positions relative to an entity's place on the road."""

    def __init__(self, node: Node, context: Context) -> None:
        super().__init__(node)
        self.network = context.need_network(node)
        self.entity = context.entity(node)
        self.orientation = Orientation.from_xml(node, context)
        self.to_right = node.has(TO_RIGHT)

    def references(self) -> tuple[Entity, ...]:
        """The entity referred to."""
        return (self.entity,)

    def left(self, origin: RoadPoint) -> int:
        """The side, as a sign of t at the origin, to which lateral values count: +t, or in files
        for CARLA the entity's right."""
        return -self.facing(origin) if self.to_right else 1

    def facing(self, origin: RoadPoint) -> int:
        """+1 where the entity faces increasing s, -1 where it faces decreasing s."""
        return (
            1
            if math.cos(self.entity.h - self.network.road(origin.road_id).heading(origin.s)) >= 0.0
            else -1
        )

    def origin(self, run: Surroundings | None) -> RoadPoint:
        """Return the road position of the referenced entity."""
        assert run is not None
        point = run.roads.road_point(self.current(self.entity))
        assert point is not None
        return point

    def repair(self, run: Surroundings | None, rule: str, text: str, cause: str = "") -> None:
        """Go on with what is meant although this position breaks a rule, with a remark; refused
        where loading is strict."""
        assert run is not None
        run.remarks.add(self.node.remark(rule, text, cause))

    def along(
        self, run: Surroundings | None, origin: RoadPoint, ds: float
    ) -> tuple[RoadPoint, bool]:
        """The point on the same lane ds further in s, or at the end of the road, and whether +s is
        the same direction there."""
        route = self.entity.controls.route
        choose = route.choose if route is not None else self.network.straightest
        point, aligned, left = travel_s(self.network, origin, ds, choose)
        if left:
            side = "after" if ds > 0.0 else "before"
            text = (
                f"the road ends less than {abs(ds):g} m {side} "
                f"{self.entity.name!r}; its end is assumed"
            )
            self.repair(run, ROAD_LENGTH_UID, text, misplaced(left))
        return point, aligned


@registry.position("RelativeRoadPosition")
class RelativeRoadPosition(_RelativeRoadPosition):
    """ds and dt in road coordinates from an entity's reference point."""

    def __init__(self, node: Node, context: Context) -> None:
        super().__init__(node, context)
        self.ds, self.dt = node.finite("ds"), node.finite("dt")

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> RelativeRoadPosition:
        """Read the attributes."""
        return cls(node, context)

    def resolve(self, run: Surroundings | None, actor: Entity | None = None) -> Placement:
        """Return the current place."""
        origin = self.origin(run)
        reached, aligned = self.along(run, origin, self.ds)
        t = origin.t + self.left(origin) * self.dt
        road = self.network.road(reached.road_id)
        point = road.point(reached.s, t if aligned else -t)
        forwards = aligned == (self.facing(origin) > 0 or not self.to_right)
        return on_road(
            self.network,
            point,
            road.heading(reached.s) + (0.0 if forwards else math.pi),
            self.orientation,
        )


@registry.position("RelativeLanePosition")
class RelativeLanePosition(_RelativeRoadPosition):
    """dLane lanes towards +t from an entity's lane (the centre lane not counted), and ds in s or
    dsLane along its lane.

    ds counts towards +s, dsLane in the direction that the entity faces. Without an Orientation, a
    position by ds faces as the entity does, one by dsLane as the lane's traffic.
    """

    def __init__(self, node: Node, context: Context) -> None:
        super().__init__(node, context)
        self.lanes = int(node.int("dLane"))
        if abs(self.lanes) > self.network.most_lanes:  # one step beyond the lanes is beside them
            most = self.network.most_lanes
            raise node.invalid(
                f"dLane={self.lanes} leads beyond the lanes of any road, which has {most} at most"
            )
        self.offset = node.finite("offset", 0.0)
        self.ds, self.ds_lane = node.finite("ds", None), node.finite("dsLane", None)
        if self.ds is not None and self.ds_lane is not None:
            raise node.invalid("one of the attributes ds and dsLane is expected, and only one")
        if self.ds is None and self.ds_lane is None:
            context.repair(
                node,
                LANE_DISTANCE_UID,
                "one of the attributes ds and dsLane is expected; dsLane=0 is assumed",
            )
            self.ds_lane = 0.0

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> RelativeLanePosition:
        """Read the attributes."""
        return cls(node, context)

    def resolve(self, run: Surroundings | None, actor: Entity | None = None) -> Placement:
        """Return the current place."""
        origin = self.origin(run)
        reached, aligned = (
            self.along(run, origin, self.ds)
            if self.ds is not None
            else self._along_lane(run, origin)
        )
        side = 1 if aligned else -1
        lane, beside = self._lane(run, reached, side * self.lanes)
        offset = side * self.left(origin) * self.offset
        road = self.network.road_of(reached)
        point = road.lane_point(reached.s, lane, offset + beside)._replace(layer=reached.layer)
        if self.ds is None or self.oriented:
            return lane_placement(self.network, point, self.orientation)
        forwards = aligned == (self.facing(origin) > 0)
        return on_road(
            self.network,
            point,
            lane_heading(road, point) + (0.0 if forwards else math.pi),
            self.orientation,
        )

    def stations(
        self, run: ArrayRun, first: int, varying: Mapping[str, FloatArray]
    ) -> FloatArray | None:
        """Stations ds or dsLane from an entity's s, on the straight stretch of its lane."""
        name = "dsLane" if self.ds is None else "ds"
        entity = run.entities[self.entity.name]
        if not varying.keys() <= {name} or not entity.straight[first]:
            return None
        way = varying.get(name, self.ds_lane if self.ds is None else self.ds)
        s = entity.s + way * (entity.direction if self.ds is None else 1)
        within = entity.alike(first, entity.placed) & (entity.low <= s) & (s < entity.high)
        within &= entity.kept_offset == entity.kept_offset[first]
        within &= entity.heading_offset == entity.heading_offset[first]
        return np.where(within, s, np.nan)

    def _lane(self, run: Surroundings | None, reached: RoadPoint, steps: int) -> tuple[int, float]:
        """The lane so many steps towards +t, and how far (m) towards +t of it the place is that is
        meant.

        One step beyond the outermost lane is beside the road, as far from that lane as another of
        its width would be.
        """
        road, s = self.network.road_of(reached), reached.s
        lane = road.lane_beside(s, reached.lane_id, steps)
        if lane is not None:
            return lane, 0.0
        outward = 1 if steps > 0 else -1
        outermost = road.lane_beside(s, reached.lane_id, steps - outward)
        text = (
            f"dLane={self.lanes} leads from {self.entity.name!r} beyond the "
            f"lanes of road {road.id!r}"
        )
        if outermost is None:
            raise self.node.invalid(f"{text} at s = {s:.2f} m")
        self.repair(run, LANE_UID, f"{text}; a lane beside the road is assumed")
        return outermost, outward * road.lane_width(s, outermost)

    def _along_lane(self, run: Surroundings | None, origin: RoadPoint) -> tuple[RoadPoint, bool]:
        route, entity = self.entity.controls.route, self.entity
        ahead = self.facing(origin) > 0
        center = self.network.lane_point(
            origin.road_id, origin.lane_id, origin.s, layer=origin.layer
        )
        point, forward, left = self.network.travel(
            center, self.ds_lane, ahead, route.choose if route is not None else None
        )
        if left > _TOLERANCE:
            text = (
                f"the lane of {entity.name!r} ends before "
                f"dsLane={self.ds_lane:g}; its end is assumed"
            )
            self.repair(run, ROAD_LENGTH_UID, text, misplaced(left))
        return point, forward == ahead


def travel_s(
    network: RoadNetwork, origin: RoadPoint, ds: float, choose: Choose
) -> tuple[RoadPoint, bool, float]:
    """Go ds (m) along the reference lines, following the lane over road borders, and round as often
    as it takes.

    Returns the centre of the lane there, whether +s is the direction it was at the origin, and the
    distance (m) that is left where the road ends before.
    """
    network, layer = network.on(origin.layer), origin.layer
    road, s, lane = network.road(origin.road_id), origin.s, origin.lane_id
    began = forward = ds >= 0.0
    left = abs(ds)
    entered: dict[tuple[str, int, bool], float] = {}
    while True:
        room = road.length - s if forward else s
        reached = s + left if forward else s - left
        if left <= room + _TOLERANCE:
            reached = min(max(reached, 0.0), road.length)
            return (
                road.lane_point(reached, _lane_at(road, s, reached, lane))._replace(layer=layer),
                forward == began,
                0.0,
            )
        end = road.length if forward else 0.0
        lane = _lane_at(road, s, end, lane)
        link = choose(road.lane_point(end, lane), forward, network.links(road.id, lane, forward))
        left -= room
        if link is None:
            return road.lane_point(end, lane)._replace(layer=layer), forward == began, left
        road, lane, forward = network.road(link.road_id), link.lane_id, link.at_start
        s = 0.0 if forward else road.length
        before = entered.setdefault((road.id, lane, forward), math.inf)
        if before <= left:  # a circle of no length
            return road.lane_point(s, lane)._replace(layer=layer), forward == began, left
        left = math.fmod(left, before - left)
        entered[road.id, lane, forward] = left


def _lane_at(road: Road, start: float, end: float, lane: int) -> int:
    """The lane at `end` that a lane at `start` of the same road leads to."""
    here, there = road.section_index(start), road.section_index(end)
    step = 1 if there > here else -1
    for index in range(here, there, step):
        linked = (
            road.sections[index].lanes[lane].successor
            if step > 0
            else road.sections[index].lanes[lane].predecessor
        )
        if linked is None or linked not in road.sections[index + step].lanes:
            return road.lane_at(end, road.lane_t(start, lane))
        lane = linked
    return lane
