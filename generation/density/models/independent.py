"""One kernel density estimate for each parameter, as if they were independent."""

from __future__ import annotations

import numpy as np

from generation.density.base import Density
from generation.density.models.kde import KDE
from xodr.array_types import FloatArray, IntArray

DENSITY = {"class": "Independent", "title": "independent 1-D KDEs"}


class Independent(Density):
    """p(θ) = Π_j p_j(θ_j), each p_j a `KDE` with a bandwidth of its own."""

    def _learn(self, theta: FloatArray, groups: IntArray) -> None:
        self._marginals = [KDE().fit(column[:, None], groups) for column in theta.T]

    def log_density(self, theta: FloatArray) -> FloatArray:
        """log p of rows (n, d): (n,)."""
        columns = zip(self._marginals, theta.T, strict=True)
        return np.sum([marginal.log_density(column[:, None]) for marginal, column in columns], axis=0)

    def sample(self, n: int, generator: np.random.Generator) -> FloatArray:
        """Draws (n, d)."""
        return np.hstack([marginal.sample(n, generator) for marginal in self._marginals])
