"""Attributes of OpenDRIVE elements as Python values, with complaints that name line and element;
junctions, signals and objects.

`xodr.load` adds the file's path to these errors.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

from lxml import etree

from schemas.common.errors import InvalidFile, Unsupported
from schemas.common.remarks import Remark
from schemas.common.xml import line_of
from xodr.model import (
    PERMANENT,
    TEMPORARY,
    BoundarySegment,
    Connection,
    Controller,
    CrossPath,
    CrossPathEnd,
    Junction,
    LaneRef,
    OutlineCorner,
    RoadObject,
    Signal,
    SignalReference,
    Structure,
)
from xodr.model.geometry import ZERO, Cubic, Profile

# attributes -------------------------------------------------------------------------------------


LARGEST = 1e12
"""Numbers beyond this are refused: nothing on Earth needs them, and arithmetic on them overflows.
"""


def invalid(element: etree._Element, message: str) -> InvalidFile:
    """The error for a broken element, to be raised by the caller."""
    return InvalidFile(message, line=line_of(element), element=str(element.tag))


def unsupported(element: etree._Element, message: str) -> Unsupported:
    """The error for an element that is valid but not supported, to be raised by the caller."""
    return Unsupported(message, line=line_of(element), element=str(element.tag))


def text(element: etree._Element, name: str) -> str:
    """A required attribute."""
    value = element.get(name)
    if value is None:
        raise invalid(element, f"the attribute {name!r} is missing")
    return value


def number(element: etree._Element, name: str, default: float | None = None) -> float:
    """An attribute as a finite float; required where no default is given."""
    value = element.get(name)
    if value is None and default is not None:
        return default
    try:
        result = float(text(element, name))
    except ValueError:
        raise invalid(element, f"{name}={value!r} is not a number") from None
    # Written so that NaN, for which every comparison is false, is refused, too.
    if not abs(result) <= LARGEST:
        raise invalid(
            element, f"{name}={value!r} must be a number between -{LARGEST:g} and {LARGEST:g}"
        )
    return result


def optional(element: etree._Element, name: str) -> float | None:
    """An attribute as a finite float, None where it is absent or empty."""
    return number(element, name) if (element.get(name) or "").strip() else None


def integer(element: etree._Element, name: str) -> int:
    """A required attribute as an integer."""
    value = number(element, name)
    if value != int(value):
        raise invalid(element, f"{name}={element.get(name)!r} is not an integer")
    return int(value)


def ascending(elements: list[etree._Element], name: str, *, distinct: bool = False) -> list[float]:
    """The attribute of each element.

    Args:
        distinct: of the elements only one can hold at a place.

    Raises:
        InvalidFile: the attribute decreases from one to the next, or is the same for two that
            differ although `distinct`.
    """
    values = [number(element, name) for element in elements]
    for before, element, start, value in zip(
        elements, elements[1:], values, values[1:], strict=False
    ):
        if value < start:
            raise invalid(
                element, f"{name}={value:g} follows {start:g}, but {name} must not decrease"
            )
        # Exporters repeat whole records; two that say the same do no harm.
        if distinct and value == start and element.attrib != before.attrib:
            raise invalid(element, f"{name}={value:g} must differ from that of the record before")
    return values


def speed(element: etree._Element) -> float | None:
    """The `max` of a speed element in m/s, None for "no limit" and "undefined"."""
    if text(element, "max").strip().lower() in ("no limit", "undefined", ""):
        return None
    units = {"m/s": 1.0, "mph": 0.44704, "km/h": 1.0 / 3.6}
    # Without a unit, OpenDRIVE means m/s.
    unit = element.get("unit") or "m/s"
    if unit not in units:
        raise invalid(element, f"unit={unit!r} is not one of {', '.join(units)}")
    value = number(element, "max") * units[unit]
    if value < 0.0 or math.isnan(value):
        raise invalid(element, f"max={element.get('max')!r} must not be negative")
    return value


def coefficients(element: etree._Element) -> tuple[float, float, float, float]:
    """The polynomial parameters a, b, c, d."""
    return (
        number(element, "a"),
        number(element, "b", 0.0),
        number(element, "c", 0.0),
        number(element, "d", 0.0),
    )


def profile(elements: list[etree._Element]) -> Profile:
    """Records with `s` as a function of s: 0 before the first."""
    if not elements:
        return ZERO
    starts = ascending(elements, "s", distinct=True)
    pieces = {
        start: Cubic(start, *coefficients(element))
        for start, element in zip(starts, elements, strict=True)
    }
    # A Profile extends its first piece backwards.
    if starts[0] > 0.0:
        pieces = {0.0: Cubic(0.0, 0.0), **pieces}
    return Profile(pieces.values())


def validity(element: etree._Element) -> tuple[tuple[int, int], ...]:
    """Lane ranges (from, to) that a signal or object applies to."""
    return tuple(
        (integer(item, "fromLane"), integer(item, "toLane"))
        for item in element.iterfind("validity")
    )


def lane_layer(element: etree._Element, name: str = "layer") -> str:
    """A layer of lanes: the permanent one where the file does not say."""
    layer = element.get(name) or PERMANENT
    if layer not in (PERMANENT, TEMPORARY):
        raise invalid(element, f"{name}={layer!r} is neither {PERMANENT} nor {TEMPORARY}")
    return layer


def contact_point(element: etree._Element) -> str | None:
    """End of a road that a link or connection means: "start", "end" or None where the file does not
    say."""
    contact = element.get("contactPoint")
    if contact not in ("start", "end", None):
        raise invalid(element, f"contactPoint={contact!r} is neither start nor end")
    return contact


# junctions and controllers ----------------------------------------------------------------------


_FOLLOWED = "xosc.toolchain:xodr:1.5.0:junction.connections_are_followed"
_KINDS = ("default", "direct", "virtual", "crossing")


def read_junction(element: etree._Element) -> Junction:
    """A `junction` element."""
    kind = _kind(element)
    if kind not in _KINDS:
        raise invalid(element, f"type={kind!r} is not a kind of junction")
    controllers = tuple(text(item, "id") for item in element.iterfind("controller"))
    found = tuple(_connection(item) for item in connections(element))
    cross_paths = tuple(read_cross_path(item) for item in element.iterfind("crossPath"))
    boundary = tuple(_boundary_segment(item) for item in element.iterfind("boundary/segment"))
    priorities = tuple(
        (item.get("high", ""), item.get("low", "")) for item in element.iterfind("priority")
    )
    return Junction(
        text(element, "id"),
        element.get("name", ""),
        kind,
        found,
        controllers,
        priorities,
        cross_paths,
        boundary,
    )


def read_cross_path(element: etree._Element) -> CrossPath:
    """A `crossPath` element."""
    start = _cross_path_end(element, "roadAtStart", "startLaneLink")
    end = _cross_path_end(element, "roadAtEnd", "endLaneLink")
    return CrossPath(text(element, "id"), text(element, "crossingRoad"), start, end)


def _cross_path_end(element: etree._Element, road: str, name: str) -> CrossPathEnd:
    link = element.find(f"{{*}}{name}")
    if link is None:
        raise invalid(element, f"the element {name} is missing")
    return CrossPathEnd(
        text(element, road), number(link, "s"), integer(link, "from"), integer(link, "to")
    )


def _boundary_segment(element: etree._Element) -> BoundarySegment:
    kind, road = text(element, "type"), text(element, "roadId")
    if kind == "lane":
        # A segment along one lane begins and ends with it.
        lane = integer(element, "boundaryLane")
        return BoundarySegment(
            road, _place(element, "sStart"), _place(element, "sEnd"), (lane, lane), joint=False
        )
    if kind != "joint":
        raise invalid(element, f"type={kind!r} is neither lane nor joint")
    first, last = (
        integer(element, name) if name in element.attrib else None
        for name in ("jointLaneStart", "jointLaneEnd")
    )
    s = _place(element, "contactPoint")
    return BoundarySegment(road, s, s, (first, last), joint=True)


def _place(element: etree._Element, name: str) -> float:
    """The s of an attribute that may say `start` or `begin` (0) and `end` (infinite) too."""
    named = {"start": 0.0, "begin": 0.0, "end": math.inf}.get(text(element, name))
    return number(element, name) if named is None else named


def connections(junction: etree._Element) -> list[etree._Element]:
    """The connections of a junction that roads make: none of a crossing, those with a connecting
    road of a virtual one."""
    kind, found = _kind(junction), junction.findall("connection")
    # Other connections of virtual junctions have no road to travel on.
    if kind == "virtual":
        return [
            connection
            for connection in found
            if connection.get("connectingRoad") and connection.get("incomingRoad")
        ]
    return [] if kind == "crossing" else found


def not_followed(root: etree._Element, path: Path) -> Iterator[Remark]:
    """A remark for each junction beside a main road with ways off it that have no road, or no place
    on it (`elementS`)."""
    lengths = {road.get("id"): number(road, "length") for road in root.iterfind("road")}
    placed = {
        (road.get("id"), link.get("elementId"))
        for road in root.iterfind("road")
        for link in road.iterfind("link/*[@elementS]")
        # Links to places at or beyond the ends of the main road are not followed
        # (xodr.graph.links).
        if 0.0 < number(link, "elementS") < lengths.get(link.get("elementId"), 0.0)
    }
    for junction in root.iterfind("junction"):
        kind, main = _kind(junction), junction.get("mainRoad")
        if kind not in ("virtual", "crossing"):
            continue
        ways = [
            (way.get("connectingRoad"), way.get("incomingRoad"))
            for way in junction.iterfind("connection")
        ]
        left = [
            way
            for way in ways
            if kind == "crossing" or way[0] is None or (way[1] == main and way not in placed)
        ]
        if left:
            share = "" if len(left) == len(ways) else f"{len(left)} of {len(ways)} "
            fault = (
                f"junction: the {kind} junction {junction.get('id')!r} lies beside its main road"
            )
            yield Remark(
                _FOLLOWED,
                f"{fault}; {share}ways off that road are not followed",
                str(path),
                line_of(junction),
            )


def _kind(junction: etree._Element) -> str:
    return junction.get("type") or "default"


def _connection(element: etree._Element) -> Connection:
    return Connection(
        id=element.get("id", ""),
        incoming_road=text(element, "incomingRoad"),
        # Direct junctions name a linkedRoad in the place of a connectingRoad (OpenDRIVE 1.9, 12.6).
        connecting_road=text(
            element, "linkedRoad" if element.get("linkedRoad") else "connectingRoad"
        ),
        contact=contact_point(element) or "start",
        lane_links=tuple(
            (_lane(item, "from"), _lane(item, "to")) for item in element.iterfind("laneLink")
        ),
    )


def _lane(element: etree._Element, name: str) -> LaneRef:
    return LaneRef(integer(element, name), lane_layer(element, f"{name}Layer"))


def read_controller(element: etree._Element) -> Controller:
    """A `controller` element."""
    sequence = integer(element, "sequence") if element.get("sequence") else None
    signals = tuple(text(item, "signalId") for item in element.iterfind("control"))
    return Controller(text(element, "id"), element.get("name", ""), sequence, signals)


# signals and objects ----------------------------------------------------------------------------


def read_signal(element: etree._Element, road_id: str) -> Signal:
    """A `signal` element. Types may be missing: files in the wild leave them out for supports and
    own signs."""
    return Signal(
        id=text(element, "id"),
        road_id=road_id,
        s=number(element, "s"),
        t=number(element, "t"),
        name=element.get("name", ""),
        dynamic=element.get("dynamic") in ("yes", "true", "1"),
        type=element.get("type", ""),
        subtype=element.get("subtype", ""),
        country=element.get("country", ""),
        orientation=element.get("orientation", "none"),
        value=optional(element, "value"),
        unit=element.get("unit", ""),
        text=element.get("text", ""),
        z_offset=number(element, "zOffset", 0.0),
        h_offset=number(element, "hOffset", 0.0),
        width=optional(element, "width"),
        height=optional(element, "height"),
        validity=validity(element),
        priority=next((one.get("type", "") for one in element.iterfind("semantics/priority")), ""),
    )


def read_signal_reference(element: etree._Element) -> SignalReference:
    """A `signalReference` element."""
    orientation = element.get("orientation", "none")
    return SignalReference(
        text(element, "id"),
        number(element, "s"),
        number(element, "t"),
        orientation,
        validity(element),
    )


def read_object(element: etree._Element, road_id: str) -> RoadObject:
    """An `object` element with its outlines (one directly below it until 1.4, several since)."""
    outlines = [*element.iterfind("outline"), *element.iterfind("outlines/outline")]
    return RoadObject(
        id=element.get("id", ""),
        road_id=road_id,
        s=number(element, "s"),
        t=number(element, "t"),
        name=element.get("name", ""),
        type=element.get("type", ""),
        subtype=element.get("subtype", ""),
        orientation=element.get("orientation", "none"),
        z_offset=number(element, "zOffset", 0.0),
        heading=number(element, "hdg", 0.0),
        pitch=number(element, "pitch", 0.0),
        roll=number(element, "roll", 0.0),
        length=optional(element, "length"),
        width=optional(element, "width"),
        radius=optional(element, "radius"),
        height=optional(element, "height"),
        outlines=tuple(
            tuple(_corner(corner) for corner in outline if _is_corner(corner))
            for outline in outlines
        ),
        validity=validity(element),
    )


def read_structure(element: etree._Element) -> Structure:
    """A `bridge` or `tunnel` element."""
    return Structure(
        kind=str(element.tag),
        id=element.get("id", ""),
        name=element.get("name", ""),
        type=element.get("type", ""),
        s=number(element, "s"),
        length=number(element, "length"),
    )


def _is_corner(element: etree._Element) -> bool:
    return element.tag in ("cornerLocal", "cornerRoad")


def _corner(element: etree._Element) -> OutlineCorner:
    on_road = element.tag == "cornerRoad"
    u, v, z = ("s", "t", "dz") if on_road else ("u", "v", "z")
    return OutlineCorner(
        number(element, u),
        number(element, v),
        number(element, z, 0.0),
        number(element, "height", 0.0),
        on_road,
    )
