"""Reads junctions with their connections, and controllers of signals."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from lxml import etree

from schemas.common.remarks import Remark
from schemas.xml import line_of
from xodr.model import Connection, Controller, Junction, LaneRef
from xodr.reader.elements import contact_point, integer, invalid, lane_layer, number, text

_FOLLOWED = "xosc.toolchain:xodr:1.5.0:junction.connections_are_followed"
_KINDS = ("default", "direct", "virtual", "crossing")


def read_junction(element: etree._Element) -> Junction:
    """A `junction` element."""
    kind = _kind(element)
    if kind not in _KINDS:
        raise invalid(element, f"type={kind!r} is not a kind of junction")
    controllers = tuple(text(item, "id") for item in element.iterfind("controller"))
    found = tuple(_connection(item) for item in connections(element))
    return Junction(text(element, "id"), element.get("name", ""), kind, found, controllers)


def connections(junction: etree._Element) -> list[etree._Element]:
    """The connections of a junction that roads make: none of a crossing, those with a connecting road of a virtual one."""
    kind, found = _kind(junction), junction.findall("connection")
    if kind == "virtual":
        return [connection for connection in found if connection.get("connectingRoad") and connection.get("incomingRoad")]
    return [] if kind == "crossing" else found


def not_followed(root: etree._Element, path: Path) -> Iterator[Remark]:
    """A remark for each junction beside a main road with ways off it that have no road, or no place on it (`elementS`)."""
    lengths = {road.get("id"): number(road, "length") for road in root.iterfind("road")}
    placed = {
        (road.get("id"), link.get("elementId"))
        for road in root.iterfind("road")
        for link in road.iterfind("link/*[@elementS]")
        if 0.0 < number(link, "elementS") < lengths.get(link.get("elementId"), 0.0)
    }
    for junction in root.iterfind("junction"):
        kind, main = _kind(junction), junction.get("mainRoad")
        if kind not in ("virtual", "crossing"):
            continue
        ways = [(way.get("connectingRoad"), way.get("incomingRoad")) for way in junction.iterfind("connection")]
        left = [way for way in ways if kind == "crossing" or way[0] is None or (way[1] == main and way not in placed)]
        if left:
            share = "" if len(left) == len(ways) else f"{len(left)} of {len(ways)} "
            fault = f"junction: the {kind} junction {junction.get('id')!r} lies beside its main road"
            yield Remark(_FOLLOWED, f"{fault}; {share}ways off that road are not followed", str(path), line_of(junction))


def _kind(junction: etree._Element) -> str:
    return junction.get("type") or "default"


def _connection(element: etree._Element) -> Connection:
    return Connection(
        id=element.get("id", ""),
        incoming_road=text(element, "incomingRoad"),
        connecting_road=text(element, "linkedRoad" if element.get("linkedRoad") else "connectingRoad"),
        contact=contact_point(element) or "start",
        lane_links=tuple((_lane(item, "from"), _lane(item, "to")) for item in element.iterfind("laneLink")),
    )


def _lane(element: etree._Element, name: str) -> LaneRef:
    return LaneRef(integer(element, name), lane_layer(element, f"{name}Layer"))


def read_controller(element: etree._Element) -> Controller:
    """A `controller` element."""
    sequence = integer(element, "sequence") if element.get("sequence") else None
    signals = tuple(text(item, "signalId") for item in element.iterfind("control"))
    return Controller(text(element, "id"), element.get("name", ""), sequence, signals)
