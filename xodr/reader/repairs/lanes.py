"""Roads without lanes, lanes on the wrong side, lane links that lead nowhere."""

from __future__ import annotations

from collections.abc import Iterator

from lxml import etree

from xodr.reader.repairs.repair import SCHEMA, Repair, given, leave_out, value

RULE = "xosc.toolchain:xodr:1.4.0:road.lane.lane_sections_are_whole"


def repair_lanes(root: etree._Element) -> Iterator[Repair]:
    """Give every road a lane section, and every lane an id of its side."""
    for road in root.iterfind("road"):
        yield from _sections(road)
        for side, sign in (("left", 1), ("right", -1)):
            for section in road.iterfind(f"lanes/laneSection/{side}"):
                yield from _side(section, side, sign)
        for link in [*road.iterfind("lanes//link/predecessor"), *road.iterfind("lanes//link/successor")]:
            if value(link, "id") is None:
                leave_out(link)
                yield Repair(link, SCHEMA, given(link, "id", "is no lane"), "the link is left out")


def _sections(road: etree._Element) -> Iterator[Repair]:
    lanes, length = road.find("lanes"), value(road, "length")
    if lanes is None:
        lanes = etree.SubElement(road, "lanes")
    sections = lanes.findall("laneSection")
    if not sections:
        center = etree.SubElement(etree.SubElement(lanes, "laneSection", s="0"), "center")
        etree.SubElement(center, "lane", id="0")
        yield Repair(road, RULE, f"the road {road.get('id')!r} has no lane section", "it is read as a road without lanes")
    for section in sections[1:]:
        start = value(section, "s")
        if start is not None and length is not None and start >= length:
            leave_out(section)
            yield Repair(section, RULE, f"s={start:g} is not on the road, which is {length:g} m long", "the section is left out")


def _side(section: etree._Element, side: str, sign: int) -> Iterator[Repair]:
    lanes = section.findall("lane")
    ids = [value(lane, "id") for lane in lanes]
    if lanes and all(number is not None and number * sign < 0 for number in ids):
        for lane, number in zip(lanes, ids, strict=True):
            lane.set("id", f"{-(number or 0.0):.0f}")
        fault = f"the lane ids on the {side} side have the sign of the other side"
        yield Repair(lanes[0], RULE, fault, "read with the sign of their side")
