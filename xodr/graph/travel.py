"""Moving along lanes: over lane sections, road borders and through junctions, keeping the offset
from the lane's centre."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

from xodr.graph.links import LinkTable, SideTable
from xodr.graph.ways import DRIVABLE
from xodr.model import NO_WIDTH, Lane, LaneLink, LaneSection, RoadError, RoadPoint
from xodr.model.road import Road

Choose = Callable[[RoadPoint, bool, Sequence[LaneLink]], LaneLink | None]
"""Picks the way on: (point at the road's end, leaving towards +s, lanes reached) → one of them,
None to stay there.

Between the ends of a road, where others leave it, the first lane offered is that of the road
itself.
"""

_STEP = 1.0
"""Longest stretch [m] over which curvature and lane slope are taken as constant, at their value in
its middle."""
_MOST_STEPS = 1000
_MOST_BORDERS = 10_000
_NARROWED = 0.1
_SHARPEST = 1e-3
"""Lower limit of d(way)/ds beyond the centre of a curve, where the reference line cannot be
followed any more."""


class Travel(NamedTuple):
    """End of a movement.

    forward: the movement's direction on the road that was reached: True towards +s.
    left: distance [m] that could not be travelled because the road ended; 0 where it did not.
    """

    point: RoadPoint
    forward: bool
    left: float


class Traveller:
    """Moves points along the lanes of one road network."""

    def __init__(self, roads: Mapping[str, Road], links: LinkTable, sides: SideTable) -> None:
        self._roads, self._links, self._sides = roads, links, sides
        # Turns are asked for at every junction by every road user, and never change.
        self._turns: dict[LaneLink, tuple[float, bool]] = {}

    def travel(self, point: RoadPoint, distance: float, forward: bool, choose: Choose) -> Travel:
        """Move `distance` [m ≥ 0] along the point's lane, measured on the way of
        the point itself.
        """
        road_id, s, _, lane_id, offset, layer = point
        road = self._roads[road_id]
        section = road.section(s)
        lane = section.lanes.get(lane_id) or road.lane(s, lane_id)
        center = lane.center.constant
        if center is not None and road.line.straight:  # the common case: ds is the distance
            reached = s + distance if forward else s - distance
            # Beyond a section, links and borders matter: the slow way.
            if section.s <= reached < section.end:
                return Travel(
                    RoadPoint(road_id, reached, center + offset, lane_id, offset, layer),
                    forward,
                    0.0,
                )
        return self._walk(point, distance, forward, choose)

    def _walk(self, point: RoadPoint, distance: float, forward: bool, choose: Choose) -> Travel:
        road = self._roads[point.road_id]
        index, lane_id, s, offset = (
            road.section_index(point.s),
            point.lane_id,
            point.s,
            point.offset,
        )
        for _ in range(_MOST_BORDERS):
            section = road.sections[index]
            lane = section.lanes[lane_id]
            # A lane that has closed goes on in its neighbour before anything else is asked.
            beside = _merged(section, lane, s, offset, forward) if lane.closed(s, forward) else None
            if beside is not None:
                lane_id, offset = beside
                continue
            border, step = (section.end, 1) if forward else (section.s, -1)
            stop = _nearer(border, lane.closes if forward else lane.opens, s, forward)
            s, distance = _along(road, lane, offset, s, stop, step, distance)
            inside = s < stop if forward else distance <= 0.0
            here = RoadPoint(road.id, s, lane.center(s) + offset, lane_id, offset, point.layer)
            if inside:
                return Travel(here, forward, 0.0)
            # At the place where the lane closes: the next round merges it.
            if stop != border:
                continue
            inner = 0 <= index + step < len(road.sections)
            if inner:
                onward = self._way_off(here, forward, choose)
            else:
                onward = self._next_road(here, section, forward, choose) if distance > 0.0 else None
            if onward is None:
                if not inner:
                    return Travel(here, forward, distance)
                index, lane_id, offset = _next_section(road, index, lane_id, offset, forward)
                continue
            link, offset = onward
            # The road entered is laid the other way round: t and offsets change sign.
            if link.at_start != forward:
                offset = -offset
            road, lane_id, forward = self._roads[link.road_id], link.lane_id, link.at_start
            index, s = _entry(road, link)
        raise RoadError(
            f"a movement from road {point.road_id!r} crosses more than {_MOST_BORDERS} borders",
            path=road.path,
        )

    def _next_road(
        self, here: RoadPoint, section: LaneSection, forward: bool, choose: Choose
    ) -> tuple[LaneLink, float] | None:
        """The way on from a road's end, and the offset [m] there, before the turn of a road laid
        the other way round.

        A lane without a successor, such as one narrowed to nothing, continues in the nearest lane
        of its side that has one.
        """
        lane_id, offset = here.lane_id, here.offset
        links = self._reached(here, lane_id, forward)
        if not links:
            leading = [
                lane for lane in section.lanes.values() if self._reached(here, lane.id, forward)
            ]
            lane_id = _nearest(section.lanes[lane_id], leading, here.s, here.t)
            offset = here.t - section.lanes[lane_id].center(here.s)
            links = self._reached(here, lane_id, forward)
        link = (
            choose(here._replace(lane_id=lane_id, offset=offset), forward, links) if links else None
        )
        return (link, offset) if link is not None else None

    def _way_off(
        self, here: RoadPoint, forward: bool, choose: Choose
    ) -> tuple[LaneLink, float] | None:
        """The way off a road between its ends, if one is there and chosen, and the offset [m] on
        it."""
        links = self._sides.get((here.road_id, here.lane_id, forward, here.s))
        if not links:
            return None
        # Staying on the road is one of the choices: choose sees it first.
        stay = LaneLink(here.road_id, here.lane_id, forward, here.s)
        link = choose(here, forward, [stay, *links])
        return (link, here.offset) if link is not None and link != stay else None

    def _reached(self, here: RoadPoint, lane_id: int, forward: bool) -> Sequence[LaneLink]:
        """Lanes reached from a lane at the end of a road."""
        ends = self._links.get((here.road_id, lane_id, forward), ())
        sides = self._sides.get((here.road_id, lane_id, forward, here.s), ())
        return [*ends, *sides] if sides else ends

    def length(self, road: Road, lane_id: int, start: float, end: float) -> tuple[float, int]:
        """Length [m ≥ 0] of a lane's centre line between two s, and the id that the lane has at the
        end."""
        forward = end >= start
        total, index, last = 0.0, road.section_index(start), road.section_index(end)
        while True:
            section = road.sections[index]
            border = end if index == last else section.end if forward else section.s
            total += _lane_length(
                road, section.lanes.get(lane_id) or road.lane(section.s, lane_id), start, border
            )
            if index == last:
                return total, lane_id
            start = border
            index, lane_id, _ = _next_section(road, index, lane_id, 0.0, forward)

    def straightest(
        self, _point: RoadPoint, _forward: bool, links: Sequence[LaneLink]
    ) -> LaneLink | None:
        """The link that turns least; of equal turns the left one, and of several to one side the
        first."""
        return min(links, key=self.turn) if links else None

    def turn(self, link: LaneLink) -> tuple[float, bool]:
        """Return the change of heading (rad, ≥ 0) on the road that a link enters (first 50 m, or
        all in a junction), and if right.

        Zero where it enters a road in between: traffic on that road passes by.
        """
        if link.s is not None:
            return 0.0, False
        turn = self._turns.get(link)
        if turn is None:
            road = self._roads[link.road_id]
            reach = road.length if road.junction_id else min(road.length, 50.0)
            entry, exit_ = (0.0, reach) if link.at_start else (road.length, road.length - reach)
            # equal turns to the nanoradian are equal: not rounding decides
            angle = round(math.remainder(road.heading(exit_) - road.heading(entry), math.tau), 9)
            turn = self._turns[link] = (abs(angle), angle < 0.0)
        return turn


def _entry(road: Road, link: LaneLink) -> tuple[int, float]:
    """Index of the lane section that a link enters, and s there."""
    if link.s is None:
        return (0, 0.0) if link.at_start else (len(road.sections) - 1, road.length)
    # Against s, the section before the border is entered.
    return road.section_index(link.s) - (0 if link.at_start else 1), link.s


def _along(
    road: Road, lane: Lane, offset: float, s: float, border: float, sign: float, distance: float
) -> tuple[float, float]:
    """Go on from s towards the section's border: the s reached, and the distance left where the
    border stops it.

    The way of a point at t is |1 − κt| ds long where the road curves, and longer where the lane
    drifts sideways (dt/ds). A point that is beyond the border already (it left the road) stays
    there.
    """
    room = (border - s) * sign
    if room <= 0.0:
        return s, distance
    if road.line.straight and lane.center.constant is not None:
        return (border, distance - room) if distance >= room else (s + sign * distance, 0.0)
    # The steps grow with the distance, so that teleports of kilometres stay cheap.
    longest = max(_STEP, distance / _MOST_STEPS)
    while True:
        room = (border - s) * sign
        limit = min(room, longest)
        # Midpoint rule: the rate at the middle of a step makes its error one of third order.
        half = 0.5 * min(distance / _way_per_s(road, lane, offset, s), limit)
        rate = _way_per_s(road, lane, offset, s + sign * half)
        ds = distance / rate
        if ds < limit:
            return s + sign * ds, 0.0
        distance = max(distance - limit * rate, 0.0)
        if limit == room:
            return border, distance
        s += sign * limit


def _lane_length(road: Road, lane: Lane, start: float, end: float) -> float:
    """Length of a lane's centre line between two s of one lane section."""
    span = end - start
    if road.line.straight and lane.center.constant is not None:
        return abs(span)
    # As fine as movements are, but bounded.
    count = max(1, min(math.ceil(abs(span) / _STEP), _MOST_STEPS))
    rates = (
        _way_per_s(road, lane, 0.0, start + span * (index + 0.5) / count) for index in range(count)
    )
    return abs(span) / count * sum(rates)


def _way_per_s(road: Road, lane: Lane, offset: float, s: float) -> float:
    t = lane.center(s) + offset
    # Beyond the centre of a curve the way would shrink to nothing, and ds grow without bound.
    return max(math.hypot(1.0 - road.line.curvature(s) * t, lane.center.slope(s)), _SHARPEST)


def _next_section(
    road: Road, index: int, lane_id: int, offset: float, forward: bool
) -> tuple[int, int, float]:
    """Section, lane and offset beyond a section's border: the linked lane, at the same offset.

    A lane that the file does not continue, or that has narrowed to nothing, is left without a jump:
    t stays the same.
    """
    section = road.sections[index]
    # The centre lane goes on everywhere; no link says so.
    lane = section.lanes[lane_id]
    following = index + (1 if forward else -1)
    lanes = road.sections[following].lanes
    border = section.end if forward else section.s
    linked = (lane.successor if forward else lane.predecessor) if lane_id else 0
    if linked not in lanes:
        linked = _nearest(lane, lanes.values(), border, lane.center(border) + offset)
    # A lane that keeps its width goes on with its offset, even where its centre jumps.
    elif lane_id == 0 or lane.width(border) > _NARROWED:
        return following, linked, offset
    return following, linked, lane.center(border) + offset - lanes[linked].center(border)


def _nearer(border: float, closing: float, s: float, forward: bool) -> float:
    """Return the s of the next stop of a movement on a lane: the section's border, or the place
    where the lane closes."""
    return closing if (s < closing < border if forward else border < closing < s) else border


def _merged(
    section: LaneSection, lane: Lane, s: float, offset: float, forward: bool
) -> tuple[int, float] | None:
    """The lane, and the offset [m] on it, that goes on where a lane has narrowed to nothing; None
    where no other is there."""
    t = lane.center(s) + offset
    open_lanes = [
        other
        for other in section.lanes.values()
        if other.width(s) > NO_WIDTH and not other.closed(s, forward)
    ]
    beside = _nearest(lane, open_lanes, s, t)
    return (beside, t - section.lanes[beside].center(s)) if beside != lane.id and beside else None


def _nearest(lane: Lane, others: Iterable[Lane], s: float, t: float) -> int:
    """Return the lane that continues at (s, t) after a lane has ended; the ended lane itself if
    there is none.

    It is on the same side of the road, for traffic where the lane is, then the nearest, then the
    innermost.
    """

    def key(other: Lane) -> tuple[bool, float, int]:
        low, high = sorted((other.inner(s), other.outer(s)))
        return (
            # Rather traffic for traffic than the nearest: a sidewalk may be nearer than the next
            # lane.
            (other.type in DRIVABLE) != (lane.type in DRIVABLE),
            round(max(low - t, t - high, 0.0), 6),
            abs(other.id),
        )

    return min((other for other in others if other.id * lane.id > 0), key=key, default=lane).id
