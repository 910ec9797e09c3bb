"""Attributes that are missing or make no sense where only one value can be meant."""

from __future__ import annotations

from collections.abc import Iterator

from lxml import etree

from xodr.reader.elements import LARGEST
from xodr.reader.repairs.repair import SCHEMA, Repair, leave_out, value

RANGE = "xosc.toolchain:xodr:1.4.0:numbers_are_plausible"

_ZERO_BY_DEFAULT = {
    "elevation": ("a",),
    "superelevation": ("a",),
    "laneOffset": ("a",),
    "shape": ("a",),
    "width": ("a",),
    "border": ("a",),
    "crossfall": ("a",),
    "arc": ("curvature",),
    "spiral": ("curvStart", "curvEnd"),
    "poly3": tuple("abcd"),
    "paramPoly3": tuple(name + axis for name in "abcd" for axis in "UV"),
}
"""Attributes that are 0 where they are missing, by element."""

_STARTS = {
    "elevation": "s",
    "superelevation": "s",
    "laneOffset": "s",
    "shape": "s",
    "crossfall": "s",
    "laneSection": "s",
    "type": "s",
    "width": "sOffset",
    "border": "sOffset",
    "speed": "sOffset",
}
"""Where a record begins, by element: at 0 where a first record does not say."""

_SHORT = 0.1
"""Width records are ignored but for their constant on stretches of at most this length where their numbers are absurd, in m."""


def repair_values(root: etree._Element) -> Iterator[Repair]:
    """Fill in, correct or leave out single values."""
    yield from _empty_curves(root)
    yield from _missing(root)
    yield from _absurd_widths(root)
    yield from _speeds(root)


def _empty_curves(root: etree._Element) -> Iterator[Repair]:
    for curve in root.findall("road/planView/geometry/paramPoly3"):
        geometry = curve.getparent()
        if geometry is not None and not any(value(curve, name + axis) for name in "bcd" for axis in "UV"):
            geometry.replace(curve, etree.Element("line"))
            yield Repair(curve, SCHEMA, "the curve has no coefficients", "read as a line")


def _missing(root: etree._Element) -> Iterator[Repair]:
    for road in root.iterfind("road"):
        for element in road.iter(*_ZERO_BY_DEFAULT):
            for name in _ZERO_BY_DEFAULT[str(element.tag)]:
                if element.get(name) is None:
                    element.set(name, "0")
                    yield Repair(element, SCHEMA, f"the attribute {name!r} is missing", "read as 0")
        for element in road.iter(*_STARTS):
            name = _STARTS[str(element.tag)]
            start = _start(element, name) if element.get(name) is None else None
            if start is not None:
                element.set(name, start)
                yield Repair(element, SCHEMA, f"the attribute {name!r} is missing", f"read as {start}")


def _start(element: etree._Element, name: str) -> str | None:
    """Where a record begins that does not say: the first one at 0, shapes where the one before does; None for all others."""
    parent = element.getparent()
    if element.tag == "speed" and parent is not None and parent.tag == "type":
        return None  # it has no start
    before = next(element.itersiblings(str(element.tag), preceding=True), None)
    if before is None:
        return "0"
    return before.get(name) if element.tag == "shape" else None


def _absurd_widths(root: etree._Element) -> Iterator[Repair]:
    """Polynomials that some exporters fit to stretches of some micrometres."""
    for road in root.iterfind("road"):
        sections = road.findall("lanes/laneSection")
        ends = [*(value(section, "s") for section in sections), value(road, "length")]
        for section, start, end in zip(sections, ends, ends[1:], strict=False):
            if start is None or end is None or end - start > _SHORT:
                continue
            for width in section.iter("width"):
                absurd = [name for name in "bcd" if abs(value(width, name) or 0.0) > LARGEST]
                if absurd:
                    fault = f"{absurd[0]}={width.get(absurd[0])} on a section of {end - start:.2g} m"
                    for name in "bcd":
                        width.set(name, "0")
                    yield Repair(width, RANGE, fault, "the width is taken as constant there")


def _speeds(root: etree._Element) -> Iterator[Repair]:
    for speed in root.iterfind("road//speed"):
        limit, number = speed.get("max"), value(speed, "max")
        if limit is None:
            leave_out(speed)
            yield Repair(speed, SCHEMA, "the attribute 'max' is missing", "no limit is read")
        elif number is not None and number < 0.0:
            speed.set("max", "undefined")
            yield Repair(speed, SCHEMA, f"max={limit!r} is negative", "read as 'undefined'")
