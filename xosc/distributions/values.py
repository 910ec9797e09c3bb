"""What all distributions share: ranges, numbers as text, checks, and reading and writing of elements."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from decimal import Decimal

from lxml import etree

from schemas.errors import Unsupported, UsageError
from xosc.node import Node


@dataclass(frozen=True)
class Range:
    """`Range`: a closed interval."""

    lower_limit: float
    upper_limit: float

    def __post_init__(self) -> None:
        finite("lowerLimit", self.lower_limit)
        finite("upperLimit", self.upper_limit)
        if self.lower_limit > self.upper_limit:
            raise UsageError(f"lowerLimit={self.lower_limit:g} is above upperLimit={self.upper_limit:g}")

    def __contains__(self, value: float) -> bool:
        return self.lower_limit <= value <= self.upper_limit

    @classmethod
    def read(cls, node: Node) -> Range:
        """From a `Range` element."""
        with located(node):
            return cls(node.finite("lowerLimit"), node.finite("upperLimit"))

    def write(self) -> etree._Element:
        """As a `Range` element."""
        return element("Range", lowerLimit=text(self.lower_limit), upperLimit=text(self.upper_limit))


@contextmanager
def located(node: Node) -> Iterator[None]:
    """Say where in a file it was read what is wrong with a value: an InvalidFile or Unsupported at that element."""
    try:
        yield
    except UsageError as error:
        raise node.invalid(error.message) from None
    except Unsupported as error:
        raise node.unsupported(error.message) from None


def finite(name: str, value: float) -> None:
    """Refuse NaN and infinities."""
    if not math.isfinite(value):
        raise UsageError(f"{name}={value} must be a finite number")


def weights(values: list[float]) -> None:
    """Refuse weights that are no probabilities, even after division by their sum."""
    for value in values:
        finite("weight", value)
        if value < 0:
            raise UsageError(f"weight={value:g} must not be negative")
    if not 1e-300 < sum(values) < math.inf:
        raise UsageError("at least one weight must be positive, and their sum finite")


def text(value: float | Decimal) -> str:
    """A number as it stands in a file: the shortest text that reads back as the same number, `3` rather than `3.0`."""
    number = value if isinstance(value, Decimal) else Decimal(repr(float(value)))
    if not number:
        return "0"
    number = number.normalize()
    return format(number, "f") if -12 < number.adjusted() < 18 else str(number)


def element(tag: str, *children: etree._Element, **attributes: str) -> etree._Element:
    """An element with children and attributes."""
    created = etree.Element(tag, attributes)
    created.extend(children)
    return created
