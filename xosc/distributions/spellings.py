"""Values that distributions give to parameters in the spelling of other tools."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from schemas.remarks import Remark
from schemas.rules.typed_values import UID
from schemas.values import meant, quoted, type_named
from xosc.document import Document
from xosc.node import Node


def respelled(distribution: Document, scenario: Document, values: Mapping[str, str]) -> Iterator[Remark]:
    """A remark on each value that is not spelled as its parameter's type is, where it is given.

    Args:
        distribution: what gives the values.
        scenario: what declares the parameters.
        values: one set of values; those that it does not give count for nothing.
    """
    for declaration in scenario.root.iterfind("ParameterDeclarations/ParameterDeclaration"):
        name = declaration.get("name", "")
        text = values.get(name)
        try:
            kind = type_named(declaration.get("parameterType", ""))
            spelled = meant(kind, text) if text is not None else None
        except ValueError:
            continue  # whoever uses them refuses them
        if text is not None and spelled != text:
            message = f"the value of the parameter {name}: {quoted(text)} is not of type {kind}; {spelled} is meant"
            yield from (place.remark(UID, message) for place in _places(distribution.node, name, text))


def _places(top: Node, name: str, value: str) -> list[Node]:
    """The first element that gives a parameter a value; none where that is computed, or given otherwise."""
    for holder in top.iter("DeterministicSingleParameterDistribution", "StochasticDistribution"):
        found = [each for each in holder.iter("Element") if each.get("value", "") == value]
        if holder.get("parameterName", "") == name and found:
            return found[:1]
    assignments = top.iter("ParameterAssignment")
    return [each for each in assignments if (each.get("parameterRef", ""), each.get("value", "")) == (name, value)][:1]
