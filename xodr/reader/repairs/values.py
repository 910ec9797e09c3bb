"""Attributes that are missing or make no sense where only one value can be meant."""

from __future__ import annotations

from collections.abc import Iterator

from lxml import etree

from xodr.reader.elements import LARGEST
from xodr.reader.repairs.repair import SCHEMA, Repair, leave_out, value

NUMBERS = "xosc.toolchain:xodr:1.4.0:numbers_are_plausible"

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
"""Records with absurd numbers are read as constant where they hold for at most this length, in m."""


def repair_values(root: etree._Element) -> Iterator[Repair]:
    """Fill in, correct or leave out single values."""
    yield from _empty_curves(root)
    yield from _missing(root)
    yield from _absurd_records(root)
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


def _absurd_records(root: etree._Element) -> Iterator[Repair]:
    """Polynomials that some exporters fit to stretches of some micrometres."""
    for road in root.iterfind("road"):
        length = value(road, "length")
        for path in ("elevationProfile/elevation", "lateralProfile/superelevation", "lanes/laneOffset"):
            yield from _constant_where_short(road.findall(path), "s", length)
        sections = road.findall("lanes/laneSection")
        ends = [*(value(section, "s") for section in sections), length]
        for section, start, end in zip(sections, ends, ends[1:], strict=False):
            reach = None if start is None or end is None else end - start
            for lane in section.iter("lane"):
                for tag in ("width", "border"):
                    yield from _constant_where_short(lane.findall(tag), "sOffset", reach)


def _constant_where_short(records: list[etree._Element], name: str, reach: float | None) -> Iterator[Repair]:
    """Make those records constant that hold for a short stretch only and have numbers that are none; `reach` ends the last."""
    ends = [*(value(record, name) for record in records), reach]
    for record, start, end in zip(records, ends, ends[1:], strict=False):
        absurd = next((letter for letter in "abcd" if not _plausible(record, letter)), None)
        if absurd is None or start is None or end is None or end - start > _SHORT:
            continue
        fault = f"{absurd}={record.get(absurd)} for {end - start:.2g} m"
        if _plausible(record, "a"):
            record.attrib.update(dict.fromkeys("bcd", "0"))
            yield Repair(record, NUMBERS, fault, "the record is read as constant")
        else:
            leave_out(record)
            yield Repair(record, NUMBERS, fault, "the record is left out")


def _plausible(record: etree._Element, name: str) -> bool:
    number = value(record, name)
    return name not in record.attrib or (number is not None and abs(number) <= LARGEST)


def _speeds(root: etree._Element) -> Iterator[Repair]:
    for speed in root.iterfind("road//speed"):
        limit, number = speed.get("max"), value(speed, "max")
        if limit is None:
            leave_out(speed)
            yield Repair(speed, SCHEMA, "the attribute 'max' is missing", "no limit is read")
        elif number is not None and number < 0.0:
            speed.set("max", "undefined")
            yield Repair(speed, SCHEMA, f"max={limit!r} is negative", "read as 'undefined'")
