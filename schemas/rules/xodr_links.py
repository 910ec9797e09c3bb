"""Roads and junctions refer to each other by ids that exist."""

from collections.abc import Iterator

from lxml import etree

from schemas.checks.document import Document
from schemas.checks.messages import unknown
from schemas.checks.registry import Finding, rule


@rule("xosc.toolchain:xodr:1.4.0:road.linkage.linked_elements_exist")
def check(document: Document) -> Iterator[Finding]:
    """Links of roads and connections of junctions must name roads and junctions of the file."""
    known = {tag: {element.get("id") or "" for element in document.elements(tag)} for tag in ("road", "junction")}
    for road in document.elements("road"):
        yield from _unknown(road, "junction", "junction", known["junction"])
        for end in road.iterfind("{*}link/{*}*"):
            kind = end.get("elementType") or ""
            if kind in known:
                yield from _unknown(end, "elementId", kind, known[kind])
    for connection in document.elements("connection"):
        for attribute in ("incomingRoad", "connectingRoad", "linkedRoad"):
            yield from _unknown(connection, attribute, "road", known["road"])


def _unknown(element: etree._Element, attribute: str, kind: str, known: set[str]) -> Iterator[Finding]:
    identity = element.get(attribute)
    if identity and identity != "-1" and identity not in known:
        yield Finding(element, f"{attribute}: {unknown(kind, identity, known)}")
