"""Reads junctions with their connections, and controllers of signals."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from lxml import etree

from schemas.remarks import Remark
from schemas.xml import line_of
from xodr.model import Connection, Controller, Junction
from xodr.reader.elements import contact_point, integer, invalid, text

_KINDS = ("default", "direct", "virtual", "crossing")
_BESIDE = ("virtual", "crossing")
"""Kinds of junctions that do not interrupt their main road."""


def read_junction(element: etree._Element) -> Junction:
    """A `junction` element."""
    kind = _kind(element)
    if kind not in _KINDS:
        raise invalid(element, f"type={kind!r} is not a kind of junction")
    controllers = tuple(text(item, "id") for item in element.iterfind("controller"))
    found = tuple(_connection(item) for item in connections(element))
    return Junction(text(element, "id"), element.get("name", ""), kind, found, controllers)


def connections(junction: etree._Element) -> list[etree._Element]:
    """The connections of a junction between ends of roads; none where it lies beside its main road."""
    return [] if _kind(junction) in _BESIDE else junction.findall("connection")


def not_followed(root: etree._Element, path: Path) -> Iterator[Remark]:
    """A remark for each junction beside a main road: the roads that leave it there are not linked."""
    for junction in root.iterfind("junction"):
        kind = _kind(junction)
        if kind in _BESIDE and junction.find("connection") is not None:
            fault = f"junction: the {kind} junction {junction.get('id')!r} lies beside its main road"
            remark = f"{fault}; ways off that road are not followed"
            yield Remark("xosc.toolchain:xodr:1.5.0:junction.connections_are_followed", remark, str(path), line_of(junction))


def _kind(junction: etree._Element) -> str:
    return junction.get("type") or "default"


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
