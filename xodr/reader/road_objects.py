"""Reads signals and objects: what stands beside and hangs above the road."""

from __future__ import annotations

from lxml import etree

from xodr.model import Corner, RoadObject, Signal, SignalReference, Structure
from xodr.reader.elements import number, optional, text, validity


def read_signal(element: etree._Element, road_id: str) -> Signal:
    """A `signal` element. Types may be missing: files in the wild leave them out for supports and own signs."""
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
    )


def read_signal_reference(element: etree._Element) -> SignalReference:
    """A `signalReference` element."""
    orientation = element.get("orientation", "none")
    return SignalReference(text(element, "id"), number(element, "s"), number(element, "t"), orientation, validity(element))


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
        outlines=tuple(tuple(_corner(corner) for corner in outline if _is_corner(corner)) for outline in outlines),
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


def _corner(element: etree._Element) -> Corner:
    on_road = element.tag == "cornerRoad"
    u, v, z = ("s", "t", "dz") if on_road else ("u", "v", "z")
    return Corner(number(element, u), number(element, v), number(element, z, 0.0), number(element, "height", 0.0), on_road)
