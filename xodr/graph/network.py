"""A road network: roads, junctions and signals, positions on them, and the ways between them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from random import Random

from schemas.common.remarks import Remark
from xodr.graph.links import divided, link_table, side_table
from xodr.graph.locate import Locator, follow
from xodr.graph.routes import Relative, RoadPath, RoadRelations, Router
from xodr.graph.travel import Choose, Travel, Traveller
from xodr.graph.ways import Ways
from xodr.model import (
    PERMANENT,
    TEMPORARY,
    Controller,
    Header,
    Junction,
    LaneLink,
    LaneSection,
    RoadError,
    RoadPoint,
    Signal,
    WorldPose,
)
from xodr.model.road import Road


class RoadNetwork:
    """Roads, junctions and controllers of one OpenDRIVE file, with the lanes in force: temporary
    ones where there are some.

    Road points keep to a layer of lanes. `on` and the arguments `layer` choose another than the one
    in force.

    Attributes:
        remarks: what was assumed where the file is faulty or asks for something that is not
            followed.
        signals: by id. Ids are unique in a valid file; where they are not, the first signal is
            meant.

    Example:
        >>> import xosc_toolchain as xt
        >>> network = xt.load_road("xodr/library/highway_straight.xodr")
        >>> pose = network.pose(network.lane_point("1", -2, 100.0))
        >>> pose.x, pose.y
        (100.0, -5.625)
        >>> point = network.locate(pose.x, pose.y)
        >>> point.road_id, point.lane_id, point.s
        ('1', -2, 100.0)
    """

    def __init__(
        self,
        path: Path,
        header: Header,
        roads: Mapping[str, Road],
        junctions: Mapping[str, Junction],
        controllers: Mapping[str, Controller],
        remarks: tuple[Remark, ...] = (),
    ) -> None:
        self.path = path
        self.header = header
        self.roads = divided(roads, junctions.values())
        self.junctions = dict(junctions)
        self.controllers = dict(controllers)
        self.remarks = remarks
        self.signals: dict[str, Signal] = {}
        for road in self.roads.values():
            for signal in road.signals:
                self.signals.setdefault(signal.id, signal)
        self._links = link_table(self.roads, self.junctions)
        self._locator = Locator(self.roads.values())
        sides = side_table(self.roads, self.junctions.values())
        self._traveller = Traveller(self.roads, self._links, sides)
        ways = Ways(self.roads, self._links, sides)
        self._router = Router(ways, self._links, self._traveller.straightest)
        self._relations = RoadRelations(ways, self._traveller)

    @cached_property
    def flat(self) -> bool:
        """Whether all roads are level at height 0."""
        return all(road.flat for road in self.roads.values())

    @cached_property
    def lane_ids(self) -> frozenset[int]:
        """Ids that lanes have anywhere, without the centre lane's."""
        return frozenset(lane for section in self._sections() for lane in section.lanes if lane)

    @cached_property
    def most_lanes(self) -> int:
        """Return the largest number of lanes side by side, without the centre lane."""
        return max((len(section.lanes) - 1 for section in self._sections()), default=0)

    def _sections(self) -> Iterator[LaneSection]:
        return (
            section
            for road in self.roads.values()
            for section in (*road.sections, *(road.permanent or ()))
        )

    def on(self, layer: str) -> RoadNetwork:
        """The network for road users that keep to a layer of lanes: itself, or without temporary
        lanes for PERMANENT."""
        return self if layer != PERMANENT else self._on_permanent

    @cached_property
    def _on_permanent(self) -> RoadNetwork:
        if all(road.permanent is None for road in self.roads.values()):
            return self
        roads = {road.id: road.on(PERMANENT) for road in self.roads.values()}
        return RoadNetwork(
            self.path, self.header, roads, self.junctions, self.controllers, self.remarks
        )

    @property
    def name(self) -> str:
        """Name in the file's header."""
        return self.header.name

    @property
    def geo_reference(self) -> str | None:
        """PROJ string of the map projection, None where the file has none."""
        return self.header.geo_reference

    def road(self, road_id: str) -> Road:
        """The road with that id.

        Raises:
            RoadError: there is none.
        """
        road = self.roads.get(road_id)
        if road is None:
            raise RoadError(
                f"there is no road {road_id!r}; roads: {_listed(self.roads)}", path=self.path
            )
        return road

    # positions ------------------------------------------------------------------------------

    def point(self, road_id: str, s: float, t: float, layer: str = TEMPORARY) -> RoadPoint:
        """The road point at (s, t) with the lane of the layer that it lies on."""
        return self.road(road_id).on(layer).point(s, t)._replace(layer=layer)

    def lane_point(
        self, road_id: str, lane_id: int, s: float, offset: float = 0.0, layer: str = TEMPORARY
    ) -> RoadPoint:
        """The road point on a lane of the layer, `offset` [m] from its centre towards +t."""
        return self.road(road_id).on(layer).lane_point(s, lane_id, offset)._replace(layer=layer)

    def road_of(self, point: RoadPoint) -> Road:
        """The road of a point, with the lanes that the point keeps to."""
        return self.roads[point.road_id].on(point.layer)

    def moved(self, point: RoadPoint, layer: str) -> RoadPoint:
        """The same place for a road user that keeps to another layer of lanes."""
        return point if point.layer == layer else self.point(point.road_id, point.s, point.t, layer)

    def pose(self, point: RoadPoint) -> WorldPose:
        """World pose of a road point; h is the road's heading, not the lane's traffic direction."""
        return self.roads[point.road_id].pose(point.s, point.t)

    def locate(
        self,
        x: float,
        y: float,
        z: float | None = None,
        h: float | None = None,
        hint: RoadPoint | None = None,
        layer: str | None = None,
    ) -> RoadPoint:
        """The road point nearest to a world position [m]; off the road its t lies outside the
        road's edges.

        Args:
            z, h: height [m] and heading [rad] of the road user, to decide between overlapping
                roads.
            hint: where it was shortly before. While it still is on that road, the answer is fast
                and stays there.
            layer: the lanes that it keeps to; those of the hint, or else those in force, by
                default.

        Raises:
            RoadError: the position is not finite.
        """
        layer = layer or (hint.layer if hint is not None else TEMPORARY)
        point = (
            follow(self.roads[hint.road_id].on(layer), x, y, hint.s) if hint is not None else None
        )
        if point is None:
            # One test for both: a sum with inf or NaN is not finite.
            if not math.isfinite(x + y):
                raise RoadError(f"({x}, {y}) is no place in the world", path=self.path)
            point = self.on(layer)._locator.locate(x, y, z, h)
        return point if point.layer == layer else point._replace(layer=layer)

    def on_road(self, point: RoadPoint) -> bool:
        """Whether the point lies on a lane of the road, in any layer, of any type but "none"."""
        road = self.roads[point.road_id]
        if not 0.0 <= point.s <= road.length:
            return False
        usual = road.on(PERMANENT)
        right, left = usual.edges(point.s)
        lies = (
            # Within the permanent edges there may be gaps, such as a median of type none.
            right <= point.t <= left
            and usual.lane_type(point.s, usual.lane_at(point.s, point.t)) != "none"
        )
        return lies or _on_temporary(road, point)

    # ways -----------------------------------------------------------------------------------

    def links(self, road_id: str, lane_id: int, forward: bool) -> list[LaneLink]:
        """Lanes reached from a lane at the end (forward) or start of its road, none inside roads.

        Lanes are those in force; `on` has those of a layer.
        """
        return self._links.get((road_id, lane_id, forward), [])

    def travel(
        self, point: RoadPoint, distance: float, forward: bool, choose: Choose | None = None
    ) -> Travel:
        """Move along the lane, over section and road borders and through junctions, keeping the
        lane offset.

        Args:
            distance: way of the point itself [m], as an odometer counts it; negative moves the
                other way.
            forward: direction of movement: True towards +s.
            choose: picks the way on where there are several; the straightest by default.

        Returns:
            The point reached, the direction there (for negative distances that of the reverse
            movement turned back), and
            the distance left over at the end of the road.
        """
        traveller = self.on(point.layer)._traveller
        choose = choose or traveller.straightest
        # Backwards is forwards in the other direction, turned round at the end.
        if distance >= 0.0:
            return traveller.travel(point, distance, forward, choose)
        point, backward, left = traveller.travel(point, -distance, not forward, choose)
        return Travel(point, not backward, left)

    def straightest(
        self, point: RoadPoint, forward: bool, links: Sequence[LaneLink]
    ) -> LaneLink | None:
        """The default choice at junctions: the way on that turns least."""
        return self._traveller.straightest(point, forward, links)

    def route(
        self,
        waypoints: Sequence[RoadPoint],
        strategies: Sequence[str] = (),
        rng: Random | None = None,
    ) -> RoadPath | None:
        """A route through two or more waypoints; None where no way leads from one to the next.

        Args:
            strategies: how to get from each waypoint to the next: "shortest" (also where none is
                given), "fastest", "leastIntersections" or "random", as in the standard's
                RouteStrategy.
            rng: source of the random routes.
        """
        # A strategy leads to the next waypoint, so the last one needs none.
        missing = len(waypoints) - 1 - len(strategies)
        layer = waypoints[0].layer if waypoints else TEMPORARY
        # A route keeps to one layer: that of its first waypoint.
        waypoints = [self.moved(waypoint, layer) for waypoint in waypoints]
        return self.on(layer)._router.route(waypoints, [*strategies, *["shortest"] * missing], rng)

    def relative(
        self, origin: RoadPoint, target: RoadPoint, strategy: str = "shortest"
    ) -> Relative | None:
        """Return the position of a point relative to another in road coordinates; None if no way
        connects them.

        Args:
            strategy: "shortest", "fastest" or "leastIntersections", as in the standard's
                RoutingAlgorithm.
        """
        return self.on(origin.layer)._relations.in_road(
            origin, self.moved(target, origin.layer), strategy
        )

    def relative_in_lane(
        self, origin: RoadPoint, target: RoadPoint, strategy: str = "shortest"
    ) -> Relative | None:
        """Return `relative` in lane coordinates: along the centre of the origin's lane, which goes
        on by lane links.

        ds is then a length on that lane, dt the difference of the distances from its centre, and
        lanes counts from it.
        """
        return self.on(origin.layer)._relations.in_lane(
            origin, self.moved(target, origin.layer), strategy
        )


def _on_temporary(road: Road, point: RoadPoint) -> bool:
    if road.permanent is None:
        return False
    lane = road.lane(point.s, road.lane_at(point.s, point.t))
    low, high = sorted((lane.inner(point.s), lane.outer(point.s)))
    return lane.layer == TEMPORARY and lane.type != "none" and low <= point.t <= high


def _listed(names: Mapping[str, object]) -> str:
    shown = list(names)[:8]
    return ", ".join(shown) + (", …" if len(names) > len(shown) else "")
