"""Relative position of two points along the roads, in road or lane coordinates of OpenSCENARIO.

Road coordinates measure along the reference lines and across them; lane coordinates along the centre of the origin's lane,
which goes on by lane links, and across from there.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

from xodr.graph.travel import Traveller
from xodr.graph.ways import PRICES, Cost, Way, Ways, add
from xodr.model import RoadPoint


class Relative(NamedTuple):
    """Position of a point relative to another one, in the road or lane coordinates of the other.

    ds: [m] along the roads or the lane, positive towards +s. dt: [m], positive towards +t. lanes: number of lanes from one
    to the other, positive towards +t, the centre lane not counted. aligned: whether +s means the same direction at both.
    """

    ds: float
    dt: float
    lanes: int
    aligned: bool


class _Connection(NamedTuple):
    """Connection of two points on different roads: length (m) in s, first and last way."""

    cost: Cost
    length: float
    leaving: Way
    arriving: Way

    @property
    def aligned(self) -> bool:
        """Whether +s means the same direction of travel on both roads."""
        return self.leaving.forward == self.arriving.forward


class Relations:
    """Relates points on one road network."""

    def __init__(self, ways: Ways, traveller: Traveller) -> None:
        self._ways, self._traveller = ways, traveller

    def in_road(self, origin: RoadPoint, target: RoadPoint, strategy: str) -> Relative | None:
        """Position of a target in the road coordinates of an origin; None where no way leads from one to the other."""
        if origin.road_id == target.road_id:
            return _relative(target.s - origin.s, origin.t, origin.lane_id, target, target.t, True)
        found = self._connection(origin, target, strategy)
        if found is None:
            return None
        ds = found.length if found.leaving.forward else -found.length
        lane_id = origin.lane_id if found.aligned else -origin.lane_id
        return _relative(ds, origin.t, lane_id, target, target.t, found.aligned)

    def in_lane(self, origin: RoadPoint, target: RoadPoint, strategy: str) -> Relative | None:
        """Position of a target in the lane coordinates of an origin: along the origin's lane, which goes on by lane links."""
        road = self._ways.roads[origin.road_id]
        lane_id, sign, length, start, aligned = origin.lane_id, 1.0 if target.s >= origin.s else -1.0, 0.0, origin.s, True
        if origin.road_id != target.road_id:
            found = self._connection(origin, target, strategy)
            if found is None:
                return None
            sign, aligned = (1.0 if found.leaving.forward else -1.0), found.aligned
            for way, following in pairwise([found.leaving, *self._between(found, strategy), found.arriving]):
                gone, lane_id = self._traveller.length(road, lane_id, start, road.length if way.forward else 0.0)
                length += gone
                lane_id = self._ways.lane_after(way, lane_id, following)
                road = self._ways.roads[following.road_id]
                start = 0.0 if following.forward else road.length
        gone, lane_id = self._traveller.length(road, lane_id, start, target.s)
        aside = target.t - road.lane_t(target.s, lane_id)
        return _relative(sign * (length + gone), origin.offset, lane_id, target, aside, aligned)

    def _connection(self, origin: RoadPoint, target: RoadPoint, strategy: str) -> _Connection | None:
        """The cheapest connection of two points on different roads, whatever end of their roads it uses."""
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
    """Number of lanes from one to the other, positive towards +t; the centre lane 0 is not counted."""
    return _rank(other) - _rank(lane_id)


def _rank(lane_id: int) -> int:
    return lane_id - 1 if lane_id > 0 else lane_id


def _relative(ds: float, origin_t: float, lane_id: int, target: RoadPoint, target_t: float, aligned: bool) -> Relative:
    """From the target road's frame to the origin's; `lane_id` is the origin's lane as it goes on there."""
    sign = 1 if aligned else -1
    return Relative(ds, sign * target_t - origin_t, sign * lanes_between(lane_id, target.lane_id), aligned)
