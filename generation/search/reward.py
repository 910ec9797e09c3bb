"""What a search is rewarded for: criticality, less what is implausible (METHOD §3)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from generation.density.base import Density
from generation.density.fitting import fitted, held_out
from generation.outcomes.outcomes import Outcomes
from schemas.errors import UsageError
from xodr.array_types import BoolArray, FloatArray

COLLISION, SAFE, RISK = 0.25, -0.1, 0.2
"""Rewards of a collision, of a scenario without any risk, and of R_risk = 1 in addition to that."""
Criticality = Callable[[Outcomes], FloatArray]
"""Reward (n,) without realism."""


def additive(outcomes: Outcomes) -> FloatArray:
    """−0.1 + 0.2·R_risk, and 0.25 for a collision on top: of two collisions the one that was dangerous all along counts more.

    An episode that failed counts as one without any risk.
    """
    return SAFE + RISK * outcomes.r_risk + COLLISION * outcomes.collision


@dataclass(frozen=True, eq=False)
class Realism:
    """How implausible parameters are, from 0 for what traffic does to 1.

    clip((NLL − Q99) / IQR, 0, 1), NLL = −log p(θ). Q99 and IQR are those of the training samples, each by the density of the
    other recordings: by a density that holds its own kernel a sample seems far more likely than any new one ever can.

    Attributes:
        density: p. limit: Q99. scale: IQR.
    """

    density: Density
    limit: float
    scale: float

    @classmethod
    def fitted(cls, name: str, theta: FloatArray, recordings: NDArray[np.str_]) -> Realism:
        """By a density that is fitted on recorded parameters (n, d).

        Args:
            name: of the density (`generation.density.model`).
            recordings: of each row (n,).

        Raises:
            UsageError: there is no such density, or the rows hold none.
        """
        return cls.of(fitted(name, theta, recordings), held_out(name, theta, recordings))

    @classmethod
    def of(cls, density: Density, held_out: FloatArray) -> Realism:
        """With the limits that held-out log-densities (n,) of the training samples set.

        Raises:
            UsageError: they are all the same.
        """
        low, high, limit = np.quantile(-held_out, [0.25, 0.75, 0.99])
        if not high > low:
            raise UsageError("held-out likelihoods of the samples do not differ: they set no scale for realism")
        return cls(density, float(limit), float(high - low))

    def judged(self, theta: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Log-densities (n,) of rows (n, d), and which of them are plausible: NLL ≤ Q99, so that they have no excess."""
        found = self.density.log_density(theta)
        return found, -found <= self.limit

    def excess(self, theta: FloatArray) -> FloatArray:
        """max((NLL − Q99) / IQR, 0) of rows (n, d): (n,)."""
        return np.maximum((-self.density.log_density(theta) - self.limit) / self.scale, 0.0)

    def penalty(self, theta: FloatArray) -> FloatArray:
        """Of rows (n, d): (n,) in 0 … 1."""
        return np.minimum(self.excess(theta), 1.0)


@dataclass(frozen=True, eq=False)
class Reward:
    """Criticality minus weight times implausibility.

    Attributes:
        realism: how implausible.
        weight: w; 0 leaves realism out.
        criticality: reward without realism.
    """

    realism: Realism
    weight: float = 0.2
    criticality: Criticality = additive

    def __call__(self, theta: FloatArray, outcomes: Outcomes) -> FloatArray:
        """Rewards (n,) of rows (n, d) and what came of them."""
        critical = self.criticality(outcomes)
        return critical - self.weight * self.realism.penalty(theta) if self.weight else critical
