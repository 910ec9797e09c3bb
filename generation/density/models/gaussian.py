"""One Gaussian."""

from __future__ import annotations

import numpy as np

from generation.density.base import Density, Whitening
from recognition.trfe.samples import Floats, Whole

DENSITY = {"class": "Gaussian", "title": "one Gaussian"}


class Gaussian(Density):
    """Normal distribution with the mean and covariance of the samples."""

    def _learn(self, theta: Floats, groups: Whole) -> None:
        self._whitening = Whitening.of(theta)

    def log_density(self, theta: Floats) -> Floats:
        """log p of rows (n, d): (n,)."""
        white = self._whitening.forward(theta)
        constant = self._whitening.log_jacobian - 0.5 * white.shape[1] * np.log(2.0 * np.pi)
        density: Floats = constant - 0.5 * np.square(white).sum(axis=1)
        return density

    def sample(self, n: int, generator: np.random.Generator) -> Floats:
        """Draws (n, d)."""
        return self._whitening.back(generator.standard_normal((n, len(self._whitening.mean))))
