"""Attributes of OpenDRIVE elements as Python values, with complaints that name line and element.

`xodr.load` adds the file's path to these errors.
"""

from __future__ import annotations

import math

from lxml import etree

from schemas.common.errors import InvalidFile, Unsupported
from schemas.xml import line_of
from xodr.model import PERMANENT, TEMPORARY
from xodr.profiles import ZERO, Cubic, Profile

LARGEST = 1e12
"""Numbers beyond this are refused: nothing on Earth needs them, and arithmetic on them overflows."""


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
    if not abs(result) <= LARGEST:
        raise invalid(element, f"{name}={value!r} must be a number between -{LARGEST:g} and {LARGEST:g}")
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
        InvalidFile: the attribute decreases from one to the next, or is the same for two that differ although `distinct`.
    """
    values = [number(element, name) for element in elements]
    for before, element, start, value in zip(elements, elements[1:], values, values[1:], strict=False):
        if value < start:
            raise invalid(element, f"{name}={value:g} follows {start:g}, but {name} must not decrease")
        if distinct and value == start and element.attrib != before.attrib:
            raise invalid(element, f"{name}={value:g} must differ from that of the record before")
    return values


def speed(element: etree._Element) -> float | None:
    """The `max` of a speed element in m/s, None for "no limit" and "undefined"."""
    if text(element, "max").strip().lower() in ("no limit", "undefined", ""):
        return None
    units = {"m/s": 1.0, "mph": 0.44704, "km/h": 1.0 / 3.6}
    unit = element.get("unit") or "m/s"
    if unit not in units:
        raise invalid(element, f"unit={unit!r} is not one of {', '.join(units)}")
    value = number(element, "max") * units[unit]
    if value < 0.0 or math.isnan(value):
        raise invalid(element, f"max={element.get('max')!r} must not be negative")
    return value


def coefficients(element: etree._Element) -> tuple[float, float, float, float]:
    """The polynomial parameters a, b, c, d."""
    return number(element, "a"), number(element, "b", 0.0), number(element, "c", 0.0), number(element, "d", 0.0)


def profile(elements: list[etree._Element]) -> Profile:
    """Records with `s` as a function of s: 0 before the first."""
    if not elements:
        return ZERO
    starts = ascending(elements, "s", distinct=True)
    pieces = {start: Cubic(start, *coefficients(element)) for start, element in zip(starts, elements, strict=True)}
    if starts[0] > 0.0:
        pieces = {0.0: Cubic(0.0, 0.0), **pieces}
    return Profile(pieces.values())


def validity(element: etree._Element) -> tuple[tuple[int, int], ...]:
    """Lane ranges (from, to) that a signal or object applies to."""
    return tuple((integer(item, "fromLane"), integer(item, "toLane")) for item in element.iterfind("validity"))


def lane_layer(element: etree._Element, name: str = "layer") -> str:
    """A layer of lanes: the permanent one where the file does not say."""
    layer = element.get(name) or PERMANENT
    if layer not in (PERMANENT, TEMPORARY):
        raise invalid(element, f"{name}={layer!r} is neither {PERMANENT} nor {TEMPORARY}")
    return layer


def contact_point(element: etree._Element) -> str | None:
    """Which end of a road a link or connection means: "start", "end" or None where the file does not say."""
    contact = element.get("contactPoint")
    if contact not in ("start", "end", None):
        raise invalid(element, f"contactPoint={contact!r} is neither start nor end")
    return contact
