"""Values in the XML of CommonRoad."""

from __future__ import annotations

import math

from lxml import etree

from recognition.datasets.tables.values import GREATEST
from schemas.errors import InvalidFile, Unsupported
from schemas.xml import line_of


def child(parent: etree._Element, *path: str) -> etree._Element:
    """The element at the end of a path of names.

    Raises:
        InvalidFile: it is not there.
    """
    for name in path:
        found = next(parent.iterchildren(name), None)
        if found is None:
            raise invalid(parent, f"there is no {name}")
        parent = found
    return parent


def number(parent: etree._Element, *path: str) -> float:
    """The number in the element at the end of a path of names."""
    element = child(parent, *path)
    return measured(element.text or "", element)


def measured(text: str, element: etree._Element) -> float:
    """A finite number of the magnitude of a measured value.

    Raises:
        InvalidFile: it is none.
    """
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not abs(value) <= GREATEST:
        raise invalid(element, f"{text.strip()!r} is no measured value")
    return value


def invalid(element: etree._Element, message: str) -> InvalidFile:
    """The error for an element that is wrong."""
    return InvalidFile(message, path=_file(element), line=line_of(element), element=str(element.tag))


def unsupported(element: etree._Element, message: str) -> Unsupported:
    """The error for an element that is right, but asks for something that is not done here."""
    return Unsupported(message, path=_file(element), line=line_of(element), element=str(element.tag))


def _file(element: etree._Element) -> str | None:
    return element.getroottree().docinfo.URL
