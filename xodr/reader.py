"""Reads OpenDRIVE 1.4 to 1.8 into a RoadNetwork.

Tolerant where public files are sloppy and the meaning is still clear: missing names, empty attributes, repeated or absent
profile records, elements of length 0, links declared by one side only. What has no meaning is refused with file and line.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import lru_cache
from os import PathLike
from pathlib import Path
from typing import TypeVar

from lxml import etree

from schemas.errors import ToolchainError
from schemas.xml import line_of, local_name, parse
from xodr.elements import ascending, coefficients, invalid, number, profile, speed, text, whole
from xodr.geometry import Arc, Line, ParamPoly3, ReferenceLine, Segment, Spiral, Start, poly3
from xodr.lanes import read_sections
from xodr.model import Connection, Controller, Header, Junction, RoadLink, RoadType
from xodr.network import RoadNetwork
from xodr.profiles import Cubic, Profile
from xodr.road import Road, Surface
from xodr.road_objects import read_object, read_signal, read_signal_reference

_log = logging.getLogger(__name__)
_CACHED_FILES = 64
_TOO_SHORT = 1e-9

T = TypeVar("T")


def load(path: str | PathLike[str]) -> RoadNetwork:
    """Read an OpenDRIVE file, or hand back the network read before from the same unchanged file.

    Raises:
        InvalidFile: missing, malformed, or not OpenDRIVE; names file, line and element.
        Unsupported: valid, but uses something that is not supported.
    """
    path = Path(path)
    try:
        status = path.stat()
        key = (status.st_mtime_ns, status.st_size)
    except (OSError, ValueError):
        key = (0, 0)
    return _load(path, key)


@lru_cache(maxsize=_CACHED_FILES)
def _load(path: Path, _version: tuple[int, int]) -> RoadNetwork:
    root = parse(path).getroot()
    try:
        return _network(path, root)
    except ToolchainError as error:
        error.path = error.path or str(path)
        raise


def _network(path: Path, root: etree._Element) -> RoadNetwork:
    if local_name(root) != "OpenDRIVE":
        raise invalid(root, "the root element of a road network is OpenDRIVE")
    if root.tag != "OpenDRIVE":
        for element in root.iter("{*}*"):
            element.tag = local_name(element)
    header = _header(root)
    roads = _by_id(root, "road", lambda element: _road(path, element))
    if not roads:
        raise invalid(root, "the road network has no road")
    junctions = _by_id(root, "junction", _junction)
    _check_references(root, roads, junctions)
    controllers = _by_id(root, "controller", _controller)
    try:
        return RoadNetwork(path, header, roads, junctions, controllers)
    except ValueError as error:
        raise invalid(root, str(error)) from None


def _by_id(root: etree._Element, tag: str, read: Callable[[etree._Element], T]) -> dict[str, T]:
    found: dict[str, T] = {}
    for element in root.iterfind(tag):
        name = text(element, "id")
        if name in found:
            raise invalid(element, f"the id {name!r} is used twice")
        found[name] = read(element)
    return found


def _check_references(root: etree._Element, roads: dict[str, Road], junctions: dict[str, Junction]) -> None:
    for element in root.iterfind("road/link/*"):
        kind, name = element.get("elementType"), element.get("elementId")
        if (kind == "road" and name not in roads) or (kind == "junction" and name not in junctions):
            raise invalid(element, f"the {kind} {name!r} that is linked here does not exist")
    for element in root.iterfind("junction/connection"):
        for attribute in ("incomingRoad", "connectingRoad", "linkedRoad"):
            name = element.get(attribute)
            if name is not None and name not in roads:
                raise invalid(element, f"{attribute}={name!r} does not exist")


# header -------------------------------------------------------------------------------------


def _header(root: etree._Element) -> Header:
    element = root.find("header")
    if element is None:
        raise invalid(root, "the element header is missing")
    reference = element.findtext("geoReference", "").strip() or None
    offset = element.find("offset")
    shift = (0.0, 0.0, 0.0, 0.0)
    if offset is not None:
        shift = (number(offset, "x", 0.0), number(offset, "y", 0.0), number(offset, "z", 0.0), number(offset, "hdg", 0.0))
    version = (whole(element, "revMajor"), whole(element, "revMinor"))
    return Header(version, element.get("name", ""), reference, shift)


# roads --------------------------------------------------------------------------------------


def _road(path: Path, element: etree._Element) -> Road:
    road_id, length = text(element, "id"), number(element, "length")
    if length <= 0.0:
        raise invalid(element, f"length={length:g} must be positive")
    junction, rule = element.get("junction", "-1"), element.get("rule") or "RHT"
    if rule not in ("RHT", "LHT"):
        raise invalid(element, f"rule={rule!r} is neither RHT nor LHT")
    lanes = element.find("lanes")
    if lanes is None:
        raise invalid(element, "the element lanes is missing")
    return Road(
        path=str(path),
        id=road_id,
        name=element.get("name", ""),
        length=length,
        junction_id=None if junction in ("-1", "") else junction,
        rule=rule,
        line=_reference_line(element),
        sections=read_sections(lanes, length),
        elevation=profile(element.findall("elevationProfile/elevation")),
        superelevation=profile(element.findall("lateralProfile/superelevation")),
        surface=_surface(element),
        types=_road_types(element),
        predecessor=_road_link(element.find("link/predecessor")),
        successor=_road_link(element.find("link/successor")),
        signals=[read_signal(signal, road_id) for signal in element.iterfind("signals/signal")],
        signal_references=[read_signal_reference(signal) for signal in element.iterfind("signals/signalReference")],
        objects=[read_object(item, road_id) for item in element.iterfind("objects/object")],
    )


def _road_link(element: etree._Element | None) -> RoadLink | None:
    if element is None or element.get("elementS") is not None:  # the latter joins the middle of a road: a virtual junction
        return None
    kind = text(element, "elementType")
    if kind not in ("road", "junction"):
        raise invalid(element, f"elementType={kind!r} is neither road nor junction")
    return RoadLink(kind, text(element, "elementId"), _contact(element) if kind == "road" else None)


def _contact(element: etree._Element) -> str | None:
    contact = element.get("contactPoint")
    if contact not in ("start", "end", None):
        raise invalid(element, f"contactPoint={contact!r} is neither start nor end")
    return contact


def _road_types(element: etree._Element) -> list[RoadType]:
    elements = element.findall("type")
    limits = [item.find("speed") for item in elements]
    return [
        RoadType(start, item.get("type", "unknown"), speed(limit) if limit is not None else None)
        for start, item, limit in zip(ascending(elements, "s"), elements, limits, strict=True)
    ]


# plan view ----------------------------------------------------------------------------------


def _reference_line(road: etree._Element) -> ReferenceLine:
    elements = road.findall("planView/geometry")
    starts = ascending(elements, "s")
    kept = [(start, item) for start, item in zip(starts, elements, strict=True) if _geometry_length(item) > _TOO_SHORT]
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


def _segment(element: etree._Element) -> Segment:
    start = Start(number(element, "x"), number(element, "y"), number(element, "hdg"), number(element, "length"))
    shape = next((child for child in element if child.tag in _SHAPES), None)
    if shape is None:
        names = ", ".join(str(child.tag) for child in element if isinstance(child.tag, str)) or "nothing"
        raise invalid(element, f"a geometry is one of {', '.join(_SHAPES)}; found {names}")
    return _SHAPES[shape.tag](start, shape)


def _spiral(start: Start, shape: etree._Element) -> Segment:
    return Spiral(start, number(shape, "curvStart"), number(shape, "curvEnd"))


def _poly3(start: Start, shape: etree._Element) -> Segment:
    return poly3(start, [number(shape, name) for name in "abcd"])


def _param_poly3(start: Start, shape: etree._Element) -> Segment:
    p_range = shape.get("pRange") or "normalized"
    if p_range not in ("arcLength", "normalized"):
        raise invalid(shape, f"pRange={p_range!r} is neither arcLength nor normalized")
    u, v = ([number(shape, name + axis) for name in "abcd"] for axis in "UV")
    return ParamPoly3(start, u, v, start.length if p_range == "arcLength" else 1.0)


_SHAPES: dict[str, Callable[[Start, etree._Element], Segment]] = {
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
    by_s: dict[float, list[etree._Element]] = {}
    for s, element in zip(ascending(shapes, "s"), shapes, strict=True):
        by_s.setdefault(s, []).append(element)
    left, right = (
        profile([element for element in crossfalls if element.get("side", "both") in (side, "both")])
        for side in ("left", "right")
    )
    return Surface([(s, _lateral(elements)) for s, elements in by_s.items()], left, right)


def _lateral(elements: list[etree._Element]) -> Profile:
    starts = ascending(elements, "t")
    return Profile(Cubic(t, *coefficients(element)) for t, element in zip(starts, elements, strict=True))


# junctions, controllers ---------------------------------------------------------------------


def _junction(element: etree._Element) -> Junction:
    kind = element.get("type") or "default"
    if kind not in ("default", "direct", "virtual", "crossing"):
        raise invalid(element, f"type={kind!r} is not a kind of junction")
    connections = tuple(_connection(item) for item in element.iterfind("connection"))
    if kind in ("virtual", "crossing") and connections:
        place = f"{element.getroottree().docinfo.URL}:{line_of(element)}"
        _log.warning("%s: %s junction %r: its main road is followed, ways off it are not", place, kind, element.get("id"))
        connections = ()
    controllers = tuple(text(item, "id") for item in element.iterfind("controller"))
    return Junction(text(element, "id"), element.get("name", ""), kind, connections, controllers)


def _connection(element: etree._Element) -> Connection:
    return Connection(
        id=element.get("id", ""),
        incoming_road=text(element, "incomingRoad"),
        connecting_road=text(element, "linkedRoad" if element.get("linkedRoad") else "connectingRoad"),
        contact=_contact(element) or "start",
        lane_links=tuple((whole(item, "from"), whole(item, "to")) for item in element.iterfind("laneLink")),
    )


def _controller(element: etree._Element) -> Controller:
    sequence = whole(element, "sequence") if element.get("sequence") else None
    signals = tuple(text(item, "signalId") for item in element.iterfind("control"))
    return Controller(text(element, "id"), element.get("name", ""), sequence, signals)
