"""Probabilities from weighted draws, with a cheap play of the same draws as control."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from schemas.commands.wording import many
from xodr.array_types import BoolArray, FloatArray

LEAST_EFFECTIVE = 50.0
"""Effective number of failures below which an interval is not to be trusted"""
_NORMAL = 1.959964
"""Quantile of the normal distribution that leaves 2.5 % above"""


class Probability(NamedTuple):
    """A probability with its uncertainty.

    Attributes:
        value: estimate. deviation: its standard deviation.
        effective: effective number of failures among the draws, (Σw)²/Σw² of their weights w (L. Kish, 1965).
        bound: upper limit where no draw fails.
    """

    value: float
    deviation: float
    effective: float
    bound: float

    @property
    def variation(self) -> float:
        """Coefficient of variation; infinite where no draw fails."""
        return self.deviation / self.value if self.value > 0.0 else math.inf

    @property
    def interval(self) -> tuple[float, float]:
        """Of 95 %, symmetrical in the logarithm: probabilities are positive, and their weighted sums are skewed."""
        if self.value <= 0.0:
            return 0.0, self.bound
        factor = math.exp(_NORMAL * math.sqrt(math.log1p(self.variation**2)))
        return self.value / factor, min(self.value * factor, 1.0)

    @property
    def stable(self) -> bool:
        """Whether there are enough failures for the interval to be trusted."""
        return self.effective >= LEAST_EFFECTIVE

    def within(self, other: Probability) -> Probability:
        """This one as of an event that implies another one, whose upper limit holds for it too where it is to be trusted."""
        return self._replace(bound=min(self.bound, other.interval[1])) if other.stable else self

    @property
    def counted(self) -> str:
        """The effective number of failures, for people."""
        return many(round(self.effective), "effective failure")

    def __str__(self) -> str:
        low, high = self.interval
        if self.value <= 0.0:
            return f"below {high:.1e} (no draw fails)"
        shown = f"{self.value:.2e} [{low:.2e}, {high:.2e}]"
        return shown if self.stable else f"{shown}, unstable: {self.counted}"


class Control(NamedTuple):
    """The same event on a cheap twin.

    Attributes:
        same: whether it happens there at the draws (n,).
        failing: whether it happens there at many more draws (m,) of the proposal. weights: theirs (m,).
    """

    same: BoolArray
    failing: BoolArray
    weights: FloatArray


def probability(failing: BoolArray, weights: FloatArray, greatest: float, control: Control | None = None) -> Probability:
    """Of an event, by importance sampling with the twin as control variate.

    P = mean(w·f) − β (mean(w·g) − G), f the event, g that on the twin, G its mean over many draws, β the regression of the first
    on the second: only what the twin gets wrong is left to chance.
    A. B. Owen, Monte Carlo theory, methods and examples, 2013, §8.9 and §9.

    Args:
        failing: whether it happens at draws (n,) of the proposal. weights: p/q of these (n,).
        greatest: weight that none exceeds.
        control: on the twin; None where there is none.
    """
    found = weights * failing
    n, value, residual, extra = len(found), float(found.mean()), found - found.mean(), 0.0
    if control is not None:
        same, many = weights * control.same, control.weights * control.failing
        spread = same - same.mean()
        square = float(spread @ spread)
        slope = float(residual @ spread) / square if square > 0.0 else 0.0
        value -= slope * float(same.mean() - many.mean())
        residual = residual - slope * spread
        extra = slope**2 * float(many.var(ddof=1)) / len(many)
    deviation = math.sqrt(float(residual @ residual) / (n - 1) / n + extra)
    squares = float(found @ found)
    effective = float(found.sum()) ** 2 / squares if squares > 0.0 else 0.0
    return Probability(max(value, 0.0), deviation, effective, _rare(n) * greatest)


def _rare(n: int) -> float:
    """Upper 95 % limit of a share of which n draws show nothing: the rule of three, exactly."""
    return float(-np.expm1(math.log(0.05) / n))
