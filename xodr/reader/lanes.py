"""Reads lane sections: widths or borders become profiles of every lane's borders and centre, once, at load."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from operator import attrgetter

from lxml import etree

from xodr.model import Lane, LaneSection, RoadMark
from xodr.profiles import ZERO, Cubic, Profile, exceeding
from xodr.reader.elements import ascending, coefficients, integer, invalid, number, optional, profile, speed
from xodr.road import NO_WIDTH


def read_sections(lanes: etree._Element, length: float) -> list[LaneSection]:
    """The lane sections of a road of that length [m], from its `lanes` element."""
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
        if element.get("singleSide") in ("true", "1") and sections:
            _continue_other_side(sections[-1], section)
        sections.append(section)
    return sections


def _section(element: etree._Element, start: float, end: float, offset: Profile) -> LaneSection:
    center = offset.within(start, end)
    middle = element.find("center/lane")
    marks = _marks(middle, start) if middle is not None else ()
    lanes = {0: Lane(0, "none", False, None, None, ZERO, center, center, center, marks=marks)}
    for side, sign in (("left", 1), ("right", -1)):
        items = {integer(item, "id"): item for item in element.iterfind(f"{side}/lane")}
        inner = center
        for lane_id in sorted(items, key=abs):
            if lane_id * sign <= 0:
                raise invalid(items[lane_id], f"the lane id {lane_id} does not belong on the {side} side")
            lane = _lane(items[lane_id], lane_id, (start, end), inner, center)
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
    return Lane(
        id=lane_id,
        type=element.get("type", "none"),
        level=element.get("level") in ("true", "1"),
        predecessor=_linked(element, "predecessor"),
        successor=_linked(element, "successor"),
        width=width,
        inner=inner,
        outer=outer,
        center=inner.plus(width, 0.5 * sign),
        direction=_direction(element),
        opens=opens,
        closes=closes,
        speeds=_speeds(element, start),
        marks=_marks(element, start),
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


def _linked(element: etree._Element, name: str) -> int | None:
    """Id of the linked lane. A lane may link several in 1.8; the first is the one that continues it."""
    link = element.find(f"link/{name}")
    return integer(link, "id") if link is not None else None


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
