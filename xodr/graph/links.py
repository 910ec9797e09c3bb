"""Links between lanes: at the ends of roads, by road and junction links, and along a road, by
virtual junctions and cross paths.

Every meeting is kept in both directions, so that a way can be followed backwards too and a link
that only one of the two roads declares is still a link. A road that begins or ends at a virtual
junction names the place by `elementS` of its link. The main road gets a border of lane sections
there, at which a movement looks for ways off it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from xodr.model import (
    NEAR,
    PERMANENT,
    Connection,
    Junction,
    Lane,
    LaneLink,
    LaneRef,
    LaneSection,
    RoadLink,
    cut,
    has,
)
from xodr.model.road import Road, lane_in

LinkTable = dict[tuple[str, int, bool], list[LaneLink]]
"""Lanes reached from (road id, lane id, leaving at the end (True) or the start (False) of the
road)."""

_Joint = tuple[LaneLink, LaneLink]


def link_table(roads: Mapping[str, Road], junctions: Mapping[str, Junction]) -> LinkTable:
    """All lane links of a road network."""
    table: LinkTable = {}
    for one, other in _joints(roads, junctions):
        # Both ways: files often declare a link on one side only.
        for lane, reached in ((one, other), (other, one)):
            links = table.setdefault((lane.road_id, lane.lane_id, not lane.at_start), [])
            if reached not in links:
                links.append(reached)
    return table


def next_lane(lane: Lane, following: LaneSection, towards_s: bool) -> int | None:
    """The lane that continues this one in the next section of the road, whichever of the two
    declares it."""
    linked = lane.successor if towards_s else lane.predecessor
    if linked in following.lanes:
        return linked
    back = (
        other
        for other in following.lanes.values()
        if (other.predecessor if towards_s else other.successor) == lane.id
    )
    return next((other.id for other in back if other.id), None)


def _joints(roads: Mapping[str, Road], junctions: Mapping[str, Junction]) -> Iterator[_Joint]:
    for junction in junctions.values():
        # The connecting roads of virtual junctions touch their main road between its ends: see
        # side_table.
        for connection in junction.connections if junction.type != "virtual" else ():
            yield from _connection_joints(roads, junction, connection)
    for road in roads.values():
        for at_start, link in ((True, road.predecessor), (False, road.successor)):
            if link and link.element_type == "road" and link.s is None:
                yield from _road_joints(roads, road, at_start, link)
    for side in _cross_path_sides(roads, junctions.values()):
        if not side.inside:
            here, there = _RoadEnd(side.road, side.at_start), _RoadEnd(side.main, side.s < NEAR)
            yield from _pairs(here, there, side.lanes)


def _road_joints(
    roads: Mapping[str, Road], road: Road, at_start: bool, link: RoadLink
) -> Iterator[_Joint]:
    other = roads[link.element_id]
    other_at_start = (
        link.contact == "start" if link.contact else _nearer_start(other, road, at_start)
    )
    here, there = _RoadEnd(road, at_start), _RoadEnd(other, other_at_start)
    pairs = [
        (lane, target) for lane, links in here.links().items() for target in there.reached(links)
    ]
    # Lanes are paired by place only where no lane of either side is linked: else a missing link
    # means that the lane ends.
    if not any(here.links().values()) and not any(there.links().values()):
        pairs = _same_lanes(here, there)
    yield from _pairs(here, there, pairs)


def _connection_joints(
    roads: Mapping[str, Road], junction: Junction, connection: Connection
) -> Iterator[_Joint]:
    incoming, connecting = roads[connection.incoming_road], roads[connection.connecting_road]
    contact_start = connection.contact == "start"
    incoming_start = _incoming_start(incoming, connecting, contact_start, junction.id)
    here, there = _RoadEnd(incoming, incoming_start), _RoadEnd(connecting, contact_start)
    pairs = [
        (a, b)
        for one, other in connection.lane_links
        for a in here.reached([one])
        for b in there.reached([other])
    ]
    if not connection.lane_links and not any(there.links().values()):
        pairs = _same_lanes(here, there)
    yield from _pairs(here, there, pairs)


class _RoadEnd(NamedTuple):
    """One end of a road."""

    road: Road
    at_start: bool

    @property
    def section(self) -> LaneSection:
        """The lanes in force there."""
        return self.road.sections[0 if self.at_start else -1]

    def links(self) -> dict[int, tuple[LaneRef, ...]]:
        """Return the lanes beyond the end that each lane links to."""
        lanes = [lane for lane in self.section.lanes.values() if lane.id]
        return {lane.id: lane.predecessors if self.at_start else lane.successors for lane in lanes}

    def reached(self, links: Iterable[LaneRef]) -> list[int]:
        """The lanes that links name. Where these are of the other layer only, the lanes at their
        place."""
        links = list(links)
        found = [link.id for link in links if has(self.section, link)]
        # A link may name a lane of the layer that is not in force here.
        return found or [lane for link in links if (lane := self._beside(link))]

    def _beside(self, link: LaneRef) -> int | None:
        """The lane at the place of a lane of the other layer that a link names."""
        other = self.road.in_force or self.road.on(PERMANENT)
        section = other.sections[0 if self.at_start else -1]
        if other is self.road or not link.id or not has(section, link):
            return None
        s = 0.0 if self.at_start else other.length
        t = section.lanes[link.id].center(s)
        lane = self.section.lanes[lane_in(self.section, s, t)]
        return (
            lane.id
            if min(lane.inner(s), lane.outer(s)) <= t <= max(lane.inner(s), lane.outer(s))
            else None
        )


def _same_lanes(here: _RoadEnd, there: _RoadEnd) -> list[tuple[int, int]]:
    """Pair lanes at the same place, for a file that links roads but none of their lanes."""
    # Start to start or end to end, the roads run against each other and their lanes change sides.
    sign = -1 if here.at_start == there.at_start else 1
    return [(lane, sign * lane) for lane in here.links()]


def _pairs(here: _RoadEnd, there: _RoadEnd, pairs: Iterable[tuple[int, int]]) -> Iterator[_Joint]:
    """Joints of the lane pairs that exist."""
    for lane, target in pairs:
        if lane and target and lane in here.section.lanes and target in there.section.lanes:
            yield (
                LaneLink(here.road.id, lane, here.at_start),
                LaneLink(there.road.id, target, there.at_start),
            )


def _incoming_start(
    incoming: Road, connecting: Road, contact_start: bool, junction_id: str
) -> bool:
    """Whether the incoming road meets the junction with its start."""
    # The connecting road says most precisely which end it comes from; the incoming road knows the
    # junction only.
    back = connecting.predecessor if contact_start else connecting.successor
    if back and back.element_id == incoming.id and back.contact:
        return back.contact == "start"
    ends = [
        at_start
        for at_start, link in ((True, incoming.predecessor), (False, incoming.successor))
        if link and link.element_type == "junction" and link.element_id == junction_id
    ]
    return ends[0] if len(ends) == 1 else _nearer_start(incoming, connecting, contact_start)


def _nearer_start(road: Road, other: Road, other_at_start: bool) -> bool:
    """Whether the start of a road is nearer than its end to the given end of another road."""
    x, y, _ = other.line.at(0.0 if other_at_start else other.length)
    # In the plane: elevations may be missing on one of both.
    gaps = [
        math.hypot(x - end[0], y - end[1]) for end in (road.line.at(0.0), road.line.at(road.length))
    ]
    return gaps[0] <= gaps[1]


SideTable = dict[tuple[str, int, bool, float], list[LaneLink]]
"""Lanes reached from (road id, lane id, moving towards +s, s) where a road is left, or another one
entered, between its ends."""


class _Side(NamedTuple):
    """The end of a road that touches another one, `main`.

    lanes: pairs of its own lanes with those of `main`. walked: whether they are taken in both
    directions, as by pedestrians.
    """

    road: Road
    at_start: bool
    main: Road
    s: float
    lanes: Sequence[tuple[int, int]]
    walked: bool = False

    @property
    def inside(self) -> bool:
        """Whether it touches the other road between the ends of that one."""
        return NEAR < self.s < self.main.length - NEAR


def divided(roads: Mapping[str, Road], junctions: Iterable[Junction]) -> dict[str, Road]:
    """The roads, with a border of lane sections wherever another road joins one
    between its ends.
    """
    found = dict(roads)
    for side in _sides(roads, junctions):
        found[side.main.id] = _with_border(found[side.main.id], side.s)
    return found


def side_table(roads: Mapping[str, Road], junctions: Iterable[Junction]) -> SideTable:
    """All ways off and onto roads between their ends, in both directions, as the traffic of the
    linked lanes goes."""
    table: SideTable = {}
    for road, at_start, main, near, lanes, walked in _sides(roads, junctions):
        # `divided` put a border near there; the table is looked up by the exact s of sections.
        s = min((section.s for section in main.sections), key=lambda border: abs(border - near))
        end = 0.0 if at_start else road.length
        for lane, other in lanes:
            if (
                lane not in road.sections[0 if at_start else -1].lanes
                or other not in main.section(s).lanes
            ):
                continue
            # Whether traffic comes off the main road here: it does where it drives away from this
            # end.
            off = (road.direction(lane, end) > 0) == at_start
            traffic = (main.direction(other, s) > 0) == off
            for forward in (traffic, not traffic) if walked else (traffic,):
                table.setdefault((main.id, other, forward, s), []).append(
                    LaneLink(road.id, lane, at_start)
                )
                table.setdefault((road.id, lane, not at_start, end), []).append(
                    LaneLink(main.id, other, not forward, s)
                )
    return table


def _sides(roads: Mapping[str, Road], junctions: Iterable[Junction]) -> Iterator[_Side]:
    """Ends of roads that touch others between their ends: at virtual junctions, and those of cross
    paths."""
    junctions = list(junctions)
    connected = {
        (connection.connecting_road, connection.incoming_road): [
            (lane.id, other.id) for other, lane in connection.lane_links
        ]
        for junction in junctions
        for connection in junction.connections
    }
    for road in roads.values():
        for at_start, link in ((True, road.predecessor), (False, road.successor)):
            if link is not None and link.s is not None:
                # Some files link the lanes in the road, some in the junction's connection.
                lanes = _lane_pairs(road, at_start) or connected.get((road.id, link.element_id), [])
                side = _Side(road, at_start, roads[link.element_id], link.s, lanes)
                if side.inside:
                    yield side
    yield from (side for side in _cross_path_sides(roads, junctions) if side.inside)


def _cross_path_sides(roads: Mapping[str, Road], junctions: Iterable[Junction]) -> Iterator[_Side]:
    for junction in junctions:
        for path in junction.cross_paths:
            for at_start, end in ((True, path.start), (False, path.end)):
                yield _Side(
                    roads[path.road_id],
                    at_start,
                    roads[end.road_id],
                    end.s,
                    [(end.own_lane, end.lane_id)],
                    walked=True,
                )


def _lane_pairs(road: Road, at_start: bool) -> list[tuple[int, int]]:
    """Lanes at an end of a road, each with the lane of the main road that it links."""
    lanes = road.sections[0 if at_start else -1].lanes.values()
    linked = ((lane.id, lane.predecessor if at_start else lane.successor) for lane in lanes)
    return [(lane, other) for lane, other in linked if lane and other]


def _with_border(road: Road, s: float) -> Road:
    permanent = None if road.permanent is None else _bordered(road.permanent, s)
    return replace(road, sections=_bordered(road.sections, s), permanent=permanent)


def _bordered(sections: list[LaneSection], s: float) -> list[LaneSection]:
    index = next(
        (
            number
            for number, section in enumerate(sections)
            if section.s + NEAR <= s <= section.end - NEAR
        ),
        None,
    )
    if index is None:
        return sections
    section = sections[index]
    # Both halves link each other by the same id, so that movements go on across the cut.
    before = {
        lane.id: replace(cut(lane, section.s, s), successor=lane.id)
        for lane in section.lanes.values()
    }
    after = {
        lane.id: replace(cut(lane, s, section.end), predecessor=lane.id)
        for lane in section.lanes.values()
    }
    parts = [LaneSection(section.s, s, before), LaneSection(s, section.end, after)]
    return [*sections[:index], *parts, *sections[index + 1 :]]
