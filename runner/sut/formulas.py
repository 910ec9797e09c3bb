"""Choices in formulas that hold for one case and, as arrays, for many: what a driver decides is written once.

Conditions are combined by `&` and `|`; both sides of a choice are worked out.
"""

from __future__ import annotations

from typing import Any

import numpy as np


def choose(condition: Any, one: Any, other: Any) -> Any:
    """One value where a condition holds, the other one elsewhere."""
    if isinstance(condition, np.ndarray):
        return np.where(condition, one, other)
    return one if condition else other


def ratio(numerator: Any, denominator: Any, otherwise: float) -> Any:
    """A quotient where the denominator is positive, another value elsewhere."""
    if isinstance(denominator, np.ndarray):
        found = np.full(np.broadcast_shapes(np.shape(numerator), denominator.shape), otherwise)
        return np.divide(numerator, denominator, out=found, where=denominator > 0.0)
    return numerator / denominator if denominator > 0.0 else otherwise


def least(one: Any, other: Any) -> Any:
    """The lesser value."""
    return choose(one < other, one, other)


def greatest(one: Any, other: Any) -> Any:
    """The greater value."""
    return choose(one > other, one, other)
