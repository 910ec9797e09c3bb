"""Graph of a road network: order of its roads in each direction, and the distances between them.

A way is a road in one direction of travel. One way follows another where any lane leads over;
changing lanes on a road is free. There are two graphs: of the ways that traffic drives, and of all
ways (for distances, and for pedestrians).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from heapq import heappop, heappush
from itertools import count
from typing import NamedTuple, TypeVar

from xodr.graph.links import LinkTable, SideTable
from xodr.model import LaneLink
from xodr.model.road import Road

T = TypeVar("T")

DRIVABLE = frozenset(
    {
        *(
            "driving",
            "entry",
            "exit",
            "onRamp",
            "offRamp",
            "connectingRamp",
            "slipLane",
            "shared",
            "restricted",
            "stop",
        ),
        *(
            "bidirectional",
            "bus",
            "taxi",
            "HOV",
            "mwyEntry",
            "mwyExit",
            "roadWorks",
            "special1",
            "special2",
            "special3",
        ),
        "parking",
    }
)
"""Lane types on which vehicles travel (OpenDRIVE 1.8, annex D.1, without borders, with parking and
the types of 1.4)."""

USUAL_SPEED = 50.0 / 3.6
"""Speed [m/s] taken for roads without a limit where the fastest route is wanted."""


class Way(NamedTuple):
    """A road travelled towards +s (forward) or −s."""

    road_id: str
    forward: bool


class Step(NamedTuple):
    """Transition between ways: s at which the first is left and s at which the next is entered,
    usually at the ends of roads."""

    leave: float
    following: Way
    enter: float


Cost = tuple[float, float]
"""Cost of a stretch of road: the quantity to minimise, and a second one for ties."""

Price = Callable[[Road, float], Cost]
"""Cost of travelling a length [m] on a road."""


class Reached(NamedTuple):
    """Way that can be reached: cost and length (m) up to its start, and its predecessor (None: the
    first way)."""

    cost: Cost
    length: float
    before: Way | None


class Ways:
    """Neighbourhood and distances of the ways of one road network."""

    def __init__(self, roads: Mapping[str, Road], links: LinkTable, sides: SideTable) -> None:
        self.roads, self._links = roads, links
        # Two graphs: steps that traffic takes, and all steps, for pedestrians.
        self._steps: dict[bool, dict[Way, dict[Step, tuple[int, ...]]]] = {True: {}, False: {}}
        self._reach: dict[tuple[Way, str], dict[Way, Reached]] = {}
        for (road_id, lane_id, forward), reached in links.items():
            way = Way(road_id, forward)
            for link in reached:
                self._add_step(way, lane_id, self._end(way), link)
        for (road_id, lane_id, forward, s), reached in sides.items():
            for link in reached:
                self._add_step(Way(road_id, forward), lane_id, s, link)

    def _add_step(self, way: Way, lane_id: int, leave: float, link: LaneLink) -> None:
        following = Way(link.road_id, link.at_start)
        step = Step(
            leave, following, self._end(following, entering=True) if link.s is None else link.s
        )
        _add(self._steps[False], way, step, lane_id)
        if self.drives(way, lane_id, leave) and self.drives(following, link.lane_id, step.enter):
            _add(self._steps[True], way, step, lane_id)

    def steps(self, way: Way, driven: bool) -> dict[Step, tuple[int, ...]]:
        """The ways that follow, each with the lanes that lead there; with `driven` only where
        traffic drives so."""
        return self._steps[driven].get(way, {})

    def following(self, way: Way) -> dict[Way, tuple[int, ...]]:
        """The ways that follow where a road ends, each with the lanes that lead
        to its beginning.
        """
        end = self._end(way)
        found = self.steps(way, driven=False).items()
        return {
            step.following: lanes
            for step, lanes in found
            if step.leave == end and step.enter == self._end(step.following, entering=True)
        }

    def reach(self, way: Way, strategy: str) -> dict[Way, Reached]:
        """Every way that can be reached from the end of a way, with cost and length from there to
        its beginning.

        Roads are left and entered at their ends only.
        """
        found = self._reach.get((way, strategy))
        # The spread over all ways is the same for every point on a road.
        if found is None:
            found = self._reach[way, strategy] = self._spread(way, PRICES[strategy])
        return found

    def _spread(self, way: Way, price: Price) -> dict[Way, Reached]:
        """Dijkstra's algorithm over all ways."""
        done: dict[Way, Reached] = {}
        # Ties of cost are broken by the order of discovery, so that routes are the same in every
        # run.
        number = count()
        queue: list[tuple[Cost, int, float, Way, Way | None]] = [
            ((0.0, 0.0), next(number), 0.0, following, None) for following in self.following(way)
        ]
        while queue:
            cost, _, length, current, before = heappop(queue)
            if current in done:
                continue
            done[current] = Reached(cost, length, before)
            road = self.roads[current.road_id]
            more = add(cost, price(road, road.length))
            for following in self.following(current):
                if following not in done:
                    heappush(queue, (more, next(number), length + road.length, following, current))
        return done

    def _end(self, way: Way, entering: bool = False) -> float:
        """The s at which a way ends; with `entering` that at which it begins."""
        return self.roads[way.road_id].length if way.forward != entering else 0.0

    def drives(self, way: Way, lane_id: int, s: float) -> bool:
        """Whether the lane is one of traffic in the way's direction at s."""
        road = self.roads[way.road_id]
        lane = road.lane(s, lane_id)
        return (
            lane.type in DRIVABLE
            and not lane.road_works
            and (lane.direction == "both" or (road.direction(lane_id, s) > 0) == way.forward)
        )

    def lanes_towards(self, way: Way, step: Step) -> tuple[int, ...]:
        """Lanes on a way that lead on by a step: those of its traffic, or any
        where there are none.
        """
        return self.steps(way, True).get(step) or self.steps(way, False).get(step, ())

    def lane_after(self, way: Way, lane_id: int, following: Way) -> int:
        """The lane on the following way that a lane leads to; where it leads elsewhere, that of the
        nearest lane that does."""
        lanes = self.following(way)[following]
        # The nearest by number stands for the nearest by place.
        leading = min(lanes, key=lambda lane: abs(lane - lane_id))
        links = self._links[way.road_id, leading, way.forward]
        return next(link.lane_id for link in links if (link.road_id, link.at_start) == following)


def add(one: Cost, other: Cost) -> Cost:
    """Sum of two costs."""
    return one[0] + other[0], one[1] + other[1]


def _add(graph: dict[Way, dict[T, tuple[int, ...]]], way: Way, following: T, lane_id: int) -> None:
    lanes = graph.setdefault(way, {})
    lanes[following] = (*lanes.get(following, ()), lane_id)


def _fastest(road: Road, length: float) -> Cost:
    # The limit at the start of a road stands for all of it.
    return length / (road.speed_limit(0.0) or USUAL_SPEED), length


PRICES: dict[str, Price] = {
    "shortest": lambda _, length: (length, 0.0),
    "fastest": _fastest,
    "leastIntersections": lambda road, length: (1.0 if road.junction_id else 0.0, length),
}
"""Cost by the standard's name of the routing strategy."""
