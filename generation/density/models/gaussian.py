"""One Gaussian."""

from __future__ import annotations

import numpy as np

from generation.density.base import Density, Whitening
from generation.density.components import Components
from xodr.array_types import FloatArray, IntArray

DENSITY = {"class": "Gaussian", "title": "one Gaussian"}


class Gaussian(Density):
    """Normal distribution with the mean and covariance of the samples."""

    def _learn(self, theta: FloatArray, groups: IntArray) -> None:
        self._whitening = Whitening.of(theta)

    def log_density(self, theta: FloatArray) -> FloatArray:
        """log p of rows (n, d): (n,)."""
        white = self._whitening.forward(theta)
        constant = self._whitening.log_jacobian - 0.5 * white.shape[1] * np.log(2.0 * np.pi)
        density: FloatArray = constant - 0.5 * np.square(white).sum(axis=1)
        return density

    @property
    def gaussians(self) -> Components:
        """The one."""
        d = len(self._whitening.mean)
        return self._whitening.gaussians(np.zeros(1), np.zeros((1, d)), np.eye(d)[None])

    def sample(self, n: int, generator: np.random.Generator) -> FloatArray:
        """Draws (n, d)."""
        return self._whitening.back(generator.standard_normal((n, len(self._whitening.mean))))
