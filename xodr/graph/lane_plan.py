"""Lanes along a route: which to be in, and where to change, so that waypoints are passed in their
lanes with the fewest changes.

A route is cut into cells, one for each lane section and up to each waypoint. The cost of a lane at
the beginning of a cell is that of the cheapest way on: a lane change counts 1, a waypoint that is
passed in another lane 1000, and a lane that does not lead on is no way at all. Lanes are those of
traffic in the direction of travel. A change is possible outside junctions, between neighbours,
where the road mark between them does not forbid it (`laneChange`; both directions where it is not
given, as the standard says).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

from xodr.graph.links import LinkTable, next_lane
from xodr.graph.ways import Way, Ways
from xodr.model import NO_WIDTH, LaneLink, LaneSection, RoadPoint
from xodr.model.road import Road, lane_in

MISSED = 1000.0
"""Cost of a waypoint that is passed in another lane, in lane changes."""
_ON_BORDER = 1e-3
"""Distance [m] from a lane's border within which a waypoint asks for no lane."""


class Leg(NamedTuple):
    """One road of a route: from s = `enter` to s = `leave`; `before` is the route's length up to
    its beginning.

    exit_lanes: the lanes at the road's end that lead on to the next leg; empty on the last leg.
    """

    road_id: str
    forward: bool
    enter: float
    leave: float
    before: float
    exit_lanes: tuple[int, ...]

    @property
    def length(self) -> float:
        """Length [m] in s."""
        return abs(self.leave - self.enter)

    def passes(self, point: RoadPoint, links: Sequence[LaneLink]) -> bool:
        """Whether ways off the leg's road between its ends are offered, and the leg goes on past
        them."""
        return (
            bool(links)
            and (links[0].road_id, links[0].s) == (point.road_id, point.s)
            and self.leave != point.s
        )


class Checkpoint(NamedTuple):
    """A waypoint on a route: its number, the leg that it is on, its s, and the lane that it asks
    for, if it does."""

    number: int
    leg: int
    s: float
    lane: int | None


class LaneCell(NamedTuple):
    """A stretch of a leg within one lane section, from `begin` to `end` [m] in the direction of
    travel."""

    leg: int
    section: LaneSection
    begin: float
    end: float
    checkpoint: Checkpoint | None
    """waypoint at its end"""


def checkpoint(road: Road, number: int, leg: int, point: RoadPoint) -> Checkpoint:
    """A waypoint, with the lane below it; none where it lies on the border of lanes, or beside the
    road."""
    s = min(max(point.s, 0.0), road.length)
    # Close to a border, a measuring error would decide which lane is asked for.
    below = road.lane_at(s, point.t)
    inside = 0.5 * road.lane_width(s, below) - _ON_BORDER if below else 0.0
    asked = below if below and abs(point.t - road.lane_t(s, below)) <= inside else None
    return Checkpoint(number, leg, point.s, asked)


class LanePlan:
    """The lanes of one route.

    Args:
        ways, links: those of the road network.
        legs: the route's, each left where the next begins.
        checkpoints: its waypoints in order, without the first.
        parallel: other roads through junctions that lead from the leg before to the leg after one,
            by the number of that leg.
    """

    def __init__(
        self,
        ways: Ways,
        links: LinkTable,
        legs: Sequence[Leg],
        checkpoints: Sequence[Checkpoint],
        parallel: Mapping[Way, int],
    ) -> None:
        self._ways, self._links, self._legs = ways, links, legs
        self.parallel = parallel
        self._cells = list(self._cut(checkpoints))
        self._first: dict[int, int] = {}
        """number of the first cell of each leg"""
        for index, cell in enumerate(self._cells):
            self._first.setdefault(cell.leg, index)
        self._lanes = [self._drivable(cell) for cell in self._cells]
        self._ends: list[Mapping[int, float]] = [{}] * len(self._cells)
        """cost of each lane at the end of each cell, the waypoint there included"""
        self._begins: list[Mapping[int, float]] = [{}] * len(self._cells)
        # Backwards: the cost of a cell builds on that of the next.
        for index in reversed(range(len(self._cells))):
            self._ends[index] = {lane: self._after(index, lane) for lane in self._lanes[index]}
            self._begins[index] = {lane: self._best(index, lane)[0] for lane in self._lanes[index]}

    @property
    def destination(self) -> int | None:
        """The lane that the last waypoint asks for; None where it asks for none."""
        last = self._cells[-1].checkpoint
        return last.lane if last is not None else None

    def cost(self, leg: int, lane: int, way: Way | None = None) -> float:
        """Cost of beginning a leg, or another way in its place, in a lane; infinite where that
        leads nowhere."""
        if way is not None and way in self.parallel:
            return min(
                (self.cost(leg + 1, following) for following in self._through(way, lane)),
                default=math.inf,
            )
        index = self._first.get(leg)
        return self._begins[index].get(lane, math.inf) if index is not None else math.inf

    def cell(self, leg: int, s: float) -> LaneCell | None:
        """The cell of a leg at an s; None beyond the end of the route."""
        index = self._index(leg, s)
        if index is None:
            return None
        beyond = (
            s > self._cells[index].end if self._legs[leg].forward else s < self._cells[index].end
        )
        return None if beyond else self._cells[index]

    def lane(self, leg: int, s: float, lane: int, only_on: bool = False) -> int:
        """The lane to change to on a leg at an s; the present one where nothing is better, or the
        plan says nothing of it.

        Args:
            only_on: whether any lane will do that leads on along the route.
        """
        index = self._index(leg, s)
        if index is None or lane not in self._lanes[index]:
            return lane
        if only_on and self._ends[index][lane] < math.inf:
            return lane
        return self._best(index, lane)[1]

    def missed(self, leg: int, s: float, lane: int) -> list[Checkpoint]:
        """Waypoints that are not passed in their lanes from an s on a leg, in a lane."""
        passed: list[Checkpoint] = []
        index = self._index(leg, s)
        while index is not None and index < len(self._cells) and lane in self._lanes[index]:
            lane = self._best(index, lane)[1]
            asked = self._cells[index].checkpoint
            if asked is not None and asked.lane not in (None, lane):
                passed.append(asked)
            if index + 1 == len(self._cells):
                break
            onwards = [(index + 1, following) for following in self._next(index, lane)]
            for way, other, number in self._beside(index, lane):
                onwards += [
                    (self._first[number + 1], reached) for reached in self._through(way, other)
                ]
            if not onwards:
                break
            index, lane = min(onwards, key=lambda one: self._begins[one[0]].get(one[1], math.inf))
        return passed

    # cells ----------------------------------------------------------------------------------

    def _cut(self, checkpoints: Sequence[Checkpoint]) -> Iterator[LaneCell]:
        for number, leg in enumerate(self._legs):
            road = self._ways.roads[leg.road_id]
            low, high = sorted((leg.enter, leg.leave))
            here = [checkpoint for checkpoint in checkpoints if checkpoint.leg == number]
            borders = {section.s for section in road.sections if low < section.s < high}
            stops = sorted(
                {
                    *borders,
                    *(checkpoint.s for checkpoint in here if low < checkpoint.s < high),
                    low,
                    high,
                }
            )
            if not leg.forward:
                stops.reverse()
            # A leg without length still is a cell, with its waypoint.
            ends = stops[1:] or stops
            for begin, end in zip(stops, ends, strict=False):
                at = next((checkpoint for checkpoint in here if checkpoint.s == end), None)
                # The section of the middle: at a border the next one would be found.
                yield LaneCell(number, road.section(0.5 * (begin + end)), begin, end, at)

    def _drivable(self, cell: LaneCell) -> frozenset[int]:
        leg = self._legs[cell.leg]
        way, road = Way(leg.road_id, leg.forward), self._ways.roads[leg.road_id]
        middle = 0.5 * (cell.begin + cell.end)
        return frozenset(
            lane
            for lane in cell.section.lanes
            if lane and road.lane_width(middle, lane) > NO_WIDTH
            if self._ways.drives(way, lane, middle)
        )

    def _index(self, leg: int, s: float) -> int | None:
        """Number of the cell of a leg at an s; the first or last one outside."""
        index = self._first.get(leg)
        if index is None:
            return None
        forward = self._legs[leg].forward
        while index + 1 < len(self._cells) and self._cells[index + 1].leg == leg:
            end = self._cells[index].end
            if (s < end) if forward else (s > end):
                break
            index += 1
        return index

    # costs ----------------------------------------------------------------------------------

    def _after(self, index: int, lane: int) -> float:
        """Cost of a lane at the end of a cell."""
        asked = self._cells[index].checkpoint
        missed = MISSED if asked is not None and asked.lane not in (None, lane) else 0.0
        if index + 1 == len(self._cells):
            return missed
        begins = self._begins[index + 1]
        # A lane that leads nowhere costs infinity, so that changing before it ends is always
        # cheaper.
        costs = [begins.get(following, math.inf) for following in self._next(index, lane)]
        costs += [self.cost(leg, other, way) for way, other, leg in self._beside(index, lane)]
        return missed + min(costs, default=math.inf)

    def _beside(self, index: int, lane: int) -> Iterator[tuple[Way, int, int]]:
        """Ways in the place of the next leg that a lane leads to at the end of a cell, with the
        lanes there and that leg."""
        cell = self._cells[index]
        leg = self._legs[cell.leg]
        if self._cells[index + 1].leg == cell.leg:
            return
        for link in self._links.get((leg.road_id, lane, leg.forward), ()):
            way = Way(link.road_id, link.at_start)
            if self.parallel.get(way) == cell.leg + 1:
                yield way, link.lane_id, cell.leg + 1

    def _through(self, way: Way, lane: int) -> list[int]:
        """Lanes that a lane of a way in the place of a leg leads to, at the beginning of the leg
        after."""
        road, following = self._ways.roads[way.road_id], self._legs[self.parallel[way] + 1]
        # In the order of travel.
        sections = road.sections if way.forward else road.sections[::-1]
        for section, after in pairwise(sections):
            linked = next_lane(section.lanes[lane], after, way.forward)
            if linked is None:
                return []
            lane = linked
        links = self._links.get((way.road_id, lane, way.forward), ())
        return [link.lane_id for link in links if (link.road_id, link.at_start) == following[:2]]

    def _best(self, index: int, lane: int) -> tuple[float, int]:
        """Cost of a lane at the beginning of a cell, and the lane to change to; of equal ones that
        which needs no more changes later."""
        ends, lanes = self._ends[index], self._lanes[index]
        best = ends.get(lane, math.inf), lane
        for step in (-1, 1):
            reached, changes = lane, 0
            # 0 is the centre lane, which is no lane to drive on: `or step` goes past it.
            while (beside := reached + step or step) in lanes and self._allows(
                index, reached, beside
            ):
                reached, changes = beside, changes + 1
                cost = ends.get(reached, math.inf) + changes
                # One change now may make later ones needless at the same total: rather early than
                # at the last moment.
                if cost < best[0] or (cost == best[0] < math.inf):
                    best = cost, reached
        return best

    def _allows(self, index: int, lane: int, beside: int) -> bool:
        """Whether the road lets one change from a lane to its neighbour somewhere in a cell."""
        cell = self._cells[index]
        road = self._ways.roads[self._legs[cell.leg].road_id]
        # Vehicles keep their lanes within junctions and do not cross the centre.
        if road.junction_id is not None or (lane > 0) != (beside > 0):
            return False
        # Marks lie on the outer border of a lane (OpenDRIVE 1.9, 11.9), hence between both on that
        # of the inner one.
        inner = min(lane, beside, key=abs)
        wanted = ("both", "increase" if beside > lane else "decrease")
        marks = cell.section.lanes[inner].marks
        low, high = sorted((cell.begin, cell.end))
        until = [*(mark.s for mark in marks[1:]), math.inf]
        there = [
            mark for mark, end in zip(marks, until, strict=False) if end > low and mark.s < high
        ]
        # An absent laneChange allows both directions.
        return not there or any((mark.lane_change or "both") in wanted for mark in there)

    def _next(self, index: int, lane: int) -> list[int]:
        """Lanes at the beginning of the next cell that a lane leads to."""
        cell, following = self._cells[index], self._cells[index + 1]
        leg, to = self._legs[cell.leg], self._legs[following.leg]
        road = self._ways.roads[leg.road_id]
        if following.leg == cell.leg:
            if following.section is cell.section:
                return [lane]
            linked = next_lane(cell.section.lanes[lane], following.section, leg.forward)
            if linked is None:  # it ends beside another one
                linked = lane_in(
                    following.section, cell.end, cell.section.lanes[lane].center(cell.end)
                )
            return [linked]
        if leg.leave not in (0.0, road.length) or (leg.leave == 0.0) == leg.forward:
            return sorted(self._lanes[index + 1])  # left between its ends: at a virtual junction
        links = self._links.get((leg.road_id, lane, leg.forward), ())
        return [link.lane_id for link in links if (link.road_id, link.at_start) == to[:2]]
