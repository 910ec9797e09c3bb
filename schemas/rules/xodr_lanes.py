"""Lane sections are complete."""

from collections.abc import Iterator

from lxml import etree

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule

_SIDES = {"left": 1, "center": 0, "right": -1}


@rule("xosc.toolchain:xodr:1.4.0:road.lane.lane_sections_are_whole")
def check(document: Document) -> Iterator[Finding]:
    """A road must have lane sections with ascending s, each with a centre lane and lanes numbered without gaps from it."""
    for road in document.elements("road"):
        sections = road.findall("{*}lanes/{*}laneSection")
        if not sections:
            yield Finding(road, "the road has no lane section")
        last, length = -1.0, document.number(road, "length")
        for section in sections:
            s = document.number(section, "s")
            if s is not None and length is not None and s > max(length, 0.0):
                yield Finding(section, f"s={s:g}, but the road is only {length:g} m long")
            if s is not None and not s > last:
                yield Finding(section, f"s={s:g} is not greater than that of the lane section before it")
            last = last if s is None else s
            for side in _SIDES:
                yield from _numbering(document, section, side)


def _numbering(document: Document, section: etree._Element, side: str) -> Iterator[Finding]:
    sign, lanes = _SIDES[side], section.findall(f"{{*}}{side}/{{*}}lane")
    ids = [number for lane in lanes if (number := document.number(lane, "id")) is not None]
    if sign == 0:
        if ids != [0]:
            yield Finding(section, "one centre lane with the id 0 is expected")
    elif len(ids) == len(lanes) and sorted(number * sign for number in ids) != list(range(1, len(ids) + 1)):
        given = ", ".join(f"{number:g}" for number in ids)
        yield Finding(section, f"the lane ids on the side {side} are {given}, numbers without gaps from {sign} on are expected")
