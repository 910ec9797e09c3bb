"""Which class executes which OpenSCENARIO element: one table per family, nothing skipped in silence.

A family's classes announce themselves with `@action("SpeedAction")`, `@condition("SpeedCondition")` or
`@position("LanePosition")`, each in a module of the family's folder. Where the standard uses one element name for two
things, the key is `Parent/Name` (`VariableAction/SetAction`). What is deliberately not executed is entered by `refuse`
with the reason that the user reads. `docs/coverage.md` is generated from these tables.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, TypeVar

from schemas.common import discovery
from xosc.node import Node


class FromXml(Protocol):
    """Contract of registered classes: built from their element."""

    @classmethod
    def from_xml(cls, node: Node, context: Any) -> Any:
        """Build the runtime object; InvalidFile or Unsupported where that can't be done."""
        ...


C = TypeVar("C", bound=type)


class Registry:
    """Element name → class that executes it, for one family of elements.

    Args:
        family: the family's name, for messages.
        package: whose modules hold the classes; they are imported on first use.
    """

    def __init__(self, family: str, package: str) -> None:
        self.family = family
        self.classes: dict[str, type[FromXml]] = {}
        self.refused: dict[str, str] = {}
        self._package = package
        self._loaded = False

    def __call__(self, *names: str) -> Callable[[C], C]:
        """Class decorator that enters a class under one or more element names."""

        def enter(cls: C) -> C:
            for name in names:
                if name in self.classes:
                    raise ValueError(f"{self.family} {name} is registered twice")
                self.classes[name] = cls
            return cls

        return enter

    def refuse(self, name: str, reason: str) -> None:
        """Enter an element that is refused by name, with the reason."""
        self.refused[name] = reason

    def load(self) -> None:
        """Import the family's modules, so that the tables are complete."""
        if not self._loaded:
            discovery.load(self._package)
            self._loaded = True

    def find(self, node: Node, parent: str | None = None) -> type[FromXml]:
        """The class for an element.

        Args:
            node: the element.
            parent: name of the enclosing element, for names that mean different things in different places.

        Raises:
            Unsupported: the element is refused, with the reason, or unknown to this version.
        """
        self.load()
        for name in ([f"{parent}/{node.tag}"] if parent else []) + [node.tag]:
            if name in self.classes:
                return self.classes[name]
            if name in self.refused:
                raise node.unsupported(self.refused[name])
        raise node.unsupported(f"this {self.family} is not known to the runner")


action = Registry("action", "runner.actions")
condition = Registry("condition", "runner.conditions")
position = Registry("position", "runner.positions")
