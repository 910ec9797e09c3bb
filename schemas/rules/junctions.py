"""Junctions of road networks (OpenDRIVE): the roads of their connections, directions, and links that need a junction."""

from __future__ import annotations

from collections.abc import Iterator

from lxml import etree

from schemas.checks.document import Document
from schemas.checks.lanes import connected_road, connections, integer, meetings
from schemas.checks.registry import Finding, rule


@rule("asam.net:xodr:1.4.0:junctions.connection.connect_road_no_incoming_road")
def connecting_roads_are_not_incoming(document: Document) -> Iterator[Finding]:
    """Connecting roads shall not be incoming roads."""
    roads = _roads(document)
    for _, connection in _connections(document):
        incoming = roads.get(connection.get("incomingRoad") or "")
        if incoming is not None and (incoming.get("junction") or "-1") != "-1":
            yield Finding(connection, f"incomingRoad={incoming.get('id')!r} is a connecting road of a junction")


def _roads(document: Document) -> dict[str, etree._Element]:
    return {road.get("id") or "": road for road in document.elements("road")}


def _connections(document: Document) -> Iterator[tuple[etree._Element, etree._Element]]:
    for junction in document.elements("junction"):
        yield from ((junction, connection) for connection in connections(junction))


@rule("asam.net:xodr:1.7.0:junctions.connection.one_connection_element", since=(1, 7))
def connecting_roads_have_one_connection(document: Document) -> Iterator[Finding]:
    """In version 1.7, each connecting road shall have exactly one connection."""
    if document.type.version > (1, 7):
        return
    seen: set[str] = set()
    for _, connection in _connections(document):
        road = connection.get("connectingRoad")
        if road is not None and road in seen:
            yield Finding(connection, f"connectingRoad={road!r} has another connection")
        seen |= {road} if road is not None else set()


@rule("asam.net:xodr:1.8.0:junctions.connection.one_link_to_incoming", since=(1, 8))
def connections_lead_into_the_junction(document: Document) -> Iterator[Finding]:
    """A connecting road shall have one connection for each incoming road, with lane links in the direction of traffic only."""
    seen: set[tuple[str | None, str]] = set()
    for _, connection in _connections(document):
        ends = connection.get("incomingRoad"), connected_road(connection)
        if connection.get("connectingRoad") and ends in seen:
            yield Finding(connection, f"another connection leads from the road {ends[0]!r} to the road {ends[1]!r}")
        seen.add(ends)
    for meeting in meetings(document):
        if meeting.place != "junction":
            continue
        for lane, other, link in meeting.links:
            leaves = _ways(lane) & ({-1} if meeting.here_start else {1})
            enters = _ways(other) & ({1} if meeting.there_start else {-1})
            if not leaves or not enters:
                message = f"no traffic leads from the lane {lane.get('id')} to the lane {other.get('id')} of the connection"
                yield Finding(link, message)


def _ways(lane: etree._Element) -> set[int]:
    """The directions in which a lane's traffic drives: 1 for +s, -1 for -s."""
    road = next(lane.iterancestors("{*}road"), None)
    if lane.get("direction") == "both" or lane.get("type") == "bidirectional":
        return {1, -1}
    right_hand = road is None or (road.get("rule") or "RHT") == "RHT"
    way = 1 if ((integer(lane, "id") or 0) < 0) == right_hand else -1
    return {-way} if lane.get("direction") == "reversed" else {way}


@rule("asam.net:xodr:1.7.0:junctions.connection.start_along_linkage", since=(1, 7))
def connections_enter_at_the_start(document: Document) -> Iterator[Finding]:
    """contactPoint="start" of a connection means that the incoming road is the predecessor of the connecting road."""
    yield from _entered(document, "start", "predecessor")


@rule("asam.net:xodr:1.7.0:junctions.connection.end_opposite_linkage", since=(1, 7))
def connections_enter_at_the_end(document: Document) -> Iterator[Finding]:
    """contactPoint="end" of a connection means that the incoming road is the successor of the connecting road."""
    yield from _entered(document, "end", "successor")


def _entered(document: Document, contact: str, name: str) -> Iterator[Finding]:
    roads = _roads(document)
    for _, connection in _connections(document):
        road = roads.get(connection.get("connectingRoad") or "")
        link = road.find(f"{{*}}link/{{*}}{name}") if road is not None else None
        if connection.get("contactPoint") != contact or road is None or link is None or link.get("elementType") != "road":
            continue
        if link.get("elementId") != connection.get("incomingRoad"):
            message = (
                f"contactPoint={contact!r}, but the {name} of the road {road.get('id')!r} is the road {link.get('elementId')!r},"
                f" not {connection.get('incomingRoad')!r}"
            )
            yield Finding(connection, message)


@rule("asam.net:xodr:1.4.0:road.linkage.is_junction_needed")
def ambiguous_links_need_a_junction(document: Document) -> Iterator[Finding]:
    """Two roads must not link the same end of a road: where it goes on is ambiguous without a junction."""
    seen: set[tuple[str, str]] = set()
    for road in document.elements("road"):
        if (road.get("junction") or "-1") != "-1":
            continue
        for link in (*road.iterfind("{*}link/{*}predecessor"), *road.iterfind("{*}link/{*}successor")):
            end = link.get("elementId") or "", link.get("contactPoint") or ""
            if link.get("elementType") != "road" or link.get("elementS") or not end[1]:
                continue
            if end in seen:
                yield Finding(link, f"another road links the {end[1]} of the road {end[0]!r}, too; a junction is needed")
            seen.add(end)
