"""Which lanes meet at the ends of roads: road links, lane links and junction connections made into one table.

Every meeting is kept in both directions, so that a way can be followed backwards too and a link that only one of the two
roads declares is still a link.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping

from xodr.model import Connection, Junction, Lane, LaneLink, LaneSection, RoadLink
from xodr.road import Road

LinkTable = dict[tuple[str, int, bool], list[LaneLink]]
"""Lanes reached from (road id, lane id, leaving at the end (True) or the start (False) of the road)."""

_Joint = tuple[LaneLink, LaneLink]


def link_table(roads: Mapping[str, Road], junctions: Mapping[str, Junction]) -> LinkTable:
    """All lane links of a road network."""
    table: LinkTable = {}
    for one, other in _joints(roads, junctions):
        for lane, reached in ((one, other), (other, one)):
            links = table.setdefault((lane.road_id, lane.lane_id, not lane.at_start), [])
            if reached not in links:
                links.append(reached)
    return table


def next_lane(lane: Lane, following: LaneSection, towards_s: bool) -> int | None:
    """The lane that continues this one in the next section of the road, whichever of the two declares it."""
    linked = lane.successor if towards_s else lane.predecessor
    if linked in following.lanes:
        return linked
    back = (other for other in following.lanes.values() if (other.predecessor if towards_s else other.successor) == lane.id)
    return next((other.id for other in back if other.id), None)


def _joints(roads: Mapping[str, Road], junctions: Mapping[str, Junction]) -> Iterator[_Joint]:
    for junction in junctions.values():
        for connection in junction.connections if junction.type != "virtual" else ():
            yield from _connection_joints(roads, junction, connection)
    for road in roads.values():
        for at_start, link in ((True, road.predecessor), (False, road.successor)):
            if link and link.element_type == "road" and link.s is None:
                yield from _road_joints(roads, road, at_start, link)


def _road_joints(roads: Mapping[str, Road], road: Road, at_start: bool, link: RoadLink) -> Iterator[_Joint]:
    other = roads[link.element_id]
    other_at_start = link.contact == "start" if link.contact else _nearer_start(other, road, at_start)
    pairs = [(lane, linked) for lane, linked in _lane_links(road, at_start).items() if linked]
    if not pairs and not any(_lane_links(other, other_at_start).values()):
        pairs = _same_lanes(road, at_start, other_at_start)
    yield from _pairs(road, at_start, other, other_at_start, pairs)


def _connection_joints(roads: Mapping[str, Road], junction: Junction, connection: Connection) -> Iterator[_Joint]:
    incoming, connecting = roads[connection.incoming_road], roads[connection.connecting_road]
    contact_start = connection.contact == "start"
    incoming_start = _incoming_start(incoming, connecting, contact_start, junction.id)
    pairs = list(connection.lane_links)
    if not pairs and not any(_lane_links(connecting, contact_start).values()):
        pairs = _same_lanes(incoming, incoming_start, contact_start)
    yield from _pairs(incoming, incoming_start, connecting, contact_start, pairs)


def _lane_links(road: Road, at_start: bool) -> dict[int, int | None]:
    """What each lane at one end of a road links to beyond it."""
    lanes = road.sections[0 if at_start else -1].lanes
    return {lane.id: lane.predecessor if at_start else lane.successor for lane in lanes.values() if lane.id}


def _same_lanes(road: Road, at_start: bool, other_at_start: bool) -> list[tuple[int, int]]:
    """Where a file links roads but none of their lanes, each lane goes on in the one at the same place."""
    sign = -1 if at_start == other_at_start else 1
    return [(lane, sign * lane) for lane in _lane_links(road, at_start)]


def _pairs(road: Road, at_start: bool, other: Road, other_at_start: bool, pairs: Iterable[tuple[int, int]]) -> Iterator[_Joint]:
    """Joints of the lane pairs that exist."""
    here, there = _lane_links(road, at_start), _lane_links(other, other_at_start)
    for lane, target in pairs:
        if lane in here and target in there:
            yield LaneLink(road.id, lane, at_start), LaneLink(other.id, target, other_at_start)


def _incoming_start(incoming: Road, connecting: Road, contact_start: bool, junction_id: str) -> bool:
    """Whether the incoming road meets the junction with its start."""
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
    gaps = [math.hypot(x - end[0], y - end[1]) for end in (road.line.at(0.0), road.line.at(road.length))]
    return gaps[0] <= gaps[1]
