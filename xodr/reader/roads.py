"""Reads roads: plan view, elevation, lateral profile, links and types."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from lxml import etree

from xodr.geometry import Arc, Line, ParamPoly3, ReferenceLine, Segment, Spiral, Start, poly3
from xodr.model import RoadLink, RoadType
from xodr.profiles import Cubic, Profile
from xodr.reader.elements import ascending, coefficients, contact_point, invalid, number, optional, profile, speed, text
from xodr.reader.lanes import read_layers
from xodr.reader.road_objects import read_object, read_signal, read_signal_reference, read_structure
from xodr.road import Road, Surface

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
        signal_references=[read_signal_reference(signal) for signal in element.iterfind("signals/signalReference")],
        objects=[read_object(item, road_id) for item in element.iterfind("objects/object")],
        structures=[read_structure(item) for kind in ("bridge", "tunnel") for item in element.iterfind(f"objects/{kind}")],
    )


def _road_link(element: etree._Element | None) -> RoadLink | None:
    if element is None:
        return None
    kind = text(element, "elementType")
    if kind not in ("road", "junction"):
        raise invalid(element, f"elementType={kind!r} is neither road nor junction")
    name, is_road = text(element, "elementId"), kind == "road"
    return RoadLink(kind, name, contact_point(element) if is_road else None, optional(element, "elementS") if is_road else None)


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
    starts = ascending(elements, "t", distinct=True)
    return Profile(Cubic(t, *coefficients(element)) for t, element in zip(starts, elements, strict=True))
