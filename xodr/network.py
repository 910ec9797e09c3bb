"""A road network: roads, junctions and signals, positions on them, and the ways between them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from random import Random

from schemas.remarks import Remark
from xodr.graph.links import link_table
from xodr.graph.relative import Relations, Relative
from xodr.graph.routes import RoadPath, Router
from xodr.graph.side_links import divided, side_table
from xodr.graph.travel import Choose, Travel, Traveller
from xodr.graph.ways import Ways
from xodr.lookup.locate import Locator, follow
from xodr.model import Controller, Header, Junction, LaneLink, LaneSection, Pose, RoadError, RoadPoint, Signal
from xodr.road import Road


class RoadNetwork:
    """Everything that one OpenDRIVE file describes.

    Attributes:
        remarks: what was assumed where the file is faulty or asks for something that is not followed.
        signals: by id. Ids are unique in a valid file; where they are not, the first signal is meant.
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
        self.roads = divided(roads)
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
        self._router = Router(ways, self._traveller.straightest)
        self._relations = Relations(ways, self._traveller)

    @cached_property
    def lane_ids(self) -> frozenset[int]:
        """Ids that lanes have anywhere, without the centre lane's."""
        return frozenset(lane for section in self._sections() for lane in section.lanes if lane)

    @cached_property
    def most_lanes(self) -> int:
        """How many lanes lie side by side at most, without the centre lane."""
        return max((len(section.lanes) - 1 for section in self._sections()), default=0)

    def _sections(self) -> Iterator[LaneSection]:
        return (section for road in self.roads.values() for section in road.sections)

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
            raise RoadError(f"there is no road {road_id!r}; roads: {_listed(self.roads)}", path=self.path)
        return road

    # positions ------------------------------------------------------------------------------

    def point(self, road_id: str, s: float, t: float) -> RoadPoint:
        """The road point at (s, t) with the lane that it lies on."""
        return self.road(road_id).point(s, t)

    def lane_point(self, road_id: str, lane_id: int, s: float, offset: float = 0.0) -> RoadPoint:
        """The road point on a lane, `offset` [m] from its centre towards +t."""
        return self.road(road_id).lane_point(s, lane_id, offset)

    def pose(self, point: RoadPoint) -> Pose:
        """World pose of a road point; h is the road's heading, not the lane's traffic direction."""
        return self.roads[point.road_id].pose(point.s, point.t)

    def locate(
        self, x: float, y: float, z: float | None = None, h: float | None = None, hint: RoadPoint | None = None
    ) -> RoadPoint:
        """The road point nearest to a world position [m]; off the road its t lies outside the road's edges.

        Args:
            z, h: height [m] and heading [rad] of the road user, to decide between overlapping roads.
            hint: where it was shortly before. While it still is on that road, the answer is fast and stays there.

        Raises:
            RoadError: the position is not finite.
        """
        if hint is not None:
            point = follow(self.roads[hint.road_id], x, y, hint.s)
            if point is not None:
                return point
        if not math.isfinite(x + y):
            raise RoadError(f"({x}, {y}) is no place in the world", path=self.path)
        return self._locator.locate(x, y, z, h)

    def on_road(self, point: RoadPoint) -> bool:
        """Whether the point lies on a lane of the road; lanes of type "none" are not part of it."""
        road = self.roads[point.road_id]
        if not 0.0 <= point.s <= road.length:
            return False
        right, left = road.edges(point.s)
        return right <= point.t <= left and road.lane_type(point.s, road.lane_at(point.s, point.t)) != "none"

    # ways -----------------------------------------------------------------------------------

    def links(self, road_id: str, lane_id: int, forward: bool) -> list[LaneLink]:
        """Every lane reached at the end (forward) or start of a road from one of its lanes there, but for those inside roads."""
        return self._links.get((road_id, lane_id, forward), [])

    def travel(self, point: RoadPoint, distance: float, forward: bool, choose: Choose | None = None) -> Travel:
        """Move along the lane, over section and road borders and through junctions, keeping the lane offset.

        Args:
            distance: way of the point itself [m], as an odometer counts it; negative moves the other way.
            forward: direction of movement: True towards +s.
            choose: picks the way on where there are several; the straightest by default.

        Returns:
            The point reached, the direction there (for negative distances that of the reverse movement turned back), and
            the distance left over at the end of the road.
        """
        choose = choose or self._traveller.straightest
        if distance >= 0.0:
            return self._traveller.travel(point, distance, forward, choose)
        point, backward, left = self._traveller.travel(point, -distance, not forward, choose)
        return Travel(point, not backward, left)

    def straightest(self, point: RoadPoint, forward: bool, links: Sequence[LaneLink]) -> LaneLink | None:
        """The default choice at junctions: the way on that turns least."""
        return self._traveller.straightest(point, forward, links)

    def route(self, waypoints: Sequence[RoadPoint], strategies: Sequence[str] = (), rng: Random | None = None) -> RoadPath | None:
        """A route through two or more waypoints; None where no way leads from one to the next.

        Args:
            strategies: how to get from each waypoint to the next: "shortest" (also where none is given), "fastest",
                "leastIntersections" or "random", as in the standard's RouteStrategy.
            rng: source of the random routes.
        """
        missing = len(waypoints) - 1 - len(strategies)
        return self._router.route(waypoints, [*strategies, *["shortest"] * missing], rng)

    def relative(self, origin: RoadPoint, target: RoadPoint, strategy: str = "shortest") -> Relative | None:
        """Where a point lies as seen from another in road coordinates; None where no way connects them.

        Args:
            strategy: "shortest", "fastest" or "leastIntersections", as in the standard's RoutingAlgorithm.
        """
        return self._relations.in_road(origin, target, strategy)

    def relative_in_lane(self, origin: RoadPoint, target: RoadPoint, strategy: str = "shortest") -> Relative | None:
        """Like `relative`, in lane coordinates: along the centre of the origin's lane, which goes on by lane links.

        ds is then a length on that lane, dt the difference of the distances from its centre, and lanes counts from it.
        """
        return self._relations.in_lane(origin, target, strategy)


def _listed(names: Mapping[str, object]) -> str:
    shown = list(names)[:8]
    return ", ".join(shown) + (", …" if len(names) > len(shown) else "")
