"""Deterministic distributions: listed values that are combined as a cartesian product (OpenSCENARIO
XML, Deterministic).

A distribution knows how many values it has and its value at an index, so that nothing need be
enumerated to count a space or to reach into the middle of it.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping
from copy import deepcopy
from dataclasses import dataclass
from decimal import Decimal
from functools import cached_property
from typing import get_args

from lxml import etree

from schemas.common.errors import UsageError
from schemas.common.remarks import Remark
from schemas.expressions import ExpressionError, substitute
from schemas.expressions.values import meant, quoted, type_named
from xosc.distributions.stochastic import Stochastic
from xosc.distributions.values import Range, UserDefinedDistribution, element, finite, located, text
from xosc.document import Document, write
from xosc.document.node import Node
from xosc.rules.values import DECLARED_TYPE_UID
from xosc.writing.files import FileHeader, new_document
from xosc.writing.versions import Version


@dataclass(frozen=True)
class DistributionSet:
    """`DistributionSet`: values as listed."""

    values: tuple[str, ...]

    def __post_init__(self) -> None:
        if not self.values:
            raise UsageError("a DistributionSet needs at least one Element")

    @property
    def size(self) -> int:
        """Number of values."""
        return len(self.values)

    def value(self, index: int) -> str:
        """The value at an index."""
        return self.values[index]

    @classmethod
    def read(cls, node: Node) -> DistributionSet:
        """Read the element."""
        with located(node):
            return cls(tuple(child.get("value") for child in node.children("Element")))

    def write(self) -> etree._Element:
        """The element of the distribution."""
        return element(
            "DistributionSet", *(element("Element", value=value) for value in self.values)
        )


@dataclass(frozen=True)
class DistributionRange:
    """`DistributionRange`: lowerLimit, lowerLimit + stepWidth, … up to and including upperLimit.

    The steps are counted in decimal arithmetic on the numbers as written, so that 0.1 after 0.2 is
    0.3, and an upper limit that is missed by less than a millionth of a step is reached.
    """

    range: Range
    step_width: float

    def __post_init__(self) -> None:
        finite("stepWidth", self.step_width)
        if self.step_width <= 0:
            raise UsageError(f"stepWidth={self.step_width:g} must be positive")
        if not math.isfinite((self.range.upper_limit - self.range.lower_limit) / self.step_width):
            raise UsageError("the range has more steps than can be counted")

    @cached_property
    def size(self) -> int:
        """Number of values."""
        lower, upper, step = self._decimals
        return int((upper - lower) / step + Decimal("1e-6")) + 1

    def value(self, index: int) -> str:
        """The value at an index."""
        lower, _, step = self._decimals
        return text(lower + index * step)

    @cached_property
    def _decimals(self) -> tuple[Decimal, Decimal, Decimal]:
        # Decimals of the shortest texts, not of the doubles: 0.1 is a tenth.
        lower, upper, step = (
            repr(float(value))
            for value in (self.range.lower_limit, self.range.upper_limit, self.step_width)
        )
        return Decimal(lower), Decimal(upper), Decimal(step)

    @classmethod
    def read(cls, node: Node) -> DistributionRange:
        """Read the element."""
        with located(node):
            return cls(Range.read(node.need("Range")), node.finite("stepWidth"))

    def write(self) -> etree._Element:
        """The element of the distribution."""
        return element("DistributionRange", self.range.write(), stepWidth=text(self.step_width))


SingleDistribution = DistributionSet | DistributionRange | UserDefinedDistribution
_SINGLE = {kind.__name__: kind for kind in get_args(SingleDistribution)}


@dataclass(frozen=True)
class DeterministicSingleParameterDistribution:
    """`DeterministicSingleParameterDistribution`: the values of one parameter."""

    parameter_name: str
    distribution: SingleDistribution

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """The parameters that get values here."""
        return (self.parameter_name,)

    @property
    def size(self) -> int:
        """Number of values."""
        return self.distribution.size

    def assignment(self, index: int) -> dict[str, str]:
        """Parameter and value at an index."""
        return {self.parameter_name: self.distribution.value(index)}

    @classmethod
    def read(cls, node: Node) -> DeterministicSingleParameterDistribution:
        """Read the element."""
        child = node.only()
        if child.tag not in _SINGLE:
            raise child.invalid("not a deterministic distribution of the standard")
        created = cls(node.get("parameterName"), _SINGLE[child.tag].read(child))
        # A plug-in may list none: the product of all sizes would be 0, and no run would say why.
        if not created.size:
            raise child.invalid("the distribution lists no value")
        return created

    def write(self) -> etree._Element:
        """The element of the distribution."""
        return element(
            "DeterministicSingleParameterDistribution",
            self.distribution.write(),
            parameterName=self.parameter_name,
        )


@dataclass(frozen=True)
class DeterministicMultiParameterDistribution:
    """`DeterministicMultiParameterDistribution` with its `ValueSetDistribution`: sets of values
    that belong together."""

    value_sets: tuple[Mapping[str, str], ...]

    def __post_init__(self) -> None:
        # A set without values would be a run with defaults that nobody listed.
        if not self.value_sets or not all(self.value_sets):
            raise UsageError(
                "a ValueSetDistribution needs at least one ParameterValueSet, and each at least "
                "one ParameterAssignment"
            )

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """The parameters that get values here."""
        return tuple(dict.fromkeys(name for value_set in self.value_sets for name in value_set))

    @property
    def size(self) -> int:
        """Number of value sets."""
        return len(self.value_sets)

    def assignment(self, index: int) -> dict[str, str]:
        """Parameters and values at an index."""
        return dict(self.value_sets[index])

    @classmethod
    def read(cls, node: Node) -> DeterministicMultiParameterDistribution:
        """Read the element."""
        with located(node):
            return cls(
                tuple(
                    _value_set(child)
                    for child in node.need("ValueSetDistribution").children("ParameterValueSet")
                )
            )

    def write(self) -> etree._Element:
        """The element of the distribution."""
        sets = (
            element(
                "ParameterValueSet",
                *(
                    element("ParameterAssignment", parameterRef=n, value=v)
                    for n, v in value_set.items()
                ),
            )
            for value_set in self.value_sets
        )
        return element(
            "DeterministicMultiParameterDistribution", element("ValueSetDistribution", *sets)
        )


def _value_set(node: Node) -> dict[str, str]:
    values: dict[str, str] = {}
    for assignment in node.children("ParameterAssignment"):
        name = assignment.get("parameterRef")
        if name in values:
            raise assignment.invalid(f"{name} is assigned twice in one ParameterValueSet")
        values[name] = assignment.get("value")
    return values


ParameterDistribution = (
    DeterministicSingleParameterDistribution | DeterministicMultiParameterDistribution
)
_KINDS = {kind.__name__: kind for kind in get_args(ParameterDistribution)}


@dataclass(frozen=True)
class Deterministic:
    """`Deterministic`: every combination of the values of its distributions, the last one varying
    fastest."""

    distributions: tuple[ParameterDistribution, ...]

    @property
    def size(self) -> int:
        """Number of combinations."""
        return math.prod(distribution.size for distribution in self.distributions)

    def assignment(self, index: int) -> dict[str, str]:
        """The combination at an index."""
        # The index is a number in mixed radix, whose last digit is that of the last distribution.
        chosen: list[dict[str, str]] = []
        for distribution in reversed(self.distributions):
            index, position = divmod(index, distribution.size)
            chosen.append(distribution.assignment(position))
        return {name: value for part in reversed(chosen) for name, value in part.items()}

    @classmethod
    def read(cls, node: Node) -> Deterministic:
        """Read the element."""
        for child in node.children():
            # Before any is read: of a mixed file the first wrong element is named, not what follows
            # from it.
            if child.tag not in _KINDS:
                raise child.invalid("not a deterministic distribution of the standard")
        return cls(tuple(_KINDS[child.tag].read(child) for child in node.children()))

    def write(self) -> etree._Element:
        """The element of the distribution."""
        return element(
            "Deterministic", *(distribution.write() for distribution in self.distributions)
        )


# files ------------------------------------------------------------------------------------------


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
                # In the same distribution too: two values of one parameter leave open which one
                # counts.
                if name in taken:
                    raise UsageError(
                        f"the parameter {name!r} gets its values from more than one distribution"
                    )
            taken.update(distribution.parameter_names)

    @classmethod
    def read(cls, node: Node) -> ParameterValueDistribution:
        """Read the element; its attributes may be expressions without parameters, as the file can
        declare none."""
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
        """The element of the distribution."""
        return element(
            "ParameterValueDistribution",
            element("ScenarioFile", filepath=self.scenario_file),
            self.definition.write(),
        )


def write_distribution(
    distribution: ParameterValueDistribution,
    path: str | os.PathLike[str],
    header: FileHeader,
    version: Version = (1, 3),
) -> None:
    """Write a distribution as a file.

    Raises:
        Unsupported: the version cannot say it: distributions came with 1.1, log-normal ones with
            1.3.
        UsageError: the file can't be written.
    """
    write(new_document(path, header, [distribution.write()], version), path)


def _evaluated(node: Node) -> Node:
    """A copy with literal attributes."""
    # Remarks quote the document as it is written (`respelled`).
    copied = Node(deepcopy(node.element), node.path)
    for part in copied.iter():
        for name in map(str, part.element.attrib):
            try:
                part.element.set(name, substitute(part.get(name), _no_parameter))
            except ExpressionError as error:
                raise part.invalid(
                    f"{name}: {error.message} (a distribution file declares none)"
                ) from None
    return copied


def _no_parameter(name: str) -> str:
    raise KeyError(name)


def respelled(
    distribution: Document, scenario: Document, values: Mapping[str, str]
) -> Iterator[Remark]:
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
            message = (
                f"the value of the parameter {name}: {quoted(text)} is not of type {kind}; "
                f"{spelled} is meant"
            )
            yield from (
                place.remark(DECLARED_TYPE_UID, message)
                for place in _places(distribution.node, name, text)
            )


def _places(top: Node, name: str, value: str) -> list[Node]:
    """The first element that gives a parameter a value; none where that is computed, or given
    otherwise."""
    for holder in top.iter("DeterministicSingleParameterDistribution", "StochasticDistribution"):
        places = [
            element for element in holder.iter("Element") if element.get("value", "") == value
        ]
        if holder.get("parameterName", "") == name and places:
            return places[:1]
    assignments = top.iter("ParameterAssignment")
    return [
        assignment
        for assignment in assignments
        if (assignment.get("parameterRef", ""), assignment.get("value", "")) == (name, value)
    ][:1]
