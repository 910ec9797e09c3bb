"""Transition shapes of TransitionDynamics (OpenSCENARIO XML 1.3, class DynamicsShape).

A shape runs from 0 to 1 over a normalised parameter p in [0, 1]; its slope at the steepest point relates a
`rate` to a duration: duration = peak · |change| / rate.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple


def _linear(p: float) -> float:
    return p


def _cubic(p: float) -> float:
    return p * p * (3.0 - 2.0 * p)


def _sinusoidal(p: float) -> float:
    return 0.5 * (1.0 - math.cos(math.pi * p))


def _step(p: float) -> float:
    return 1.0


class Shape(NamedTuple):
    """A transition shape: its value over p and its greatest slope."""

    value: Callable[[float], float]
    peak: float


SHAPES: dict[str, Shape] = {
    "linear": Shape(_linear, 1.0),
    "cubic": Shape(_cubic, 1.5),
    "sinusoidal": Shape(_sinusoidal, math.pi / 2),
    "step": Shape(_step, 0.0),
}
