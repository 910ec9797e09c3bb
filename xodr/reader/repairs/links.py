"""Links and connections to roads and junctions that the file does not have."""

from __future__ import annotations

from collections.abc import Iterator

from lxml import etree

from xodr.reader.junctions import connections
from xodr.reader.repairs.repair import SCHEMA, Repair, given, leave_out, value

RULE = "xosc.toolchain:xodr:1.4.0:road.linkage.linked_elements_exist"


def repair_links(root: etree._Element) -> Iterator[Repair]:
    """Leave out links and connections that lead nowhere; complete those that do not say where they lead."""
    known = {kind: {element.get("id") for element in root.iterfind(kind)} for kind in ("road", "junction")}
    for road in root.iterfind("road"):
        for link in road.findall("link/*"):
            yield from _link(link, known)
    for junction in root.iterfind("junction"):
        for connection in connections(junction):
            yield from _connection(connection, known["road"])


def _link(link: etree._Element, known: dict[str, set[str | None]]) -> Iterator[Repair]:
    if link.tag not in ("predecessor", "successor"):
        return
    kind, name = link.get("elementType"), link.get("elementId")
    if kind not in known:
        kinds = [kind for kind, names in known.items() if name in names]
        if len(kinds) == 1:
            fault = given(link, "elementType", "is neither road nor junction")
            link.set("elementType", kinds[0])
            yield Repair(link, SCHEMA, fault, "the only element of that id is linked")
            return
    if name not in known.get(kind or "", ()):
        leave_out(link)
        yield Repair(link, RULE, f"the {kind} {name!r} does not exist", "the link is left out")
    elif link.get("elementS") and value(link, "elementS") is None:
        leave_out(link)
        yield Repair(link, SCHEMA, given(link, "elementS", "is not a number"), "the link is left out")
    elif link.get("contactPoint") not in ("start", "end", None):
        fault = given(link, "contactPoint", "is neither start nor end")
        del link.attrib["contactPoint"]
        yield Repair(link, SCHEMA, fault, "the nearer end is linked")


def _connection(connection: etree._Element, roads: set[str | None]) -> Iterator[Repair]:
    ends = ("incomingRoad", "linkedRoad" if connection.get("linkedRoad") else "connectingRoad")
    for name in ends:
        road = connection.get(name)
        if road not in roads:
            leave_out(connection)
            fault = given(connection, name, "does not exist")
            yield Repair(connection, SCHEMA if road is None else RULE, fault, "the connection is left out")
            return
    for link in connection.findall("laneLink"):
        if value(link, "from") is None or value(link, "to") is None:
            leave_out(link)
            yield Repair(link, SCHEMA, "from and to are not both lanes", "the link is left out")
