"""Reads roads: plan view, elevation, lateral profile, links and types; lane sections, as profiles
of borders and centres."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from operator import attrgetter
from pathlib import Path
from typing import NamedTuple

from lxml import etree

from xodr.model import (
    NO_WIDTH,
    PERMANENT,
    TEMPORARY,
    Lane,
    LaneAccess,
    LaneRef,
    LaneSection,
    RoadLink,
    RoadMark,
    RoadType,
    TemporaryStretch,
    in_force,
)
from xodr.model.geometry import (
    ZERO,
    Arc,
    Cubic,
    Line,
    ParamPoly3,
    PlanElement,
    Profile,
    ReferenceLine,
    Spiral,
    Start,
    exceeding,
    poly3,
)
from xodr.model.road import Road, Surface
from xodr.reader.elements import (
    ascending,
    coefficients,
    contact_point,
    integer,
    invalid,
    lane_layer,
    number,
    optional,
    profile,
    read_object,
    read_signal,
    read_signal_reference,
    read_structure,
    speed,
    text,
)

# lanes ------------------------------------------------------------------------------------------


class Layers(NamedTuple):
    """Lane sections in force, and the permanent ones where a road has temporary lanes, too."""

    in_force: list[LaneSection]
    permanent: list[LaneSection] | None


def read_layers(road: etree._Element, length: float) -> Layers:
    """The lane sections of a `road` element of that length [m]."""
    layers: dict[str, etree._Element] = {}
    for lanes in road.iterfind("lanes"):
        if layers.setdefault(lane_layer(lanes), lanes) is not lanes:
            raise invalid(
                lanes, f"the road has another {lane_layer(lanes)} layer of lanes; one is allowed"
            )
    if PERMANENT not in layers:
        raise invalid(road, "the element lanes is missing")
    permanent = read_sections(layers[PERMANENT], length)
    if TEMPORARY not in layers:
        return Layers(permanent, None)
    return Layers(in_force(permanent, _temporary(layers[TEMPORARY], length)), permanent)


def _temporary(lanes: etree._Element, length: float) -> list[TemporaryStretch]:
    """Sections of the temporary layer. Each holds for its `length`, or up to the next one of its
    side."""
    elements = lanes.findall("laneSection")
    starts = ascending(elements, "s")
    offset = profile(lanes.findall("laneOffset"))
    temporary = []
    for index, (element, start) in enumerate(zip(elements, starts, strict=True)):
        until = min(
            start + number(element, "length", math.inf) if element.get("length") else math.inf,
            length,
        )
        # A single-sided section leaves the other side as it is, so it ends sections of its own side
        # only.
        following = list(zip(elements, starts, strict=True))[index + 1 :]
        ends = [
            min([until, *(s for other, s in following if _covers(other, side))])
            if _covers(element, side)
            else start
            for side in ("left", "right")
        ]
        if max(ends) > start:
            temporary.append(
                TemporaryStretch(_section(element, start, max(ends), offset, TEMPORARY), *ends)
            )
    return temporary


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
    # Lanes are there from the start of the road, however a file rounds or shifts the first section.
    starts[0] = 0.0
    offset = profile(lanes.findall("laneOffset"))
    sections: list[LaneSection] = []
    for element, (start, end) in zip(elements, pairwise([*starts, length]), strict=True):
        # Sections of no length before others are left over from editing; the last one would leave
        # the road's end without lanes.
        if end <= start:
            if element is elements[-1]:
                raise invalid(
                    element,
                    f"the section starts at s={start:g}, but the road is only {length:g} m long",
                )
            continue  # a section of no length, as some editors leave behind
        section = _section(element, start, end, offset)
        if _single_sided(element) and sections:
            _continue_other_side(sections[-1], section)
        sections.append(section)
    return sections


def _section(
    element: etree._Element, start: float, end: float, offset: Profile, layer: str = PERMANENT
) -> LaneSection:
    center = offset.within(start, end)
    middle = element.find("center/lane")
    marks = _marks(middle, start) if middle is not None else ()
    lanes = {
        0: Lane(
            0, "none", False, None, None, ZERO, center, center, center, marks=marks, layer=layer
        )
    }
    for side, sign in (("left", 1), ("right", -1)):
        items: dict[int, etree._Element] = {}
        for item in element.iterfind(f"{side}/lane"):
            if items.setdefault(integer(item, "id"), item) is not item:
                raise invalid(
                    item, f"the lane id {item.get('id')} is there twice in one lane section"
                )
        inner = center
        # From the centre outwards: each lane lies against the outer border of the one before it.
        for lane_id in sorted(items, key=abs):
            if lane_id * sign <= 0:
                raise invalid(
                    items[lane_id], f"the lane id {lane_id} does not belong on the {side} side"
                )
            lane = replace(_lane(items[lane_id], lane_id, (start, end), inner, center), layer=layer)
            lanes[lane_id] = lane
            inner = lane.outer
    return LaneSection(start, end, lanes)


def _lane(
    element: etree._Element,
    lane_id: int,
    ends: tuple[float, float],
    inner: Profile,
    center: Profile,
) -> Lane:
    start = ends[0]
    sign = 1.0 if lane_id > 0 else -1.0
    widths, borders = element.findall("width"), element.findall("border")
    # Widths win where a lane has both (OpenDRIVE 1.9, 11.7.1).
    if widths or not borders:
        width = _relative(widths, start)
        outer = inner.plus(width, sign)
    else:
        border = _relative(borders, start)
        # written as t by the standard; some writers give the distance, without the sign of the
        # right side
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
        accesses=_accesses(element, start),
        heights=_heights(element, start),
    )


def _heights(element: etree._Element, start: float) -> tuple[tuple[float, float, float], ...]:
    """Height records, by s; none where all heights are 0."""
    records = element.findall("height")
    offsets = ascending(records, "sOffset") if records else []
    heights = tuple(
        (start + offset, number(record, "inner"), number(record, "outer"))
        for offset, record in zip(offsets, records, strict=True)
    )
    return heights if any(inner or outer for _, inner, outer in heights) else ()


def _relative(elements: list[etree._Element], start: float) -> Profile:
    """Width or border records as a function of s; a lane without any has no width."""
    if not elements:
        return ZERO
    offsets = ascending(elements, "sOffset", distinct=True)
    pieces = {
        # By place, so that a record that is repeated counts once.
        start + offset: Cubic(start + offset, *coefficients(element))
        for offset, element in zip(offsets, elements, strict=True)
    }
    return Profile(pieces.values())


def _linked(element: etree._Element, name: str) -> tuple[LaneRef, ...]:
    return tuple(
        LaneRef(integer(link, "id"), lane_layer(link)) for link in element.iterfind(f"link/{name}")
    )


def _continuing(links: tuple[LaneRef, ...]) -> int | None:
    """Id of the permanent lane that continues a lane. It may link several since 1.8: the first of
    them."""
    return next((link.id for link in links if link.layer == PERMANENT), None)


def _direction(element: etree._Element) -> str:
    direction = element.get("direction") or "standard"
    if direction not in ("standard", "reversed", "both"):
        raise invalid(element, f"direction={direction!r} is not one of standard, reversed, both")
    return direction


def _speeds(element: etree._Element, start: float) -> tuple[tuple[float, float | None], ...]:
    records = element.findall("speed")
    return tuple(
        (start + offset, speed(record))
        for offset, record in zip(ascending(records, "sOffset"), records, strict=True)
    )


def _accesses(element: etree._Element, start: float) -> tuple[LaneAccess, ...]:
    """Access restrictions by place.

    Since OpenDRIVE 1.8 one element has all of them, before that each road user has its own.
    """
    accesses: dict[float, LaneAccess] = {}
    for record in element.iterfind("access"):
        s = start + number(record, "sOffset", 0.0)
        named = [
            record.get("restriction"),
            *(restriction.get("type") for restriction in record.iterfind("restriction")),
        ]
        before = accesses[s].users if s in accesses else ()
        users = tuple(user for user in named if user and user != "none")
        accesses[s] = LaneAccess(s, record.get("rule", "deny") == "allow", before + users)
    return tuple(accesses[s] for s in sorted(accesses))


def _marks(element: etree._Element, start: float) -> tuple[RoadMark, ...]:
    marks = [
        RoadMark(
            start + number(record, "sOffset", 0.0), record.get("type") or "none",
            record.get("color") or "standard",
            optional(record, "width"), record.get("laneChange", ""),
        )
        for record in element.iterfind("roadMark")
    ]  # fmt: skip
    return tuple(sorted(marks, key=attrgetter("s")))


def _continue_other_side(before: LaneSection, section: LaneSection) -> None:
    """Continue the lanes of the section before on the side that a single-sided section omits."""
    # The borders of lanes are t from the reference line, so a new lane offset shifts those of the
    # other side, too.
    moved = section.lanes[0].center.plus(before.lanes[0].center, -1.0)
    for lane_id in before.left if not section.left else before.right:
        lane = before.lanes[lane_id]
        inner, outer, center = (line.plus(moved) for line in (lane.inner, lane.outer, lane.center))
        section.lanes[lane_id] = replace(
            lane, predecessor=lane_id, inner=inner, outer=outer, center=center
        )
        lane.successor = lane_id
    # Lanes were added, on which the section's sides and borders depend.
    section.__post_init__()


# roads ------------------------------------------------------------------------------------------


_TOO_SHORT = 1e-9


def read_road(path: Path, element: etree._Element) -> Road:
    """A `road` element of the file at `path`."""
    road_id, length = text(element, "id"), number(element, "length")
    if length <= 0.0:
        raise invalid(element, f"length={length:g} must be positive")
    junction, rule = element.get("junction", "-1"), element.get("rule") or "RHT"
    if rule not in ("RHT", "LHT"):
        raise invalid(element, f"rule={rule!r} is neither RHT nor LHT")
    layers = read_layers(element, length)
    return Road(
        path=str(path),
        id=road_id,
        name=element.get("name", ""),
        length=length,
        junction_id=None if junction in ("-1", "") else junction,
        rule=rule,
        line=_reference_line(element),
        sections=layers.in_force,
        permanent=layers.permanent,
        elevation=profile(element.findall("elevationProfile/elevation")),
        superelevation=profile(element.findall("lateralProfile/superelevation")),
        surface=_surface(element),
        types=_road_types(element),
        predecessor=_road_link(element.find("link/predecessor")),
        successor=_road_link(element.find("link/successor")),
        signals=[read_signal(signal, road_id) for signal in element.iterfind("signals/signal")],
        signal_references=[
            read_signal_reference(signal) for signal in element.iterfind("signals/signalReference")
        ],
        objects=[read_object(item, road_id) for item in element.iterfind("objects/object")],
        structures=[
            read_structure(item)
            for kind in ("bridge", "tunnel")
            for item in element.iterfind(f"objects/{kind}")
        ],
    )


def _road_link(element: etree._Element | None) -> RoadLink | None:
    if element is None:
        return None
    kind = text(element, "elementType")
    if kind not in ("road", "junction"):
        raise invalid(element, f"elementType={kind!r} is neither road nor junction")
    name, is_road = text(element, "elementId"), kind == "road"
    return RoadLink(
        kind,
        name,
        contact_point(element) if is_road else None,
        optional(element, "elementS") if is_road else None,
    )


def _road_types(element: etree._Element) -> list[RoadType]:
    elements = element.findall("type")
    limits = [item.find("speed") for item in elements]
    return [
        RoadType(start, item.get("type", "unknown"), speed(limit) if limit is not None else None)
        for start, item, limit in zip(ascending(elements, "s"), elements, limits, strict=True)
    ]


# plan view ----------------------------------------------------------------------------------


def _reference_line(road: etree._Element) -> ReferenceLine:
    # Exporters leave elements of no length between others: the next one begins at their place.
    elements = road.findall("planView/geometry")
    starts = ascending(elements, "s")
    kept = [
        (start, item)
        for start, item in zip(starts, elements, strict=True)
        if _geometry_length(item) > _TOO_SHORT
    ]
    if not kept:
        raise invalid(road, "planView has no geometry with a length")
    segments = []
    for _, item in kept:
        try:
            segments.append(_segment(item))
        except ValueError as error:
            raise invalid(item, str(error)) from None
    return ReferenceLine([start for start, _ in kept], segments)


def _geometry_length(element: etree._Element) -> float:
    length = number(element, "length")
    if length < 0.0:
        raise invalid(element, f"length={length:g} must not be negative")
    return length


def _segment(element: etree._Element) -> PlanElement:
    start = Start(
        number(element, "x"),
        number(element, "y"),
        number(element, "hdg"),
        number(element, "length"),
    )
    shape = next((child for child in element if child.tag in _SHAPES), None)
    if shape is None:
        names = (
            ", ".join(str(child.tag) for child in element if isinstance(child.tag, str))
            or "nothing"
        )
        raise invalid(element, f"a geometry is one of {', '.join(_SHAPES)}; found {names}")
    return _SHAPES[shape.tag](start, shape)


def _spiral(start: Start, shape: etree._Element) -> PlanElement:
    return Spiral(start, number(shape, "curvStart"), number(shape, "curvEnd"))


def _poly3(start: Start, shape: etree._Element) -> PlanElement:
    return poly3(start, [number(shape, name) for name in "abcd"])


def _param_poly3(start: Start, shape: etree._Element) -> PlanElement:
    # Required since OpenDRIVE 1.5; files of 1.4 may leave it out.
    p_range = shape.get("pRange") or "normalized"
    if p_range not in ("arcLength", "normalized"):
        raise invalid(shape, f"pRange={p_range!r} is neither arcLength nor normalized")
    u, v = ([number(shape, name + axis) for name in "abcd"] for axis in "UV")
    return ParamPoly3(start, u, v, start.length if p_range == "arcLength" else 1.0)


_SHAPES: dict[str, Callable[[Start, etree._Element], PlanElement]] = {
    "line": lambda start, _: Line(start),
    "arc": lambda start, shape: Arc(start, number(shape, "curvature")),
    "spiral": _spiral,
    "poly3": _poly3,
    "paramPoly3": _param_poly3,
}


# lateral profile ----------------------------------------------------------------------------


def _surface(road: etree._Element) -> Surface | None:
    shapes = road.findall("lateralProfile/shape")
    crossfalls = road.findall("lateralProfile/crossfall")
    if not shapes and not crossfalls:
        return None
    # Shapes of one s make up one cross-section; between two of them the surface is interpolated.
    by_s: dict[float, list[etree._Element]] = {}
    for s, element in zip(ascending(shapes, "s"), shapes, strict=True):
        by_s.setdefault(s, []).append(element)
    left, right = (
        profile(
            [element for element in crossfalls if element.get("side", "both") in (side, "both")]
        )
        for side in ("left", "right")
    )
    return Surface([(s, _lateral(elements)) for s, elements in by_s.items()], left, right)


def _lateral(elements: list[etree._Element]) -> Profile:
    starts = ascending(elements, "t", distinct=True)
    return Profile(
        Cubic(t, *coefficients(element)) for t, element in zip(starts, elements, strict=True)
    )
