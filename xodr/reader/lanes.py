"""Reads lane sections: widths or borders become profiles of every lane's borders and centre, once, at load."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from operator import attrgetter
from typing import NamedTuple

from lxml import etree

from xodr.layers import Stretch, in_force
from xodr.model import NO_WIDTH, PERMANENT, TEMPORARY, Lane, LaneRef, LaneSection, RoadMark
from xodr.profiles import ZERO, Cubic, Profile, exceeding
from xodr.reader.elements import ascending, coefficients, integer, invalid, lane_layer, number, optional, profile, speed


class Layers(NamedTuple):
    """Lane sections in force, and the permanent ones where a road has temporary lanes, too."""

    in_force: list[LaneSection]
    permanent: list[LaneSection] | None


def read_layers(road: etree._Element, length: float) -> Layers:
    """The lane sections of a `road` element of that length [m]."""
    layers: dict[str, etree._Element] = {}
    for lanes in road.iterfind("lanes"):
        if layers.setdefault(lane_layer(lanes), lanes) is not lanes:
            raise invalid(lanes, f"the road has another {lane_layer(lanes)} layer of lanes; one is allowed")
    if PERMANENT not in layers:
        raise invalid(road, "the element lanes is missing")
    permanent = read_sections(layers[PERMANENT], length)
    if TEMPORARY not in layers:
        return Layers(permanent, None)
    return Layers(in_force(permanent, _temporary(layers[TEMPORARY], length)), permanent)


def _temporary(lanes: etree._Element, length: float) -> list[Stretch]:
    """Sections of the temporary layer. Each holds for its `length`, or up to the next one of its side."""
    elements = lanes.findall("laneSection")
    starts = ascending(elements, "s")
    offset = profile(lanes.findall("laneOffset"))
    found = []
    for index, (element, start) in enumerate(zip(elements, starts, strict=True)):
        until = min(start + number(element, "length", math.inf) if element.get("length") else math.inf, length)
        following = list(zip(elements, starts, strict=True))[index + 1 :]
        ends = [
            min([until, *(s for other, s in following if _covers(other, side))]) if _covers(element, side) else start
            for side in ("left", "right")
        ]
        if max(ends) > start:
            found.append(Stretch(_section(element, start, max(ends), offset, TEMPORARY), *ends))
    return found


def _covers(section: etree._Element, side: str) -> bool:
    """Whether a lane section says which lanes there are on a side."""
    return not _single_sided(section) or section.find(side) is not None


def _single_sided(section: etree._Element) -> bool:
    return section.get("singleSide") in ("true", "1")


def read_sections(lanes: etree._Element, length: float) -> list[LaneSection]:
    """The lane sections of one layer along a road of that length [m], from its `lanes` element."""
    elements = lanes.findall("laneSection")
    if not elements:
        raise invalid(lanes, "a road has at least one laneSection")
    starts = ascending(elements, "s")
    starts[0] = 0.0
    offset = profile(lanes.findall("laneOffset"))
    sections: list[LaneSection] = []
    for element, (start, end) in zip(elements, pairwise([*starts, length]), strict=True):
        if end <= start:
            if element is elements[-1]:
                raise invalid(element, f"the section starts at s={start:g}, but the road is only {length:g} m long")
            continue  # a section of no length, as some editors leave behind
        section = _section(element, start, end, offset)
        if _single_sided(element) and sections:
            _continue_other_side(sections[-1], section)
        sections.append(section)
    return sections


def _section(element: etree._Element, start: float, end: float, offset: Profile, layer: str = PERMANENT) -> LaneSection:
    center = offset.within(start, end)
    middle = element.find("center/lane")
    marks = _marks(middle, start) if middle is not None else ()
    lanes = {0: Lane(0, "none", False, None, None, ZERO, center, center, center, marks=marks, layer=layer)}
    for side, sign in (("left", 1), ("right", -1)):
        items: dict[int, etree._Element] = {}
        for item in element.iterfind(f"{side}/lane"):
            if items.setdefault(integer(item, "id"), item) is not item:
                raise invalid(item, f"the lane id {item.get('id')} is there twice in one lane section")
        inner = center
        for lane_id in sorted(items, key=abs):
            if lane_id * sign <= 0:
                raise invalid(items[lane_id], f"the lane id {lane_id} does not belong on the {side} side")
            lane = replace(_lane(items[lane_id], lane_id, (start, end), inner, center), layer=layer)
            lanes[lane_id] = lane
            inner = lane.outer
    return LaneSection(start, end, lanes)


def _lane(element: etree._Element, lane_id: int, ends: tuple[float, float], inner: Profile, center: Profile) -> Lane:
    start = ends[0]
    sign = 1.0 if lane_id > 0 else -1.0
    widths, borders = element.findall("width"), element.findall("border")
    if widths or not borders:
        width = _relative(widths, start)
        outer = inner.plus(width, sign)
    else:
        border = _relative(borders, start)
        # written as t by the standard; some writers give the distance, without the sign of the right side
        outer = center.plus(border, 1.0 if border(start) * sign >= 0.0 else -1.0)
        width = outer.plus(inner, -1.0) if sign > 0.0 else inner.plus(outer, -1.0)
    opens, closes = exceeding(width, NO_WIDTH, *ends)
    predecessors, successors = _linked(element, "predecessor"), _linked(element, "successor")
    return Lane(
        id=lane_id,
        type=element.get("type", "none"),
        level=element.get("level") in ("true", "1"),
        predecessor=_continuing(predecessors),
        successor=_continuing(successors),
        width=width,
        inner=inner,
        outer=outer,
        center=inner.plus(width, 0.5 * sign),
        direction=_direction(element),
        opens=opens,
        closes=closes,
        speeds=_speeds(element, start),
        marks=_marks(element, start),
        predecessors=predecessors,
        successors=successors,
        road_works=element.get("roadWorks") in ("true", "1"),
    )


def _relative(elements: list[etree._Element], start: float) -> Profile:
    """Width or border records, whose `sOffset` counts from the section's start; a lane without any has no width."""
    if not elements:
        return ZERO
    offsets = ascending(elements, "sOffset", distinct=True)
    pieces = {
        start + offset: Cubic(start + offset, *coefficients(element)) for offset, element in zip(offsets, elements, strict=True)
    }
    return Profile(pieces.values())


def _linked(element: etree._Element, name: str) -> tuple[LaneRef, ...]:
    return tuple(LaneRef(integer(link, "id"), lane_layer(link)) for link in element.iterfind(f"link/{name}"))


def _continuing(links: tuple[LaneRef, ...]) -> int | None:
    """Id of the permanent lane that continues a lane. It may link several since 1.8: the first of them."""
    return next((link.id for link in links if link.layer == PERMANENT), None)


def _direction(element: etree._Element) -> str:
    direction = element.get("direction") or "standard"
    if direction not in ("standard", "reversed", "both"):
        raise invalid(element, f"direction={direction!r} is not one of standard, reversed, both")
    return direction


def _speeds(element: etree._Element, start: float) -> tuple[tuple[float, float | None], ...]:
    records = element.findall("speed")
    return tuple((start + offset, speed(record)) for offset, record in zip(ascending(records, "sOffset"), records, strict=True))


def _marks(element: etree._Element, start: float) -> tuple[RoadMark, ...]:
    marks = [
        RoadMark(
            start + number(record, "sOffset", 0.0), record.get("type") or "none", record.get("color") or "standard",
            optional(record, "width"),
        )
        for record in element.iterfind("roadMark")
    ]  # fmt: skip
    return tuple(sorted(marks, key=attrgetter("s")))


def _continue_other_side(before: LaneSection, section: LaneSection) -> None:
    """A single-sided section changes one side only: the lanes of the other side go on from the section before."""
    moved = section.lanes[0].center.plus(before.lanes[0].center, -1.0)
    for lane_id in before.left if not section.left else before.right:
        lane = before.lanes[lane_id]
        inner, outer, center = (line.plus(moved) for line in (lane.inner, lane.outer, lane.center))
        section.lanes[lane_id] = replace(lane, predecessor=lane_id, inner=inner, outer=outer, center=center)
        lane.successor = lane_id
    section.__post_init__()
