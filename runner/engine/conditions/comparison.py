"""Comparing a quantity with the value of a condition."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from xosc.document.node import Node

if TYPE_CHECKING:
    from runner.engine.compile.array_protocols import ArrayRun
    from schemas.common.array_types import BoolArray, FloatArray

TOLERANCE = 1e-6
"""Quantities closer than this count as equal, and as neither less nor greater, so that sums of time
steps and rounded file values compare as they are meant (esmini's tolerance)."""


def _equal(quantity: float, value: float) -> bool:
    return abs(quantity - value) <= TOLERANCE


def _not_equal(quantity: float, value: float) -> bool:
    return abs(quantity - value) > TOLERANCE


class ComparisonRule(NamedTuple):
    """A Rule of the standard: how it is written, what it compares, and where the tolerance puts its
    border."""

    symbol: str
    holds: Callable[[float, float], bool]
    shift: float


RULES = {
    "equalTo": ComparisonRule("=", _equal, 0.0),
    "notEqualTo": ComparisonRule("≠", _not_equal, 0.0),
    "greaterThan": ComparisonRule(">", operator.gt, TOLERANCE),
    "lessThan": ComparisonRule("<", operator.lt, -TOLERANCE),
    "greaterOrEqual": ComparisonRule("≥", operator.ge, -TOLERANCE),
    "lessOrEqual": ComparisonRule("≤", operator.le, TOLERANCE),
}


_BOUNDED = (operator.lt, operator.le, _equal)
"""Comparisons that no quantity above the value and its tolerance fulfils."""


class Comparison:
    """`quantity rule value`.

    Args:
        rule: name of the standard's Rule.
        value: what is compared with.
        unit: for descriptions.

    Attributes:
        greatest: no quantity above this holds.
    """

    __slots__ = ("_border", "_holds", "greatest", "symbol", "unit", "value")

    def __init__(self, rule: str, value: float, unit: str = "") -> None:
        chosen = RULES[rule]
        self.symbol = chosen.symbol
        self.value = value
        self.unit = unit
        self._holds = chosen.holds
        self._border = value + chosen.shift
        self.greatest = value + 2.0 * TOLERANCE if chosen.holds in _BOUNDED else math.inf

    @classmethod
    def from_xml(cls, node: Node, unit: str = "") -> Comparison:
        """Read the attributes rule and value; `INF` is a value."""
        return cls(node.choice("rule", RULES), node.float("value"), unit)

    def holds(self, quantity: float | None) -> bool:
        """Whether the comparison is true; an undefined quantity (None) makes it false."""
        return quantity is not None and self._holds(quantity, self._border)

    def holds_arrays(self, quantity: FloatArray, run: ArrayRun) -> BoolArray:
        """`holds` in many runs (n,); NaN is an undefined quantity."""
        found: BoolArray = self._holds(quantity, run.value(self._border))  # type: ignore[arg-type, assignment]
        return found

    def describe(self, what: str, quantity: float | None) -> str:
        """`what = quantity unit < value unit` where that is true, else `what < value unit (is
        quantity unit)`; the quantity may be undefined."""
        seen = "undefined" if quantity is None else f"{quantity:.4g} {self.unit}".rstrip()
        wanted = f"{self.symbol} {self.value:g} {self.unit}".rstrip()
        return compared(what, seen, wanted, self.holds(quantity))


def compared(what: str, seen: str, wanted: str, holds: bool) -> str:
    """Return a comparison in words that are true whether it holds or not."""
    return f"{what} = {seen} {wanted}" if holds else f"{what} {wanted} (is {seen})"
