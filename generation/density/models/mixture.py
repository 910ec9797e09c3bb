"""Mixture of Gaussians."""

from __future__ import annotations

from typing import Self

import numpy as np

from generation.density.base import Density, Whitening
from generation.density.components import Components
from generation.density.maximisation import Maximisation
from schemas.errors import UsageError
from xodr.array_types import FloatArray, IntArray

DENSITY = {"class": "Mixture", "title": "Gaussian mixture (BIC)"}
_MOST, _STARTS = 8, 3


class Mixture(Density):
    """Gaussians with full covariances, by expectation maximisation on whitened samples, the likeliest of three starts.

    Their number is that of the least BIC among 1 … 8, each from one start, unless given.
    G. Schwarz, Estimating the dimension of a model, Annals of Statistics 6, 1978.

    Args:
        components: their number.
        seed: of the starts.
    """

    def __init__(self, components: int | None = None, seed: int = 0) -> None:
        self.components, self.seed = components, seed

    def _learn(self, theta: FloatArray, groups: IntArray) -> None:
        most = _most(*theta.shape)
        if most < (self.components or 1):
            raise UsageError(f"{len(theta)} samples are too few for a mixture of {self.components} components")
        self._whitening = Whitening.of(theta)
        samples = Maximisation(self._whitening.forward(theta))
        components = self.components or self._number(samples, len(theta), min(most, _MOST))
        self._white = samples.likeliest(components, _STARTS, self.seed).gaussians

    def _number(self, samples: Maximisation, n: int, most: int) -> int:
        return min(range(1, most + 1), key=lambda components: samples.likeliest(components, 1, self.seed).bic(n))

    def again(self, rows: int) -> Self:
        """One of as many components, or as many as the rows suffice for."""
        means = self._white.means
        return type(self)(min(len(means), _most(rows, means.shape[1])), self.seed)

    def log_density(self, theta: FloatArray) -> FloatArray:
        """log p of rows (n, d): (n,)."""
        return self._white.log_density(self._whitening.forward(theta)) + self._whitening.log_jacobian

    @property
    def gaussians(self) -> Components:
        """The mixture's."""
        return self._whitening.gaussians(self._white.log_weights, self._white.means, self._white.covariances)

    def sample(self, n: int, generator: np.random.Generator) -> FloatArray:
        """Draws (n, d)."""
        return self._whitening.back(self._white.sample(n, generator))


def _most(n: int, d: int) -> int:
    """Most components that n rows of d columns suffice for."""
    return (n - 1) // d
