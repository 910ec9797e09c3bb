"""Records along roads and lanes ascend."""

from collections.abc import Iterator
from itertools import pairwise

from lxml import etree

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule

_OF_ROADS = {
    "{*}type": ("s",),
    "{*}planView/{*}geometry": ("s",),
    "{*}elevationProfile/{*}elevation": ("s",),
    "{*}lateralProfile/{*}superelevation": ("s",),
    "{*}lateralProfile/{*}shape": ("s", "t"),
    "{*}lanes/{*}laneOffset": ("s",),
}
_OF_LANES = {"{*}width": ("sOffset",), "{*}border": ("sOffset",), "{*}speed": ("sOffset",)}


@rule("xosc.toolchain:xodr:1.4.0:road.records_ascend")
def check(document: Document) -> Iterator[Finding]:
    """The records of roads and lanes (geometry, elevation, shape, width, …) must ascend, one at a place."""
    for tag, records in (("road", _OF_ROADS), ("lane", _OF_LANES)):
        for element in document.elements(tag):
            for path, names in records.items():
                yield from _ascending(document, element.findall(path), names)


def _ascending(document: Document, records: list[etree._Element], names: tuple[str, ...]) -> Iterator[Finding]:
    for before, after in pairwise(records):
        first, second = ([document.number(record, name) for name in names] for record in (before, after))
        start, here = ([number for number in place if number is not None] for place in (first, second))
        if not len(start) == len(here) == len(names):
            continue
        place = " ".join(f"{name}={number:g}" for name, number in zip(names, here, strict=True))
        if here < start:
            yield Finding(after, f"{place} is less than that of the record before it")
        elif here == start:
            alike = before.items() == after.items()
            yield Finding(after, f"{place} must differ from that of the record before it", "warning" if alike else None)
