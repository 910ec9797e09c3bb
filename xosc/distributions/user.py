"""User-defined distributions: the standard leaves their meaning to tools, here it comes from installed plug-ins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import entry_points
from typing import Protocol

from lxml import etree

from schemas.errors import Unsupported, UsageError
from xosc.distributions.values import element, located
from xosc.node import Node

GROUP = "xosc.distribution"
"""Entry point group: the name is the distribution's `type`, the object a class that keeps `UserDistribution`."""


class UserDistribution(Protocol):
    """A plug-in, created with the element's text content (ValueError where that makes no sense to it).

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
        """The plug-in with this distribution's content; Unsupported where no plug-in has this type's name."""
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
        """From its element."""
        created = cls(node.get("type"), node.text())
        with located(node):
            created.plugin  # noqa: B018 - an unknown type is refused at its line, before anything is varied
        return created

    def write(self) -> etree._Element:
        """As its element."""
        created = element("UserDefinedDistribution", type=self.type)
        created.text = self.content
        return created


@cache
def _plugin(kind: str, content: str) -> UserDistribution:
    for entry in entry_points(group=GROUP, name=kind):
        try:
            return entry.load()(content)
        except ValueError as error:
            raise UsageError(f"the plug-in {kind!r} does not understand the content: {error}") from None
    known = ", ".join(sorted(entry_points(group=GROUP).names)) or "none is installed"
    raise Unsupported(f"no plug-in for the user-defined distribution type {kind!r} (entry point group {GROUP}: {known})")
