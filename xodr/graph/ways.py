"""The graph of a road network: which roads follow each other in which direction, and how far one is from another.

A way is a road in one direction of travel. One way follows another where any lane leads over; changing lanes on a road is
free. There are two graphs: of the ways that traffic drives, and of all ways (for distances, and for pedestrians).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from heapq import heappop, heappush
from itertools import count
from typing import NamedTuple

from xodr.graph.links import LinkTable
from xodr.road import Road

DRIVABLE = frozenset(
    {
        *("driving", "entry", "exit", "onRamp", "offRamp", "connectingRamp", "slipLane", "shared", "restricted", "stop"),
        *("bidirectional", "bus", "taxi", "HOV", "mwyEntry", "mwyExit", "roadWorks", "special1", "special2", "special3"),
        "parking",
    }
)
"""Lane types on which vehicles travel (OpenDRIVE 1.8, annex D.1, without borders, with parking and the types of 1.4)."""

USUAL_SPEED = 50.0 / 3.6
"""Speed [m/s] taken for roads without a limit where the fastest route is wanted."""


class Way(NamedTuple):
    """A road travelled towards +s (forward) or −s."""

    road_id: str
    forward: bool


Cost = tuple[float, float]
"""What a stretch of road costs: the quantity to be kept small, and a second one that decides between equals."""

Price = Callable[[Road, float], Cost]
"""Cost of travelling a length [m] on a road."""


class Reached(NamedTuple):
    """How a way can be reached: cost and length [m] up to its beginning, and the way before it (None: the first)."""

    cost: Cost
    length: float
    before: Way | None


class Ways:
    """Neighbourhood and distances of the ways of one road network."""

    def __init__(self, roads: Mapping[str, Road], links: LinkTable) -> None:
        self.roads, self._links = roads, links
        self._all: dict[Way, dict[Way, tuple[int, ...]]] = {}
        self._driven: dict[Way, dict[Way, tuple[int, ...]]] = {}
        self._reach: dict[tuple[Way, str], dict[Way, Reached]] = {}
        for (road_id, lane_id, forward), reached in links.items():
            way = Way(road_id, forward)
            for link in reached:
                following = Way(link.road_id, link.at_start)
                _add(self._all, way, following, lane_id)
                if self._drives(way, lane_id) and self._drives(following, link.lane_id, entering=True):
                    _add(self._driven, way, following, lane_id)

    def following(self, way: Way, driven: bool) -> dict[Way, tuple[int, ...]]:
        """The ways that follow, each with the lanes that lead there; with `driven` only where traffic drives so."""
        return (self._driven if driven else self._all).get(way, {})

    def reach(self, way: Way, strategy: str) -> dict[Way, Reached]:
        """Every way that can be reached from the end of a way, with cost and length from there to its beginning."""
        found = self._reach.get((way, strategy))
        if found is None:
            found = self._reach[way, strategy] = self._spread(way, PRICES[strategy])
        return found

    def _spread(self, way: Way, price: Price) -> dict[Way, Reached]:
        """Dijkstra's algorithm over all ways."""
        done: dict[Way, Reached] = {}
        number = count()
        queue: list[tuple[Cost, int, float, Way, Way | None]] = [
            ((0.0, 0.0), next(number), 0.0, following, None) for following in self.following(way, driven=False)
        ]
        while queue:
            cost, _, length, current, before = heappop(queue)
            if current in done:
                continue
            done[current] = Reached(cost, length, before)
            road = self.roads[current.road_id]
            more = add(cost, price(road, road.length))
            for following in self.following(current, driven=False):
                if following not in done:
                    heappush(queue, (more, next(number), length + road.length, following, current))
        return done

    def _drives(self, way: Way, lane_id: int, entering: bool = False) -> bool:
        """Whether the lane is one of traffic in the way's direction, at the way's end (or beginning, where entering)."""
        road = self.roads[way.road_id]
        s = road.length if way.forward != entering else 0.0
        lane = road.lane(s, lane_id)
        return lane.type in DRIVABLE and (lane.direction == "both" or (road.direction(lane_id, s) > 0) == way.forward)

    def lanes_towards(self, way: Way, following: Way) -> tuple[int, ...]:
        """Lanes at the end of a way that lead on to another: those of its traffic, or any where there are none."""
        return self.following(way, True).get(following) or self.following(way, False).get(following, ())

    def lane_after(self, way: Way, lane_id: int, following: Way) -> int:
        """The lane on the following way that a lane leads to; where it leads elsewhere, that of the nearest lane that does."""
        lanes = self.following(way, driven=False)[following]
        leading = min(lanes, key=lambda lane: abs(lane - lane_id))
        links = self._links[way.road_id, leading, way.forward]
        return next(link.lane_id for link in links if (link.road_id, link.at_start) == following)


def add(one: Cost, other: Cost) -> Cost:
    """Sum of two costs."""
    return one[0] + other[0], one[1] + other[1]


def _add(graph: dict[Way, dict[Way, tuple[int, ...]]], way: Way, following: Way, lane_id: int) -> None:
    lanes = graph.setdefault(way, {})
    lanes[following] = (*lanes.get(following, ()), lane_id)


def _fastest(road: Road, length: float) -> Cost:
    return length / (road.speed_limit(0.0) or USUAL_SPEED), length


PRICES: dict[str, Price] = {
    "shortest": lambda _, length: (length, 0.0),
    "fastest": _fastest,
    "leastIntersections": lambda road, length: (1.0 if road.junction_id else 0.0, length),
}
"""Cost by the standard's name of the routing strategy."""
