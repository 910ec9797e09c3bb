"""Roads and lanes that are linked must touch: gaps between geometries, between roads, and between lanes."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

from lxml import etree

from schemas.checks.document import CheckedDocument
from schemas.checks.registry import Finding, rule
from schemas.common.errors import ToolchainError
from xodr.network import RoadNetwork
from xodr.reader.document import cross_path_gaps, linked_roads, load
from xodr.reader.elements import read_cross_path
from xodr.road import Road
from xodr.rules.lanes import DRIVABLE
from xodr.rules.sections import Section, SectionMeeting, integer, meetings

_GAP = 0.01
"""Largest distance between places that are to be the same, m."""
_SINCE = (1, 7)


@rule("asam.net:xodr:1.7.0:road.geometry.contact_point")
def linked_roads_touch(document: CheckedDocument) -> Iterator[Finding]:
    """The reference lines of roads that are linked without a junction shall touch at the contact points of the links.

    The rule is of version 1.7; in older files a gap is a warning.
    """
    network = _network(document)
    for ends in linked_roads(network, document.root) if network else ():
        if not ends.road.junction_id and not ends.other.junction_id and (gap := ends.apart()) > _GAP:
            level = None if document.type.version >= _SINCE else "warning"
            yield Finding(ends.element, f"a link joins {ends}, {gap:.3g} m apart", level)


def _network(document: CheckedDocument) -> RoadNetwork | None:
    """The road network; None where it cannot be read, which is said by other rules."""
    try:
        return load(document.path)
    except ToolchainError:
        return None


@rule("asam.net:xodr:1.7.0:lane_smoothness.contact_point_no_horizontal_gaps", since=_SINCE)
def linked_lanes_touch(document: CheckedDocument) -> Iterator[Finding]:
    """Geometries of a road that follow each other, and lanes to drive on that are linked, shall have no gaps between them."""
    network = _network(document)
    if network is None:
        return
    for element in document.elements("road"):
        yield from _gaps_of_line(network.roads.get(element.get("id") or ""), element)
    every = list(meetings(document))
    split = {(link, meeting.place) for meeting in every for link in _of_split(meeting)}
    for meeting in every:
        yield from _gaps_of_lanes(network, meeting, split)


@rule("asam.net:xodr:1.8.0:junctions.cross_path.lane_linkage", since=(1, 8))
def cross_paths_reach_their_lanes(document: CheckedDocument) -> Iterator[Finding]:
    """Start and end of a cross path's road shall be within the lanes that they are linked to."""
    network = _network(document)
    if network is None:
        return
    for element in document.elements("crossPath"):
        path = read_cross_path(element)
        for name, end, gap in zip(("start", "end"), (path.start, path.end), cross_path_gaps(network.roads, path), strict=True):
            if gap > _GAP:
                place = f"{gap:.3g} m beside" if gap < math.inf else "at no place of"
                yield Finding(
                    element, f"the {name} of the cross path lies {place} the lane {end.lane_id} of the road {end.road_id!r}"
                )


def _gaps_of_line(road: Road | None, element: etree._Element) -> Iterator[Finding]:
    geometries = element.findall("{*}planView/{*}geometry")
    if road is None or len(geometries) != len(road.line.segments):
        return
    for (before, after), geometry in zip(pairwise(road.line.segments), geometries[1:], strict=True):
        x, y, _ = before.at(before.length)
        gap = math.dist((x, y), after.at(0.0)[:2])
        if gap > _GAP:
            yield Finding(geometry, f"the geometry begins {gap:.3g} m away from the end of the one before it")


class _Borders(NamedTuple):
    """The border points of a lane at an end of its section: x and y, m."""

    inner: tuple[float, float]
    outer: tuple[float, float]


_Pair = tuple[etree._Element, etree._Element]


def _of_split(meeting: SectionMeeting) -> list[_Pair]:
    """Of lanes here that link several lanes there, all such pairs, as the lanes there see them."""
    by_lane: dict[etree._Element, list[etree._Element]] = {}
    for lane, other, _ in meeting.links:
        by_lane.setdefault(lane, []).append(other)
    return [(other, lane) for lane, others in by_lane.items() if len(others) > 1 for other in others]


def _gaps_of_lanes(network: RoadNetwork, meeting: SectionMeeting, split: set[tuple[_Pair, str]]) -> Iterator[Finding]:
    linked: dict[etree._Element, list[etree._Element]] = {}
    for lane, other, _ in meeting.links:
        if ((lane, other), meeting.place) not in split:
            linked.setdefault(lane, []).append(other)
    for lane, others in linked.items():
        here = _borders(network, meeting.here, meeting.here_start, lane)
        there = [found for other in others if (found := _borders(network, meeting.there, meeting.there_start, other))]
        if lane.get("type") not in DRIVABLE or here is None or not there:
            continue
        places = [place for each in there for place in each]
        gap = max(min(math.dist(mine, place) for place in places) for mine in here)
        if len(there) == 1:
            gap = min(_apart(here, there[0]), _apart(here, _Borders(there[0].outer, there[0].inner)))
        if gap > _GAP:
            names = " and ".join(other.get("id") or "" for other in others)
            yield Finding(lane, f"the borders of the lane {lane.get('id')} are {gap:.3g} m away from those of the lane {names}")


def _apart(one: _Borders, other: _Borders) -> float:
    return max(math.dist(one.inner, other.inner), math.dist(one.outer, other.outer))


def _borders(network: RoadNetwork, section: Section, at_start: bool, lane: etree._Element) -> _Borders | None:
    element = next(section.element.iterancestors("{*}road"), None)
    road = network.roads.get(element.get("id") or "") if element is not None else None
    if road is None:
        return None
    road = road.on(section.layer)
    found = road.section(0.5 * (section.start + section.end)).lanes.get(integer(lane, "id") or 0)
    if found is None or not found.id:
        return None
    s = section.start if at_start else section.end
    inner, outer = (road.pose(s, border(s))[:2] for border in (found.inner, found.outer))
    return _Borders(inner, outer)
