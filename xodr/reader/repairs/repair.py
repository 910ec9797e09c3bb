"""What a repair says, and what all repairs need of attributes."""

from __future__ import annotations

import math
from typing import NamedTuple

from lxml import etree

SCHEMA = "asam.net:xodr:1.0.0:xml.valid_schema"
"""The rule that an attribute breaks which is missing or is not of its type."""


class Repair(NamedTuple):
    """One change of the document. fault: what was wrong with the element. assumption: what is read instead."""

    element: etree._Element
    rule: str
    fault: str
    assumption: str


def value(element: etree._Element, name: str) -> float | None:
    """An attribute as a finite number; None where it is missing or something else."""
    try:
        number = float(element.get(name, "nan"))
    except ValueError:
        return None
    return number if math.isfinite(number) else None


def given(element: etree._Element, name: str, fault: str) -> str:
    """An attribute with what is wrong with it, or that it is missing."""
    text = element.get(name)
    return f"{name} is missing" if text is None else f"{name}={text!r} {fault}"


def leave_out(element: etree._Element) -> None:
    """Remove an element from its parent; the text behind it stays."""
    parent = element.getparent()
    if parent is not None:
        parent.remove(element)
