"""Road networks (OpenDRIVE): ids, links, reference lines, lanes, records and numbers; linked roads
and lanes must touch."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

from lxml import etree

from schemas.checks.document import CheckedDocument
from schemas.checks.registry import Finding, rule, unknown
from schemas.common.errors import ToolchainError
from xodr.graph.network import RoadNetwork
from xodr.model.road import Road
from xodr.reader.document import cross_path_gaps, linked_roads, load
from xodr.reader.elements import read_cross_path
from xodr.rules.lanes import DRIVABLE
from xodr.rules.sections import (
    PERMANENT,
    SAME_BORDER,
    Section,
    SectionMeeting,
    integer,
    layer_of,
    meetings,
    sections_by_layer,
    single_sided,
)


@rule("asam.net:xodr:1.4.0:ids.id_unique_in_class")
def ids_are_unique(document: CheckedDocument) -> Iterator[Finding]:
    """The ids of roads, of junctions, of controllers and of signals must each be unique."""
    for tag in ("road", "junction", "controller", "signal"):
        seen: set[str] = set()
        for element in document.elements(tag):
            identity = element.get("id")
            if identity is None or (
                # Inside a junction, `controller` refers to one and so repeats its id.
                tag == "controller" and element.getparent() is not document.root
            ):
                continue
            if identity in seen:
                yield Finding(element, f"another {tag} has the id {identity!r}")
            seen.add(identity)


@rule("xosc.toolchain:xodr:1.4.0:road.linkage.linked_elements_exist")
def linked_roads_exist(document: CheckedDocument) -> Iterator[Finding]:
    """Links of roads and connections of junctions must name roads and junctions of the file."""
    known = {
        tag: {element.get("id") or "" for element in document.elements(tag)}
        for tag in ("road", "junction")
    }
    for road in document.elements("road"):
        yield from _unknown(road, "junction", "junction", known["junction"])
        for end in road.iterfind("{*}link/{*}*"):
            kind = end.get("elementType") or ""
            if kind in known:
                yield from _unknown(end, "elementId", kind, known[kind])
    for connection in document.elements("connection"):
        for attribute in ("incomingRoad", "connectingRoad", "linkedRoad"):
            yield from _unknown(connection, attribute, "road", known["road"])


def _unknown(
    element: etree._Element, attribute: str, kind: str, known: set[str]
) -> Iterator[Finding]:
    identity = element.get(attribute)
    # -1 is the id of no junction.
    if identity and identity != "-1" and identity not in known:
        yield Finding(element, f"{attribute}: {unknown(kind, identity, known)}")


@rule("xosc.toolchain:xodr:1.4.0:road.lane.link.linked_lanes_exist")
def linked_lanes_exist(document: CheckedDocument) -> Iterator[Finding]:
    """Within a road, the predecessor and successor of a lane must be lanes of the neighbouring lane
    section of their layer."""
    for road in document.elements("road"):
        layers = sections_by_layer(document, road)
        for here in (section for sections in layers.values() for section in sections):
            for direction, border in (("predecessor", here.start), ("successor", here.end)):
                for link in here.element.iterfind(f"{{*}}*/{{*}}lane/{{*}}link/{{*}}{direction}"):
                    yield from _unknown_lane(
                        link, direction, border, layers.get(link.get("layer") or PERMANENT, [])
                    )


def _unknown_lane(
    link: etree._Element, direction: str, border: float, sections: list[Section]
) -> Iterator[Finding]:
    """A link over the border of a lane section to a lane that does not begin, or end, there."""
    meeting = [
        section
        for section in sections
        # Files round the s of sections that meet.
        if abs((section.start if direction == "successor" else section.end) - border) <= SAME_BORDER
    ]
    known = {
        lane.get("id") for section in meeting for lane in section.element.iterfind("{*}*/{*}lane")
    }
    if meeting and link.get("id") is not None and link.get("id") not in known:
        yield Finding(
            link, f"the {direction} {link.get('id')} is no lane of the neighbouring lane section"
        )


_TOLERANCE = 0.01
"""Metres that the end of one geometry may be away from the start of the next."""


@rule("xosc.toolchain:xodr:1.4.0:road.geometry.reference_line_is_complete")
def reference_line_is_complete(document: CheckedDocument) -> Iterator[Finding]:
    """A road must have geometries of positive length that follow each other from s=0 to the road's
    length."""
    for road in document.elements("road"):
        geometries = road.findall("{*}planView/{*}geometry")
        if not geometries:
            yield Finding(road, "the road has no geometry")
            continue
        # Elements of length 0 are a habit of exporters; a road of nothing else cannot be read.
        if not any(
            (document.number(geometry, "length") or 0.0) > SHORTEST for geometry in geometries
        ):
            yield Finding(road, "no geometry of the road has a length")
            continue
        end: float | None = 0.0
        for geometry in geometries:
            s, length = document.number(geometry, "s"), document.number(geometry, "length")
            if length is not None and not length > 0:
                yield Finding(
                    geometry,
                    f"length={length:g} must be greater than 0",
                    "warning" if length == 0 else None,
                )
            # `not … <=` catches NaN, too.
            if s is not None and end is not None and not abs(s - end) <= _TOLERANCE:
                yield Finding(
                    geometry, f"s={s:g}, but the geometry before it ends at {end:g}", "warning"
                )
            # Unknown: nothing can be said about the next one.
            end = None if s is None or length is None else s + length
        total = document.number(road, "length")
        if end is not None and total is not None and not abs(total - end) <= _TOLERANCE:
            yield Finding(road, f"length={total:g}, but the geometries end at {end:g}", "warning")


_SIDES = {"left": 1, "center": 0, "right": -1}


@rule("xosc.toolchain:xodr:1.4.0:road.lane.lane_sections_are_whole")
def lane_sections_are_whole(document: CheckedDocument) -> Iterator[Finding]:
    """A road must have lane sections with ascending s, each with a centre lane and lanes numbered
    without gaps from it."""
    for road in document.elements("road"):
        if road.find("{*}lanes/{*}laneSection") is None:
            yield Finding(road, "the road has no lane section")
        length = document.number(road, "length")
        for lanes in road.iterfind("{*}lanes"):
            last = -1.0
            for section in lanes.iterfind("{*}laneSection"):
                s = document.number(section, "s")
                # At s=length a section is empty: the reader leaves it out.
                if s is not None and length is not None and s > max(length, 0.0):
                    yield Finding(section, f"s={s:g}, but the road is only {length:g} m long")
                # Two single-sided sections, one for each side, may share their s.
                if s is not None and not s > last and not (s == last and single_sided(section)):
                    yield Finding(
                        section, f"s={s:g} is not greater than that of the lane section before it"
                    )
                last = last if s is None else s
                for side in _SIDES:
                    yield from _numbering(document, section, side)


def _numbering(document: CheckedDocument, section: etree._Element, side: str) -> Iterator[Finding]:
    sign, lanes = _SIDES[side], section.findall(f"{{*}}{side}/{{*}}lane")
    ids = [number for lane in lanes if (number := document.number(lane, "id")) is not None]
    # Temporary layers may do without a centre lane (OpenDRIVE 1.9).
    if sign == 0:
        if ids != [0] and layer_of(section) == PERMANENT:
            yield Finding(section, "one centre lane with the id 0 is expected")
    elif len(ids) == len(lanes) and sorted(number * sign for number in ids) != list(
        range(1, len(ids) + 1)
    ):
        given = ", ".join(f"{number:g}" for number in ids)
        yield Finding(
            section,
            f"the lane ids on the side {side} are {given}, numbers without gaps from {sign} on "
            "are expected",
        )


_OF_ROADS = {
    "{*}type": ("s",),
    "{*}planView/{*}geometry": ("s",),
    "{*}elevationProfile/{*}elevation": ("s",),
    "{*}lateralProfile/{*}superelevation": ("s",),
    "{*}lateralProfile/{*}shape": ("s", "t"),
}
_OF_LANES = {"{*}width": ("sOffset",), "{*}border": ("sOffset",), "{*}speed": ("sOffset",)}


@rule("xosc.toolchain:xodr:1.4.0:road.records_ascend")
def records_ascend(document: CheckedDocument) -> Iterator[Finding]:
    """The records of roads and lanes (geometry, elevation, shape, width, …) must ascend, one at a
    place."""
    for tag, records in (
        ("road", _OF_ROADS),
        ("lanes", {"{*}laneOffset": ("s",)}),
        ("lane", _OF_LANES),
    ):
        for element in document.elements(tag):
            for path, names in records.items():
                yield from _ascending(document, element.findall(path), names)


def _ascending(
    document: CheckedDocument, records: list[etree._Element], names: tuple[str, ...]
) -> Iterator[Finding]:
    for before, after in pairwise(records):
        first, second = (
            [document.number(record, name) for name in names] for record in (before, after)
        )
        start, here = (
            [number for number in place if number is not None] for place in (first, second)
        )
        if not len(start) == len(here) == len(names):
            continue
        place = " ".join(f"{name}={number:g}" for name, number in zip(names, here, strict=True))
        # Shapes ascend in t within one s; a restart of t there is read by sorting.
        if here < start:
            restarts = len(names) > 1 and here[0] == start[0]
            yield Finding(
                after,
                f"{place} is less than that of the record before it",
                "warning" if restarts else None,
            )
        elif here == start:
            alike = before.items() == after.items()
            yield Finding(
                after,
                f"{place} must differ from that of the record before it",
                "warning" if alike else None,
            )


SHORTEST = 1e-9
"""Length (m) up to which a geometry has none; so does the reader of roads."""
LARGEST = 1e12
"""Largest number that is accepted; the reader of roads refuses more, too."""
_NUMBERS = {
    "road": ("length",),
    "geometry": ("s", "x", "y", "hdg", "length"),
    "arc": ("curvature",),
    "spiral": ("curvStart", "curvEnd"),
    "laneSection": ("s",),
    "signal": ("s", "t"),
    "object": ("s", "t"),
    "elevation": tuple("abcd"),
    "superelevation": tuple("abcd"),
    "laneOffset": tuple("abcd"),
    "shape": tuple("abcd"),
    "width": tuple("abcd"),
    "border": tuple("abcd"),
    "poly3": tuple("abcd"),
    "paramPoly3": tuple(letter + axis for axis in "UV" for letter in "abcd"),
}


@rule("xosc.toolchain:xodr:1.4.0:numbers_are_plausible")
def numbers_are_plausible(document: CheckedDocument) -> Iterator[Finding]:
    """Lengths, places and coefficients must be numbers up to 1e12; exporters write others for
    stretches of some micrometres."""
    for tag, names in _NUMBERS.items():
        for element in document.elements(tag):
            for name in names:
                value = document.number(element, name)
                if value is not None and not abs(value) <= LARGEST:
                    yield Finding(
                        element, f"{name}={element.get(name)} is no number up to {LARGEST:g}"
                    )


_LENGTHS_DIFFER = 0.001
"""By how much the length of a curve may differ from that in the file, m."""
_STEPS = 200
"""Steps of Simpson's rule along a curve."""


@rule("asam.net:xodr:1.4.0:road.geometry.elem_asc_order")
def geometries_ascend(document: CheckedDocument) -> Iterator[Finding]:
    """The geometries of a road shall be defined in ascending order of s."""
    for plan in document.elements("planView"):
        for before, after in pairwise(plan.findall("{*}geometry")):
            first, second = document.number(before, "s"), document.number(after, "s")
            if first is not None and second is not None and second < first:
                yield Finding(after, f"s={second:g} is less than that of the geometry before it")


@rule("asam.net:xodr:1.7.0:road.geometry.parampoly3.length_match", level="warning", since=(1, 7))
def normalized_curves_have_their_length(document: CheckedDocument) -> Iterator[Finding]:
    """The length of a paramPoly3 with pRange="normalized" should be that of its geometry."""
    yield from _curves_of_other_length(document, "normalized")


@rule("asam.net:xodr:1.7.0:road.geometry.parampoly3.arclength_range", since=(1, 7))
def curves_by_length_have_their_length(document: CheckedDocument) -> Iterator[Finding]:
    """The parameter of a paramPoly3 with pRange="arcLength" is its length: the curve must be as
    long as its geometry."""
    yield from _curves_of_other_length(document, "arcLength")


def _curves_of_other_length(document: CheckedDocument, p_range: str) -> Iterator[Finding]:
    for curve in document.elements("paramPoly3"):
        geometry = curve.getparent()
        length = document.number(geometry, "length") if geometry is not None else None
        if (
            geometry is None
            or length is None
            or not 0.0 < length <= LARGEST
            or (curve.get("pRange") or "normalized") != p_range
        ):
            continue
        found = _curve_length(document, curve, 1.0 if p_range == "normalized" else length)
        if found is not None and not abs(found - length) <= _LENGTHS_DIFFER:
            yield Finding(geometry, f"length={length:g}, but the curve is {found:.4f} m long")


def _curve_length(document: CheckedDocument, curve: etree._Element, end: float) -> float | None:
    """Length of a parametric cubic from 0 to `end`, m, by Simpson's rule."""
    numbers = [document.number(curve, letter + axis) for axis in "UV" for letter in "bcd"]
    if None in numbers:
        return None
    bu, cu, du, bv, cv, dv = (number or 0.0 for number in numbers)
    rates = []
    # Simpson's rule needs an even number of steps.
    for index in range(_STEPS + 1):
        p = end * index / _STEPS
        rates.append(math.hypot(bu + p * (2 * cu + 3 * du * p), bv + p * (2 * cv + 3 * dv * p)))
    return (
        end
        / (3 * _STEPS)
        * (rates[0] + rates[-1] + 4 * sum(rates[1:-1:2]) + 2 * sum(rates[2:-1:2]))
    )


@rule("asam.net:xodr:1.7.0:road.geometry.paramPoly3.valid_parameters", since=(1, 7))
def curves_start_along_their_heading(document: CheckedDocument) -> Iterator[Finding]:
    """A paramPoly3 shall start at the place and in the direction of its geometry: aU=aV=bV=0 and
    bU>0."""
    for curve in document.elements("paramPoly3"):
        values = {name: document.number(curve, name) or 0.0 for name in ("aU", "aV", "bV", "bU")}
        wrong = [name for name in ("aU", "aV", "bV") if abs(values[name]) > _ALMOST_ZERO]
        wrong += ["bU"] if not values["bU"] > _ALMOST_ZERO else []
        if wrong:
            given = ", ".join(f"{name}={values[name]:g}" for name in wrong)
            yield Finding(curve, f"{given}; aU=aV=bV=0 and bU>0 are expected")


_ALMOST_ZERO = 1e-6
_REPEATED = {
    "road": ("{*}elevationProfile/{*}elevation", "{*}lateralProfile/{*}superelevation"),
    "lanes": ("{*}laneOffset",),
    "lane": ("{*}width", "{*}border"),
}


@rule("asam.net:xodr:1.7.0:performance.avoid_redundant_info", level="warning", since=(1, 7))
def records_say_something_new(document: CheckedDocument) -> Iterator[Finding]:
    """A record that goes on with the polynomial of the one before it, or a line that goes on
    straight, should be left out."""
    for tag, paths in _REPEATED.items():
        for element in document.elements(tag):
            for path in paths:
                for before, after in pairwise(element.findall(path)):
                    if _same_polynomial(document, before, after):
                        yield Finding(after, "the record before it has the same polynomial")
    for plan in document.elements("planView"):
        for before, after in pairwise(plan.findall("{*}geometry")):
            first, second = document.number(before, "hdg"), document.number(after, "hdg")
            lines = before.find("{*}line") is not None and after.find("{*}line") is not None
            if (
                lines
                and first is not None
                and second is not None
                and abs(first - second) < _ALMOST_ZERO
            ):
                yield Finding(after, "the line goes on straight from the one before it")


def _same_polynomial(
    document: CheckedDocument, before: etree._Element, after: etree._Element
) -> bool:
    """Whether two records are one function of s."""
    name = "sOffset" if "sOffset" in after.attrib else "s"
    first, second = (
        [document.number(record, attribute) for attribute in (name, *"abcd")]
        for record in (before, after)
    )
    if None in first or None in second:
        return False
    # Both are compared in the place of the second: the first one's polynomial is moved there
    # (Taylor).
    start, a, b, c, d = (number or 0.0 for number in first)
    x = (second[0] or 0.0) - start
    moved = (a + x * (b + x * (c + x * d)), b + x * (2 * c + 3 * x * d), c + 3 * x * d, d)
    return all(
        abs(one - (other or 0.0)) < _ALMOST_ZERO
        for one, other in zip(moved, second[1:], strict=True)
    )


# continuity -------------------------------------------------------------------------------------


_GAP = 0.01
"""Largest distance between places that are to be the same, m."""
_SINCE = (1, 7)


@rule("asam.net:xodr:1.7.0:road.geometry.contact_point")
def linked_roads_touch(document: CheckedDocument) -> Iterator[Finding]:
    """The reference lines of roads that are linked without a junction shall touch at the contact
    points of the links.

    The rule is of version 1.7; in older files a gap is a warning.
    """
    network = _network(document)
    for ends in linked_roads(network, document.root) if network else ():
        # Links of connecting roads are those of junctions, which have rules of their own.
        if (
            not ends.road.junction_id
            and not ends.other.junction_id
            and (gap := ends.apart()) > _GAP
        ):
            level = None if document.type.version >= _SINCE else "warning"
            yield Finding(ends.element, f"a link joins {ends}, {gap:.3g} m apart", level)


def _network(document: CheckedDocument) -> RoadNetwork | None:
    """The road network; None where it cannot be read, which is said by other rules."""
    try:
        return load(document.path)
    except ToolchainError:
        return None


@rule("asam.net:xodr:1.7.0:lane_smoothness.contact_point_no_horizontal_gaps", since=_SINCE)
def linked_lanes_touch(document: CheckedDocument) -> Iterator[Finding]:
    """Geometries of a road that follow each other, and lanes to drive on that are linked, shall
    have no gaps between them."""
    network = _network(document)
    if network is None:
        return
    for element in document.elements("road"):
        yield from _gaps_of_line(network.roads.get(element.get("id") or ""), element)
    every = list(meetings(document))
    # A lane that splits covers several lanes; each of these alone is narrower, so only the lane
    # that splits is compared.
    split = {(link, meeting.place) for meeting in every for link in _of_split(meeting)}
    for meeting in every:
        yield from _gaps_of_lanes(network, meeting, split)


@rule("asam.net:xodr:1.8.0:junctions.cross_path.lane_linkage", since=(1, 8))
def cross_paths_reach_their_lanes(document: CheckedDocument) -> Iterator[Finding]:
    """Start and end of a cross path's road shall be within the lanes that they are linked to."""
    network = _network(document)
    if network is None:
        return
    for element in document.elements("crossPath"):
        path = read_cross_path(element)
        for name, end, gap in zip(
            ("start", "end"),
            (path.start, path.end),
            cross_path_gaps(network.roads, path),
            strict=True,
        ):
            if gap > _GAP:
                place = f"{gap:.3g} m beside" if gap < math.inf else "at no place of"
                yield Finding(
                    element,
                    f"the {name} of the cross path lies {place} the lane {end.lane_id} of the "
                    f"road {end.road_id!r}",
                )


def _gaps_of_line(road: Road | None, element: etree._Element) -> Iterator[Finding]:
    geometries = element.findall("{*}planView/{*}geometry")
    # The reader drops elements of no length, after which elements and segments no longer pair up.
    if road is None or len(geometries) != len(road.line.segments):
        return
    for (before, after), geometry in zip(pairwise(road.line.segments), geometries[1:], strict=True):
        x, y, _ = before.at(before.length)
        gap = math.dist((x, y), after.at(0.0)[:2])
        if gap > _GAP:
            yield Finding(
                geometry, f"the geometry begins {gap:.3g} m away from the end of the one before it"
            )


class _Borders(NamedTuple):
    """The border points of a lane at an end of its section: x and y, m."""

    inner: tuple[float, float]
    outer: tuple[float, float]


_Pair = tuple[etree._Element, etree._Element]


def _of_split(meeting: SectionMeeting) -> list[_Pair]:
    """Pairs of lanes here that link several lanes there, as the lanes there see them."""
    by_lane: dict[etree._Element, list[etree._Element]] = {}
    for lane, other, _ in meeting.links:
        by_lane.setdefault(lane, []).append(other)
    return [
        (other, lane) for lane, others in by_lane.items() if len(others) > 1 for other in others
    ]


def _gaps_of_lanes(
    network: RoadNetwork, meeting: SectionMeeting, split: set[tuple[_Pair, str]]
) -> Iterator[Finding]:
    linked: dict[etree._Element, list[etree._Element]] = {}
    for lane, other, _ in meeting.links:
        if ((lane, other), meeting.place) not in split:
            linked.setdefault(lane, []).append(other)
    for lane, others in linked.items():
        here = _borders(network, meeting.here, meeting.here_start, lane)
        there = [
            found
            for other in others
            if (found := _borders(network, meeting.there, meeting.there_start, other))
        ]
        if lane.get("type") not in DRIVABLE or here is None or not there:
            continue
        places = [place for group in there for place in group]
        # Several lanes there make up one here: each border has to meet one of theirs.
        gap = max(min(math.dist(mine, place) for place in places) for mine in here)
        # Where roads are laid against each other, inner and outer borders change places.
        if len(there) == 1:
            gap = min(
                _apart(here, there[0]), _apart(here, _Borders(there[0].outer, there[0].inner))
            )
        if gap > _GAP:
            names = " and ".join(other.get("id") or "" for other in others)
            yield Finding(
                lane,
                f"the borders of the lane {lane.get('id')} are {gap:.3g} m away from those of the "
                f"lane {names}",
            )


def _apart(one: _Borders, other: _Borders) -> float:
    return max(math.dist(one.inner, other.inner), math.dist(one.outer, other.outer))


def _borders(
    network: RoadNetwork, section: Section, at_start: bool, lane: etree._Element
) -> _Borders | None:
    element = next(section.element.iterancestors("{*}road"), None)
    road = network.roads.get(element.get("id") or "") if element is not None else None
    if road is None:
        return None
    road = road.on(section.layer)
    # In the middle, for at its ends a section's s may belong to the next one.
    found = road.section(0.5 * (section.start + section.end)).lanes.get(integer(lane, "id") or 0)
    if found is None or not found.id:
        return None
    s = section.start if at_start else section.end
    inner, outer = (road.pose(s, border(s))[:2] for border in (found.inner, found.outer))
    return _Borders(inner, outer)
