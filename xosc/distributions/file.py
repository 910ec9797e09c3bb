"""ParameterValueDistribution files: reading and writing, and values in the spelling of other tools."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from copy import deepcopy
from dataclasses import dataclass

from lxml import etree

from schemas.common.errors import UsageError
from schemas.common.remarks import Remark
from schemas.expressions import ExpressionError, substitute
from schemas.values import meant, quoted, type_named
from xosc.distributions.deterministic import Deterministic
from xosc.distributions.stochastic import Stochastic
from xosc.distributions.values import element
from xosc.document import Document, write
from xosc.files import Header, new_document
from xosc.node import Node
from xosc.rules.values import DECLARED_TYPE_UID
from xosc.versions import Version


@dataclass(frozen=True)
class ParameterValueDistribution:
    """`ParameterValueDistribution`: a scenario and the values that its parameters are to take.

    Attributes:
        scenario_file: the scenario's path as written, relative to the distribution's own file.
        definition: what the parameters' values are.
    """

    scenario_file: str
    definition: Deterministic | Stochastic

    def __post_init__(self) -> None:
        taken: set[str] = set()
        for distribution in self.definition.distributions:
            for name in distribution.parameter_names:
                if name in taken:
                    raise UsageError(f"the parameter {name!r} gets its values from more than one distribution")
            taken.update(distribution.parameter_names)

    @classmethod
    def read(cls, node: Node) -> ParameterValueDistribution:
        """From its element, whose attributes may be expressions without parameters (the file can declare none)."""
        node = _evaluated(node)
        definition = node.find("Deterministic") or node.find("Stochastic")
        if definition is None:
            raise node.invalid("the element Deterministic or Stochastic is missing")
        kind = Deterministic if definition.tag == "Deterministic" else Stochastic
        try:
            return cls(node.need("ScenarioFile").get("filepath"), kind.read(definition))
        except UsageError as error:
            raise definition.invalid(error.message) from None

    def write(self) -> etree._Element:
        """As its element."""
        return element(
            "ParameterValueDistribution", element("ScenarioFile", filepath=self.scenario_file), self.definition.write()
        )


def write_distribution(
    distribution: ParameterValueDistribution, path: str | os.PathLike[str], header: Header, version: Version = (1, 3)
) -> None:
    """Write a distribution as a file.

    Raises:
        Unsupported: the version cannot say it: distributions came with 1.1, log-normal ones with 1.3.
        UsageError: the file can't be written.
    """
    write(new_document(path, header, [distribution.write()], version), path)


def _evaluated(node: Node) -> Node:
    """A copy whose attributes are literals."""
    copied = Node(deepcopy(node.element), node.path)
    for part in copied.iter():
        for name in map(str, part.element.attrib):
            try:
                part.element.set(name, substitute(part.get(name), _no_parameter))
            except ExpressionError as error:
                raise part.invalid(f"{name}: {error.message} (a distribution file declares none)") from None
    return copied


def _no_parameter(name: str) -> str:
    raise KeyError(name)


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
            continue  # refused where they are used
        if text is not None and spelled != text:
            message = f"the value of the parameter {name}: {quoted(text)} is not of type {kind}; {spelled} is meant"
            yield from (place.remark(DECLARED_TYPE_UID, message) for place in _places(distribution.node, name, text))


def _places(top: Node, name: str, value: str) -> list[Node]:
    """The first element that gives a parameter a value; none where that is computed, or given otherwise."""
    for holder in top.iter("DeterministicSingleParameterDistribution", "StochasticDistribution"):
        found = [each for each in holder.iter("Element") if each.get("value", "") == value]
        if holder.get("parameterName", "") == name and found:
            return found[:1]
    assignments = top.iter("ParameterAssignment")
    return [each for each in assignments if (each.get("parameterRef", ""), each.get("value", "")) == (name, value)][:1]
