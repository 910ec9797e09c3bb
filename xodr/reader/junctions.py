"""Reads junctions with their connections, and controllers of signals."""

from __future__ import annotations

import logging

from lxml import etree

from schemas.xml import line_of
from xodr.model import Connection, Controller, Junction
from xodr.reader.elements import contact_point, integer, invalid, text

_log = logging.getLogger(__name__)


def read_junction(element: etree._Element) -> Junction:
    """A `junction` element."""
    kind = element.get("type") or "default"
    if kind not in ("default", "direct", "virtual", "crossing"):
        raise invalid(element, f"type={kind!r} is not a kind of junction")
    connections = tuple(_connection(item) for item in element.iterfind("connection"))
    if kind in ("virtual", "crossing") and connections:
        place = f"{element.getroottree().docinfo.URL}:{line_of(element)}"
        _log.warning("%s: %s junction %r: its main road is followed, ways off it are not", place, kind, element.get("id"))
        connections = ()
    controllers = tuple(text(item, "id") for item in element.iterfind("controller"))
    return Junction(text(element, "id"), element.get("name", ""), kind, connections, controllers)


def _connection(element: etree._Element) -> Connection:
    return Connection(
        id=element.get("id", ""),
        incoming_road=text(element, "incomingRoad"),
        connecting_road=text(element, "linkedRoad" if element.get("linkedRoad") else "connectingRoad"),
        contact=contact_point(element) or "start",
        lane_links=tuple((integer(item, "from"), integer(item, "to")) for item in element.iterfind("laneLink")),
    )


def read_controller(element: etree._Element) -> Controller:
    """A `controller` element."""
    sequence = integer(element, "sequence") if element.get("sequence") else None
    signals = tuple(text(item, "signalId") for item in element.iterfind("control"))
    return Controller(text(element, "id"), element.get("name", ""), sequence, signals)
