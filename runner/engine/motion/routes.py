"""Routes: waypoints joined through the road network, and the choice at junctions that follows from
them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

from runner.engine.compile.element import Position
from xodr.graph.ways import Way
from xosc.document.node import Node

if TYPE_CHECKING:
    from random import Random

    from runner.engine.compile.protocols import Surroundings
    from runner.engine.compile.registry import Context
    from runner.engine.participants.entity import Entity
    from xodr.graph.lane_plan import Checkpoint, LaneCell, Leg
    from xodr.graph.network import RoadNetwork
    from xodr.graph.routes import RoadPath
    from xodr.model import LaneLink, RoadPoint

STRATEGIES = ("shortest", "fastest", "leastIntersections", "random")
"""Values of RouteStrategy."""


class Waypoint(NamedTuple):
    """A place to pass, and the strategy of the way to it."""

    position: Position
    strategy: str
    node: Node


class Route:
    """A Route of the standard.

    Attributes:
        name: its name.
        closed: whether the last waypoint leads back to the first.
        fixed: whether it is the same throughout every run.
    """

    def __init__(
        self, node: Node, network: RoadNetwork, waypoints: Sequence[Waypoint], closed: bool
    ) -> None:
        self.node, self.network, self.closed = node, network, closed
        self.name: str = node.get("name", "")
        self.waypoints = waypoints
        # A random way is drawn by each run from its own seed.
        self.fixed = all(w.position.fixed is not None and w.strategy != "random" for w in waypoints)
        self._path: RoadPath | None = None

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> Route:
        """Read the waypoints; a route of fixed waypoints is found, or complained about, here."""
        network = context.need_network(node)
        waypoints = [
            Waypoint(
                context.position(child.need("Position")),
                child.choice("routeStrategy", STRATEGIES),
                child,
            )
            for child in node.children("Waypoint")
        ]
        if len(waypoints) < 2:
            raise node.invalid("a route needs two waypoints or more")
        route = cls(node, network, waypoints, node.bool("closed"))
        # Found while compiling, so that a route that leads nowhere is an error of the file, not of
        # a run.
        if route.fixed:
            route.path(None)
        return route

    def references(self) -> tuple[Entity, ...]:
        """Entities that the waypoints refer to."""
        return tuple(
            entity for waypoint in self.waypoints for entity in waypoint.position.references()
        )

    def path(self, run: Surroundings | None, actor: Entity | None = None) -> RoadPath:
        """The way through the road network.

        Raises:
            InvalidFile: a waypoint is not on a road, or no way leads to it.
        """
        if self._path is not None:
            return self._path
        waypoints = [*self.waypoints, self.waypoints[0]] if self.closed else self.waypoints
        points = [_road_point(w.position, self.network, run, actor) for w in waypoints]
        path = self.network.route(
            points, [w.strategy for w in waypoints[1:]], run.random if run is not None else None
        )
        if path is None:
            raise self._unreachable(waypoints, points)
        if self.fixed:
            self._path = path
        return path

    def _unreachable(self, waypoints: Sequence[Waypoint], points: Sequence[RoadPoint]) -> Exception:
        for (_, waypoint), pair in zip(pairwise(waypoints), pairwise(points), strict=True):
            # A pair without a way is named; if each pair has one, only all legs together contradict
            # each other.
            if self.network.route(pair) is None:
                here, there = (f"road {p.road_id!r} lane {p.lane_id} s={p.s:.1f}" for p in pair)
                return waypoint.node.invalid(f"no way leads from {here} to {there}")
        return self.node.invalid(f"no way leads along all waypoints of the route {self.name!r}")


def _road_point(
    position: Position, network: RoadNetwork, run: Surroundings | None, actor: Entity | None
) -> RoadPoint:
    placement = position.resolve(run, actor)
    return placement.point or network.locate(placement.x, placement.y, placement.z, placement.h)


def _beginning(network: RoadNetwork, leg: Leg) -> RoadPoint:
    """Return the start of a leg of a route, on a lane in the direction of travel
    if there is one.
    """
    road = network.road(leg.road_id)
    lanes = road.lane_ids(leg.enter)
    # The lane next to the reference line of those with the traffic, or of all on a road against it.
    along = [lane for lane in lanes if (road.direction(lane, leg.enter) > 0) == leg.forward]
    return road.lane_point(leg.enter, min(along or lanes, key=abs))


class AssignedRoute:
    """Following a route: at junctions its roads; off the route the shortest way to it, once through
    it the straightest.

    A route can use a road more than once, so it is remembered which of its legs the entity is on.

    Args:
        path: the way through the road network.
        closed: whether it starts again at its end.
        network: where ways to the route are looked for; without it an entity off its route takes
            the straightest way.
        say: called with what can't be followed, a sentence without its subject.
        obstructed: whether another participant is in the way of an entity to a lane, for a change
            along a way (m); by default none is.

    Attributes:
        released: whether an action has put the entity into a lane since: from then on it changes
            lanes only where its own does not lead on.
        reached: whether an action that waits for its end has seen it there, and says itself in
            which lane.
    """

    def __init__(
        self,
        path: RoadPath,
        closed: bool = False,
        network: RoadNetwork | None = None,
        say: Callable[[str], object] = lambda text: None,
        obstructed: Callable[[Entity, int, float], bool] = lambda entity, lane, way: False,
    ) -> None:
        self.path, self.closed, self.network = path, closed, network
        self.released = self.reached = False
        self._say, self._left = say, False
        self._obstructed = obstructed
        self._cell: LaneCell | None = None
        self._known: tuple[str, bool, int, bool] | None = None
        """road, direction, lane and release for which the present lane is known to be right up to
        the end of the cell"""
        self._beyond: tuple[tuple[str, bool], float] | None = None
        """road and direction that the plan says nothing of, and the s from which on it does not"""
        self._leg = 0
        self._back: RoadPath | None = None
        self._through = False

    def choose(self, point: RoadPoint, forward: bool, links: Sequence[LaneLink]) -> LaneLink | None:
        """The lane that goes on along the route, if possible one that leads on to the leg after."""
        index = self._find(point.road_id, forward)
        following = self._following(index) if index is not None else None
        # Ways branch off between the ends of this road, and the leg goes past them.
        if index is not None and self.path.legs[index].passes(point, links):
            return links[0]
        if following is not None:
            self._back = None
            link = self.path.onward(following, links)
            if link is not None:
                return link
        # At the end of the last leg the route is done: from there on it looks for no way back.
        self._through = self._through or (following is None and index == self._leg)
        way = self._way_back(point, forward) if following is None else None
        return (way or self.path).choose(point, forward, links)

    def foresee(
        self, point: RoadPoint, forward: bool, links: Sequence[LaneLink]
    ) -> LaneLink | None:
        """The lane that `choose` gives, without remembering anything."""
        kept = self._through, self._back
        link = self.choose(point, forward, links)
        self._through, self._back = kept
        return link

    def _way_back(self, point: RoadPoint, forward: bool) -> RoadPath | None:
        """The shortest way from a road's end to one of the legs that are left."""
        if self.network is None or self._through:
            return None
        known = self._back.legs if self._back is not None else ()
        # A way back is kept while the entity is on it, and found anew when it leaves that too.
        if not any(leg[:2] == (point.road_id, forward) for leg in known):
            starts = dict.fromkeys(
                _beginning(self.network, leg) for leg in self.path.legs[self._leg :]
            )
            ways = [
                way for there in starts if (way := self.network.route([point, there])) is not None
            ]
            self._back = min(ways, key=lambda way: way.length) if ways else None
        return self._back

    def leads(self, road_id: str, forward: bool, links: Sequence[LaneLink]) -> bool:
        """Whether a lane reached is on the next leg."""
        index = self._find(road_id, forward)
        following = self._following(index) if index is not None else None
        return following is not None and self.path.onward(following, links) is not None

    def enter(self, road_id: str, forward: bool) -> None:
        """Remember the leg, and say once where the route is left."""
        index, self._beyond = self._find(road_id, forward), None
        if index is not None:
            self._leg = index
        elif not (self._left or self._through):
            self._left = True
            self._say(f"leaves its route and comes to road {road_id}")

    def lane(self, entity: Entity, forward: bool) -> tuple[int, float]:
        """The lane to be in, and the way (m) that is left for a change; says where a waypoint was
        passed in another lane."""
        road, s, lane, plan = entity.road, entity.s, entity.kept_lane, self.path.lanes
        if plan is None or road is None:
            return lane, math.inf
        now, cell = (road.id, forward, lane, self.released), self._cell
        # Most steps end here: road, direction, lane and cell are those of the step before.
        if now == self._known and cell is not None and (s < cell.end if forward else s > cell.end):
            return lane, math.inf
        if cell is None and self._beyond is not None:
            where, since = self._beyond
            # The plan is known to say nothing from there on.
            if where == now[:2] and (s >= since if forward else s <= since):
                return lane, math.inf
        index = self._find(road.id, forward)
        on = index is not None and self.path.legs[index].road_id == road.id
        found = plan.cell(index, s) if index is not None and on else None
        # The cell before is behind: was its waypoint passed in the lane that it asked for?
        if found is not cell:
            self._pass(cell, entity, road.id)
            self._cell = found
        if index is None or found is None:
            self._known = None
            self._beyond = (road.id, forward), s
            return lane, math.inf
        wanted = plan.lane(index, s, lane, self.released)
        self._known = now if wanted == lane else None
        return wanted, abs(found.end - s)

    def waits(self, entity: Entity, lane: int, way: float) -> bool:
        """Whether another participant is in the way."""
        return self._obstructed(entity, lane, way)

    def settled(self, entity: Entity, forward: bool) -> float:
        """The end of the cell in whose lane it is."""
        road, cell = entity.road, self._cell
        if self.path.lanes is None or road is None:
            return math.inf if forward else -math.inf
        now = (road.id, forward, entity.kept_lane, self.released)
        return entity.s if now != self._known or cell is None else cell.end

    def _pass(self, cell: LaneCell | None, entity: Entity, road_id: str) -> None:
        """Say that the waypoint at the end of a cell was passed in another lane."""
        asked = cell.checkpoint if cell is not None and not self.reached else None
        if asked is None or asked.lane is None or self.path.legs[asked.leg].road_id != road_id:
            return
        below, _ = entity.lane_below()
        if below != asked.lane:
            where = f"road {road_id} at s = {asked.s:.1f} m"
            self._say(
                f"passes waypoint {asked.number + 1} in lane {below}, not {asked.lane}, of {where}"
            )

    @property
    def destination(self) -> int | None:
        """The lane that the last waypoint asks for; None where it asks for none."""
        return self.path.lanes.destination if self.path.lanes is not None else None

    def missed(self, here: RoadPoint) -> Sequence[Checkpoint]:
        """The waypoints that are passed in another lane than theirs, from a place on."""
        legs, lanes = self.path.legs, self.path.lanes
        index = next((index for index, leg in enumerate(legs) if leg.road_id == here.road_id), None)
        return lanes.missed(index, here.s, here.lane_id) if lanes and index is not None else ()

    def distance(self, here: RoadPoint, there: RoadPoint) -> float | None:
        """Distance along the route."""
        start = self.path.position(here, self.path.legs[self._leg].before)
        end = self.path.position(there, start) if start is not None else None
        if start is None or end is None:
            return None
        return end - start + (self.path.length if self.closed and end < start else 0.0)

    def forward(self, here: RoadPoint) -> bool:
        """Whether the route goes towards +s at a point that is on it."""
        position = self.path.position(here, self.path.legs[self._leg].before)
        return self.path.at(position or 0.0)[2]

    def _find(self, road_id: str, forward: bool) -> int | None:
        """Index of the leg on a road, or in whose place the road is taken: the present one, the
        next one after it, or else one before."""
        legs, lanes = self.path.legs, self.path.lanes
        if lanes is not None and (road_id, forward) in lanes.parallel:
            return lanes.parallel[Way(road_id, forward)]
        # From the present leg on and round to it: a road used twice is the next use of it.
        ahead = (*range(self._leg, len(legs)), *range(self._leg))
        return next((index for index in ahead if legs[index][:2] == (road_id, forward)), None)

    def _following(self, index: int) -> int | None:
        """Index of the leg after another."""
        if index + 1 < len(self.path.legs):
            return index + 1
        # the last leg of a closed route ends where the first one began, on the same road
        return 1 if self.closed and len(self.path.legs) > 1 else None


class RandomRoute:
    """A way chosen at random at every junction.

    Args:
        rng: the run's source of random numbers.
    """

    released = False

    def __init__(self, rng: Random) -> None:
        self.rng = rng

    def choose(self, point: RoadPoint, forward: bool, links: Sequence[LaneLink]) -> LaneLink | None:
        """Choose one of the ways on at random."""
        return self.rng.choice(links) if links else None

    def foresee(
        self, point: RoadPoint, forward: bool, links: Sequence[LaneLink]
    ) -> LaneLink | None:
        """Return nothing: the way is chosen at the junction."""
        return None

    def lane(self, entity: Entity, forward: bool) -> tuple[int, float]:
        """Return the lane that it keeps, without a limit of distance."""
        return entity.kept_lane, math.inf

    def waits(self, entity: Entity, lane: int, way: float) -> bool:
        """Return false: it changes no lanes."""
        return False

    def settled(self, entity: Entity, forward: bool) -> float:
        """Return infinity in the direction of travel: no change of lanes is needed."""
        return math.inf if forward else -math.inf

    def leads(self, road_id: str, forward: bool, links: Sequence[LaneLink]) -> bool:
        """Return whether there is a way on, which any lane leads to."""
        return bool(links)

    def enter(self, road_id: str, forward: bool) -> None:
        """Do nothing: no route is kept."""

    def distance(self, here: RoadPoint, there: RoadPoint) -> float | None:
        """Unknown."""
        return None
