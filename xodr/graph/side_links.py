"""Where roads leave and join a main road between its ends: virtual junctions.

A road that begins or ends there names the place by `elementS` of its link. The main road gets a border of lane sections there, at
which a movement looks for ways off it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import NamedTuple

from xodr.model import Junction, Lane, LaneLink, LaneSection
from xodr.profiles import exceeding
from xodr.road import NO_WIDTH, Road

SideTable = dict[tuple[str, int, bool, float], list[LaneLink]]
"""Lanes reached from (road id, lane id, moving towards +s, s) where a road is left, or another one entered, between its ends."""

_NEAR = 1e-3
"""A border of lane sections so near [m] is taken for the place."""


class _Side(NamedTuple):
    """The end of a road that touches another one, `main`, inside it."""

    road: Road
    at_start: bool
    main: Road
    s: float


def divided(roads: Mapping[str, Road]) -> dict[str, Road]:
    """The roads, with a border of lane sections wherever another road joins one between its ends."""
    found = dict(roads)
    for side in _sides(roads):
        found[side.main.id] = _with_border(found[side.main.id], side.s)
    return found


def side_table(roads: Mapping[str, Road], junctions: Iterable[Junction]) -> SideTable:
    """All ways off and onto roads between their ends, in both directions, as the traffic of the linked lanes goes."""
    connected = {
        (connection.connecting_road, connection.incoming_road): [(lane, other) for other, lane in connection.lane_links]
        for junction in junctions
        for connection in junction.connections
    }
    table: SideTable = {}
    for road, at_start, main, near in _sides(roads):
        s = min((section.s for section in main.sections), key=lambda border: abs(border - near))
        end = 0.0 if at_start else road.length
        for lane, other in _lane_pairs(road, at_start) or connected.get((road.id, main.id), []):
            if lane not in road.sections[0 if at_start else -1].lanes or other not in main.section(s).lanes:
                continue
            off = (road.direction(lane, end) > 0) == at_start
            forward = (main.direction(other, s) > 0) == off
            table.setdefault((main.id, other, forward, s), []).append(LaneLink(road.id, lane, at_start))
            table.setdefault((road.id, lane, not at_start, end), []).append(LaneLink(main.id, other, not forward, s))
    return table


def _sides(roads: Mapping[str, Road]) -> Iterator[_Side]:
    for road in roads.values():
        for at_start, link in ((True, road.predecessor), (False, road.successor)):
            if link is not None and link.s is not None and _NEAR < link.s < roads[link.element_id].length - _NEAR:
                yield _Side(road, at_start, roads[link.element_id], link.s)


def _lane_pairs(road: Road, at_start: bool) -> list[tuple[int, int]]:
    """Lanes at an end of a road, each with the lane of the main road that it links."""
    lanes = road.sections[0 if at_start else -1].lanes.values()
    linked = ((lane.id, lane.predecessor if at_start else lane.successor) for lane in lanes)
    return [(lane, other) for lane, other in linked if lane and other]


def _with_border(road: Road, s: float) -> Road:
    section = road.section(s)
    if min(s - section.s, section.end - s) < _NEAR:
        return road
    index = road.section_index(s)
    parts = [_part(section, section.s, s, before=True), _part(section, s, section.end, before=False)]
    return replace(road, sections=[*road.sections[:index], *parts, *road.sections[index + 1 :]])


def _part(section: LaneSection, start: float, end: float, before: bool) -> LaneSection:
    lanes = {lane.id: _lane_part(lane, start, end, before) for lane in section.lanes.values()}
    return LaneSection(start, end, lanes)


def _lane_part(lane: Lane, start: float, end: float, before: bool) -> Lane:
    opens, closes = exceeding(lane.width, NO_WIDTH, start, end) if lane.id else (lane.opens, lane.closes)
    marks = [mark for mark in lane.marks if mark.s < end]
    if not before:
        held = [mark._replace(s=start) for mark in marks if mark.s <= start][-1:]
        marks = [*held, *(mark for mark in marks if mark.s > start)]
    part = replace(lane, opens=opens, closes=closes, marks=tuple(marks))
    return replace(part, successor=lane.id) if before else replace(part, predecessor=lane.id)
