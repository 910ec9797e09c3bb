"""Lanes continue in lanes that exist."""

from collections.abc import Iterator
from itertools import pairwise

from lxml import etree

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule


@rule("xosc.toolchain:xodr:1.4.0:road.lane.link.linked_lanes_exist")
def check(document: Document) -> Iterator[Finding]:
    """Within a road, the predecessor and successor of a lane must be lanes of the neighbouring lane section."""
    for road in document.elements("road"):
        sections = road.findall("{*}lanes/{*}laneSection")
        for before, after in pairwise(sections):
            yield from _links(before, "successor", after)
            yield from _links(after, "predecessor", before)


def _links(section: etree._Element, direction: str, neighbour: etree._Element) -> Iterator[Finding]:
    known = {lane.get("id") for lane in neighbour.iterfind("{*}*/{*}lane")}
    for link in section.iterfind(f"{{*}}*/{{*}}lane/{{*}}link/{{*}}{direction}"):
        if link.get("id") is not None and link.get("id") not in known:
            yield Finding(link, f"the {direction} {link.get('id')} is no lane of the neighbouring lane section")
