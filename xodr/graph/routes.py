"""Routes by the standard's strategies (shortest, fastest, leastIntersections, random), and relative
positions along the roads."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from heapq import heappop, heappush
from itertools import pairwise
from random import Random
from typing import NamedTuple

from xodr.graph.lane_plan import Checkpoint, LanePlan, Leg, checkpoint
from xodr.graph.links import LinkTable
from xodr.graph.travel import Choose, Traveller
from xodr.graph.ways import PRICES, Cost, Price, Step, Way, Ways, add
from xodr.model import LaneLink, RoadPoint
from xodr.model.road import Road


class RoadPath:
    """A route: roads one after the other, with positions on it measured in s from its beginning.

    Attributes:
        legs: the roads in order. A road can occur more than once.
        length: length [m] in s.
        lanes: the lanes to take; None where it is not a way of traffic.
    """

    def __init__(
        self, legs: Sequence[Leg], otherwise: Choose, lanes: LanePlan | None = None
    ) -> None:
        self.legs, self.lanes = tuple(legs), lanes
        self.length = self.legs[-1].before + self.legs[-1].length
        self._befores = [leg.before for leg in self.legs]
        self._on: dict[str, list[Leg]] = {}
        """the legs on each road"""
        for leg in self.legs:
            self._on.setdefault(leg.road_id, []).append(leg)
        self._otherwise = otherwise

    def leg_at(self, distance: float) -> Leg:
        """The leg at a distance [m] from the route's beginning; the first or last one outside."""
        return self.legs[max(bisect_right(self._befores, distance) - 1, 0)]

    def at(self, distance: float) -> tuple[str, float, bool]:
        """Road id, s and direction of travel at a distance [m] from the route's beginning, kept
        within the route."""
        distance = min(max(distance, 0.0), self.length)
        leg = self.leg_at(distance)
        gone = distance - leg.before
        return leg.road_id, leg.enter + (gone if leg.forward else -gone), leg.forward

    def position(self, point: RoadPoint, near: float = 0.0) -> float | None:
        """Distance [m] of a road point from the route's beginning, None where its road is not part
        of the route.

        On the first and last road the point may lie before the beginning (negative) or beyond the
        end.

        Args:
            near: where the point is expected; decides on routes that use a road more than once.
        """
        nearest = None
        for leg in self._on.get(point.road_id, ()):
            distance = leg.before + (point.s - leg.enter if leg.forward else leg.enter - point.s)
            if nearest is None or abs(distance - near) < abs(nearest - near):
                nearest = distance
        return nearest

    def choose(self, point: RoadPoint, forward: bool, links: Sequence[LaneLink]) -> LaneLink | None:
        """The lane that goes on along the route, for `RoadNetwork.travel`; the straightest where
        the route does not help."""
        for index, leg in enumerate(self.legs[:-1]):
            if (leg.road_id, leg.forward) == (point.road_id, forward) and not leg.passes(
                point, links
            ):
                link = self.onward(index + 1, links)
                if link is not None:
                    return link
        return self._otherwise(point, forward, links)

    def onward(self, index: int, links: Sequence[LaneLink]) -> LaneLink | None:
        """The lane that leads onto a leg, of several the one from which the lanes to come need the
        fewest changes; None without one."""
        following, lanes = self.legs[index], self.lanes
        onwards = [link for link in links if (link.road_id, link.at_start) == following[:2]]
        if lanes is not None:
            ways = [(link, Way(link.road_id, link.at_start)) for link in links]
            onwards += [link for link, way in ways if lanes.parallel.get(way) == index]
        if not onwards:
            return None
        leading = [link for link in onwards if link.lane_id in following.exit_lanes] or onwards
        if lanes is None:
            return leading[0]
        return min(
            [*leading, *onwards],
            key=lambda link: lanes.cost(index, link.lane_id, Way(link.road_id, link.at_start)),
        )


Stretch = tuple[Way, float, float]
"""A way, and the s [m] where it is entered and left."""


class Router:
    """Finds routes on one road network."""

    def __init__(self, ways: Ways, links: LinkTable, otherwise: Choose) -> None:
        self._ways, self._links, self._otherwise = ways, links, otherwise

    def route(
        self, waypoints: Sequence[RoadPoint], strategies: Sequence[str], rng: Random | None
    ) -> RoadPath | None:
        """A route through the waypoints, strategies[i] leading from waypoint i to i + 1; None where
        no way leads there.

        Ways of traffic are taken where they suffice, else any way, also against the traffic
        (pedestrians).
        """
        # Two passes: only where traffic leads to no goal, ways against it count, and then for the
        # whole route.
        for driven in (True, False):
            found = self._stretches(waypoints, strategies, rng, driven)
            if found is None:
                continue
            stretches, checkpoints = found
            if not driven:
                return RoadPath(self._legs(stretches), self._otherwise)
            plan = self._plan(stretches, checkpoints)
            lane = waypoints[0].lane_id
            # A cost of 0 cannot get better.
            if 0.0 < plan.cost(0, lane) < math.inf:
                plan = self._through_junctions(stretches, checkpoints, lane, plan)
            return RoadPath(self._legs(stretches), self._otherwise, plan)
        return None

    def _plan(self, stretches: Sequence[Stretch], checkpoints: Sequence[Checkpoint]) -> LanePlan:
        parallel: dict[Way, int] = {}
        taken = {way for way, _, _ in stretches}
        for index in range(1, len(stretches) - 1):
            for way, _, _ in self._parallel(*stretches[index - 1 : index + 2]):
                if way not in taken:
                    parallel.setdefault(way, index)
        return LanePlan(self._ways, self._links, self._legs(stretches), checkpoints, parallel)

    def _through_junctions(
        self,
        stretches: list[Stretch],
        checkpoints: Sequence[Checkpoint],
        lane: int,
        plan: LanePlan,
    ) -> LanePlan:
        """Take the connecting roads that need the fewest lane changes, between the same roads;
        changes `stretches`."""
        for index in reversed(range(1, len(stretches) - 1)):
            kept = stretches[index]
            for other in self._parallel(*stretches[index - 1 : index + 2]):
                stretches[index] = other
                tried = self._plan(stretches, checkpoints)
                if tried.cost(0, lane) < plan.cost(0, lane):
                    plan, kept = tried, other
            stretches[index] = kept
        return plan

    def _parallel(self, before: Stretch, inside: Stretch, after: Stretch) -> list[Stretch]:
        """Other roads through a junction from one road to another."""
        roads, way = self._ways.roads, inside[0]
        junction = roads[way.road_id].junction_id
        # Of a chain of connecting roads, no single one can be exchanged.
        if junction is None or roads[after[0].road_id].junction_id == junction:
            return []
        parallel: list[Stretch] = []
        for step in self._ways.steps(before[0], driven=True):
            road = roads[step.following.road_id]
            leave = road.length if step.following.forward else 0.0
            onto = Step(leave, after[0], after[1])
            other = road.junction_id == junction and step.following != way
            through = onto in self._ways.steps(step.following, driven=True)
            if other and through and step.leave == before[2]:
                parallel.append((step.following, step.enter, leave))
        return parallel

    def _stretches(
        self,
        waypoints: Sequence[RoadPoint],
        strategies: Sequence[str],
        rng: Random | None,
        driven: bool,
    ) -> tuple[list[Stretch], list[Checkpoint]] | None:
        """The ways of a route with the s where each is entered and left, and its waypoints; None
        where no way leads there."""
        stretches: list[Stretch] = []
        checkpoints: list[Checkpoint] = []
        for (origin, target), strategy in zip(pairwise(waypoints), strategies, strict=True):
            # A random route without a source of chance is the same every time.
            price = PRICES[strategy] if strategy != "random" else _random_price(rng or Random(0))
            # A route does not turn round at a waypoint.
            heading = stretches[-1][0].forward if stretches else None
            found = self._search(origin, target, heading, price, driven)
            if found is None:
                return None
            for way, enter, leave in found:
                # A waypoint amid a road does not end its leg.
                if stretches and stretches[-1][0] == way and stretches[-1][2] == enter:
                    enter = stretches.pop()[1]
                stretches.append((way, enter, leave))
            number, leg = len(checkpoints) + 1, len(stretches) - 1
            road = self._ways.roads[target.road_id]
            checkpoints.append(checkpoint(road, number, leg, target))
        return stretches, checkpoints

    def _legs(self, stretches: Sequence[Stretch]) -> list[Leg]:
        legs: list[Leg] = []
        before = 0.0
        for index, (way, enter, leave) in enumerate(stretches):
            lanes: tuple[int, ...] = ()
            if index + 1 < len(stretches):
                lanes = self._ways.lanes_towards(way, Step(leave, *stretches[index + 1][:2]))
            legs.append(Leg(*way, enter, leave, before, lanes))
            before += legs[-1].length
        return legs

    def _search(
        self, origin: RoadPoint, target: RoadPoint, heading: bool | None, price: Price, driven: bool
    ) -> list[tuple[Way, float, float]] | None:
        """Dijkstra's algorithm from one point to another: ways with the s at which each is entered
        and left."""
        roads = self._ways.roads
        directions = self._directions(origin, driven) if heading is None else (heading,)
        arrivals = self._directions(target, driven)
        # trail: each entry is (step onto a way, index of the entry before); an index beyond it
        # marks a finished route
        trail = [
            (Step(origin.s, Way(origin.road_id, forward), origin.s), -1) for forward in directions
        ]
        queue: list[tuple[Cost, int, bool]] = [
            ((0.0, 0.0), index, False) for index in range(len(trail))
        ]
        seen: set[tuple[Way, float]] = set()
        while queue:
            cost, index, finished = heappop(queue)
            (_, way, enter), before = trail[index]
            if finished:
                return self._unwind(trail, index, target.s)
            # The first stretch is never marked: a ring may lead back to its way, to a goal behind
            # the start.
            if before >= 0 and (way, enter) in seen:
                continue
            if before >= 0:
                seen.add((way, enter))
            road = roads[way.road_id]
            ahead = _ahead(way, enter, target.s)
            # Pushed, not returned: another way may reach the goal cheaper.
            if way.road_id == target.road_id and way.forward in arrivals and ahead >= 0.0:
                heappush(queue, (add(cost, price(road, ahead)), index, True))
            for step in self._ways.steps(way, driven):
                ahead = _ahead(way, enter, step.leave)
                if ahead >= 0.0:
                    trail.append((step, index))
                    heappush(queue, (add(cost, price(road, ahead)), len(trail) - 1, False))
        return None

    def _unwind(
        self, trail: Sequence[tuple[Step, int]], index: int, leave: float
    ) -> list[tuple[Way, float, float]]:
        stretches: list[tuple[Way, float, float]] = []
        while index >= 0:
            step, index = trail[index]
            stretches.append((step.following, step.enter, leave))
            leave = step.leave
        return stretches[::-1]

    def _directions(self, point: RoadPoint, driven: bool) -> tuple[bool, ...]:
        """Directions of travel that a point's lane allows; both where it is the centre lane or
        traffic does not count."""
        road = self._ways.roads[point.road_id]
        if (
            not driven
            or point.lane_id == 0
            or road.lane(point.s, point.lane_id).direction == "both"
        ):
            return (True, False)
        return (road.direction(point.lane_id, point.s) > 0,)


def _ahead(way: Way, s: float, other: float) -> float:
    """Return the distance (m) to another s ahead on a way; negative behind."""
    return other - s if way.forward else s - other


def _random_price(rng: Random) -> Price:
    """Price of random routes: every road's length counts by a factor of its own."""
    factors: dict[str, float] = {}

    def price(road: Road, length: float) -> Cost:
        if road.id not in factors:
            # Drawn once for each road, so that a route's price does not change during the search.
            factors[road.id] = rng.expovariate(1.0)
        return factors[road.id] * length, length

    return price


# relative positions -----------------------------------------------------------------------------


class Relative(NamedTuple):
    """Position of a point relative to another one, in the road or lane coordinates of the other.

    ds: [m] along the roads or the lane, positive towards +s. dt: [m], positive towards +t. lanes:
    number of lanes from one to the other, positive towards +t, the centre lane not counted.
    aligned: whether +s means the same direction at both.
    """

    ds: float
    dt: float
    lanes: int
    aligned: bool


class _Connection(NamedTuple):
    """Connection of two points over ends of roads: length (m) in s, first and last way."""

    cost: Cost
    length: float
    leaving: Way
    arriving: Way

    @property
    def aligned(self) -> bool:
        """Whether +s means the same direction of travel on both roads."""
        return self.leaving.forward == self.arriving.forward


class RoadRelations:
    """Relates points on one road network."""

    def __init__(self, ways: Ways, traveller: Traveller) -> None:
        self._ways, self._traveller = ways, traveller

    def in_road(self, origin: RoadPoint, target: RoadPoint, strategy: str) -> Relative | None:
        """Position of a target in the road coordinates of an origin; None where no way leads from
        one to the other."""
        same = origin.road_id == target.road_id
        found = (self._around if same else self._connection)(origin, target, strategy)
        if found is None and same:
            return _relative(target.s - origin.s, origin.t, origin.lane_id, target, target.t, True)
        if found is None:
            return None
        ds = found.length if found.leaving.forward else -found.length
        # On a road laid the other way round, lanes of the same place have the opposite sign.
        lane_id = origin.lane_id if found.aligned else -origin.lane_id
        return _relative(ds, origin.t, lane_id, target, target.t, found.aligned)

    def in_lane(self, origin: RoadPoint, target: RoadPoint, strategy: str) -> Relative | None:
        """Position of a target in the lane coordinates of an origin: along the origin's lane, which
        goes on by lane links."""
        road = self._ways.roads[origin.road_id]
        lane_id, sign, length, start, aligned = (
            origin.lane_id,
            1.0 if target.s >= origin.s else -1.0,
            0.0,
            origin.s,
            True,
        )
        same = origin.road_id == target.road_id
        found = (self._around if same else self._connection)(origin, target, strategy)
        if found is None and not same:
            return None
        if found is not None:
            sign, aligned = (1.0 if found.leaving.forward else -1.0), found.aligned
            for way, following in pairwise(
                [found.leaving, *self._between(found, strategy), found.arriving]
            ):
                gone, lane_id = self._traveller.length(
                    road, lane_id, start, road.length if way.forward else 0.0
                )
                length += gone
                lane_id = self._ways.lane_after(way, lane_id, following)
                road = self._ways.roads[following.road_id]
                start = 0.0 if following.forward else road.length
        gone, lane_id = self._traveller.length(road, lane_id, start, target.s)
        aside = target.t - road.lane_t(target.s, lane_id)
        return _relative(sign * (length + gone), origin.offset, lane_id, target, aside, aligned)

    def _connection(
        self, origin: RoadPoint, target: RoadPoint, strategy: str
    ) -> _Connection | None:
        """Cheapest connection of two points on different roads, over any ends of both."""
        start, end = self._ways.roads[origin.road_id], self._ways.roads[target.road_id]
        price = PRICES[strategy]
        best: _Connection | None = None
        for leaving in (Way(start.id, True), Way(start.id, False)):
            first = start.length - origin.s if leaving.forward else origin.s
            reached = self._ways.reach(leaving, strategy)
            for arriving in (Way(end.id, True), Way(end.id, False)):
                between = reached.get(arriving)
                if between is None:
                    continue
                last = target.s if arriving.forward else end.length - target.s
                cost = add(add(between.cost, price(start, first)), price(end, last))
                if best is None or cost < best.cost:
                    best = _Connection(cost, first + between.length + last, leaving, arriving)
        return best

    def _around(self, origin: RoadPoint, target: RoadPoint, strategy: str) -> _Connection | None:
        """The connection of two points on one road over its ends and back to it; None where the
        road itself is shorter."""
        road, apart = self._ways.roads[origin.road_id], target.s - origin.s
        # The way round is at least the rest of the road, so it can be shorter only above half of
        # it; it needs both ends.
        if 2.0 * abs(apart) <= road.length or not (road.successor and road.predecessor):
            return None
        way = Way(road.id, apart < 0.0)
        between = self._ways.reach(way, strategy).get(way)
        if between is None or between.length + road.length >= 2.0 * abs(apart):
            return None
        return _Connection(between.cost, between.length + road.length - abs(apart), way, way)

    def _between(self, connection: _Connection, strategy: str) -> list[Way]:
        """The ways between the first and the last one of a connection."""
        reached = self._ways.reach(connection.leaving, strategy)
        ways: list[Way] = []
        way = reached[connection.arriving].before
        while way is not None:
            ways.append(way)
            way = reached[way].before
        return ways[::-1]


def lanes_between(lane_id: int, other: int) -> int:
    """Number of lanes from one to the other, positive towards +t; the centre
    lane 0 is not counted.
    """
    return _rank(other) - _rank(lane_id)


def _rank(lane_id: int) -> int:
    # Left lanes close up to the right ones, as if there were no lane 0.
    return lane_id - 1 if lane_id > 0 else lane_id


def _relative(
    ds: float, origin_t: float, lane_id: int, target: RoadPoint, target_t: float, aligned: bool
) -> Relative:
    """Convert a place from the target road's frame to the origin's; `lane_id` is the origin's lane
    as it goes on there."""
    # Opposite roads count t and lanes the other way.
    sign = 1 if aligned else -1
    return Relative(
        ds, sign * target_t - origin_t, sign * lanes_between(lane_id, target.lane_id), aligned
    )
