"""Which lanes meet at the ends of roads: road links, lane links and junction connections made into one table.

Every meeting is kept in both directions, so that a way can be followed backwards too and a link that only one of the two
roads declares is still a link.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from xodr.model import Connection, Junction, LaneLink, RoadLink
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


def _joints(roads: Mapping[str, Road], junctions: Mapping[str, Junction]) -> Iterator[_Joint]:
    for junction in junctions.values():
        for connection in junction.connections:
            yield from _connection_joints(roads, junction, connection)
    for road in roads.values():
        for at_start, link in ((True, road.predecessor), (False, road.successor)):
            if link and link.element_type == "road":
                yield from _road_joints(roads, road, at_start, link)


def _road_joints(roads: Mapping[str, Road], road: Road, at_start: bool, link: RoadLink) -> Iterator[_Joint]:
    other = roads[link.element_id]
    other_at_start = link.contact == "start" if link.contact else _nearer_start(other, road, at_start)
    there = other.sections[0 if other_at_start else -1].lanes
    for lane in road.sections[0 if at_start else -1].lanes.values():
        linked = lane.predecessor if at_start else lane.successor
        if lane.id and linked and linked in there:
            yield LaneLink(road.id, lane.id, at_start), LaneLink(other.id, linked, other_at_start)


def _connection_joints(roads: Mapping[str, Road], junction: Junction, connection: Connection) -> Iterator[_Joint]:
    incoming, connecting = roads[connection.incoming_road], roads[connection.connecting_road]
    contact_start = connection.contact == "start"
    incoming_start = _incoming_start(incoming, connecting, contact_start, junction.id)
    here = incoming.sections[0 if incoming_start else -1].lanes
    there = connecting.sections[0 if contact_start else -1].lanes
    for lane, target in connection.lane_links:
        if lane and target and lane in here and target in there:
            yield LaneLink(incoming.id, lane, incoming_start), LaneLink(connecting.id, target, contact_start)


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
