"""Shared parts of distributions: ranges, numbers as text, checks, elements; user-defined ones get
their meaning from plug-ins."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from decimal import Decimal
from functools import cache
from typing import Protocol

from lxml import etree

from schemas.common.errors import Unsupported, UsageError, blame, note_plugin
from schemas.common.plugins import installed, told
from schemas.common.policy import current
from xosc.document.node import Node


@dataclass(frozen=True)
class Range:
    """`Range`: a closed interval."""

    lower_limit: float
    upper_limit: float

    def __post_init__(self) -> None:
        finite("lowerLimit", self.lower_limit)
        finite("upperLimit", self.upper_limit)
        if self.lower_limit > self.upper_limit:
            raise UsageError(
                f"lowerLimit={self.lower_limit:g} is above upperLimit={self.upper_limit:g}"
            )

    def __contains__(self, value: float) -> bool:
        return self.lower_limit <= value <= self.upper_limit

    @classmethod
    def read(cls, node: Node) -> Range:
        """Read a `Range` element."""
        with located(node):
            return cls(node.finite("lowerLimit"), node.finite("upperLimit"))

    def write(self) -> etree._Element:
        """The `Range` element."""
        return element(
            "Range", lowerLimit=text(self.lower_limit), upperLimit=text(self.upper_limit)
        )


@contextmanager
def located(node: Node) -> Iterator[None]:
    """Context manager that gives errors of values the file and line of their element."""
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
    # Below, division by the sum overflows.
    if not 1e-300 < sum(values) < math.inf:
        raise UsageError("at least one weight must be positive, and their sum finite")


def text(value: float | Decimal) -> str:
    """A number as it stands in a file: the shortest text that reads back as the same number, `3`
    rather than `3.0`."""
    # By `repr`, the shortest text: of the double itself a decimal has up to a thousand digits.
    number = value if isinstance(value, Decimal) else Decimal(repr(float(value)))
    # Of 0 and −0 alike.
    if not number:
        return "0"
    number = number.normalize()
    # Up to a dozen places as digits; beyond, an exponent is shorter.
    return format(number, "f") if -12 < number.adjusted() < 18 else str(number)


def element(tag: str, *children: etree._Element, **attributes: str) -> etree._Element:
    """An element with children and attributes."""
    created = etree.Element(tag, attributes)
    created.extend(children)
    return created


GROUP = "xosc.distribution"
"""Entry point group: the name is the distribution's `type`, the object a class that keeps
`UserDistribution`."""


class UserDistribution(Protocol):
    """A plug-in, created with the element's text content (ValueError where that makes no sense to
    it).

    It need have only the method for its use.
    """

    def values(self) -> Sequence[str]:
        """Listed values, where it stands in a Deterministic."""

    def quantile(self, probability: float) -> float | str:
        """Value at a cumulative probability between 0 and 1, where it stands in a Stochastic."""


@dataclass(frozen=True)
class UserDefinedDistribution:
    """`UserDefinedDistribution`: type and content that a plug-in understands."""

    type: str
    content: str = ""

    @property
    def plugin(self) -> UserDistribution:
        """The plug-in with this distribution's content; Unsupported where no plug-in has this
        type's name."""
        if current().untrusted:
            raise Unsupported(
                f"the user-defined distribution type {self.type!r} is a plug-in's, and "
                "--untrusted loads none"
            )
        return _plugin(self.type, self.content)

    @property
    def size(self) -> int:
        """Number of values."""
        return len(self.plugin.values())

    def value(self, index: int) -> str:
        """The value at an index."""
        return str(self.plugin.values()[index])

    def quantile(self, probability: float) -> float | str:
        """The value at a cumulative probability."""
        return self.plugin.quantile(probability)

    @classmethod
    def read(cls, node: Node) -> UserDefinedDistribution:
        """Read the element."""
        created = cls(node.get("type"), node.text())
        with located(node):
            created.plugin  # noqa: B018 - an unknown type is refused at its line, before anything is varied
        return created

    def write(self) -> etree._Element:
        """The element of the distribution."""
        created = element("UserDefinedDistribution", type=self.type)
        created.text = self.content
        return created


@cache
def _plugin(kind: str, content: str) -> UserDistribution:
    plugins = installed(GROUP)
    if kind in plugins:
        entry = plugins[kind]
        note_plugin(entry.module, told(entry))
        try:
            return entry.load()(content)
        except ValueError as error:
            raise UsageError(
                f"the plug-in {kind!r} does not understand the content: {error}"
            ) from None
        except Exception as error:  # a plug-in's own code runs here
            raise UsageError(
                f"{told(entry)} can't be used: {blame(error, entry.module)}"
            ) from error
    known = ", ".join(sorted(plugins)) or "none is installed"
    raise Unsupported(
        f"no plug-in for the user-defined distribution type {kind!r} (entry point "
        f"group {GROUP}: {known})"
    )
