"""Mixture of Gaussians."""

from __future__ import annotations

from typing import Self

import numpy as np
from sklearn.mixture import GaussianMixture
from threadpoolctl import threadpool_limits

from generation.density.base import Density, Whitening
from generation.density.components import Components
from schemas.errors import UsageError
from xodr.array_types import FloatArray, IntArray

DENSITY = {"class": "Mixture", "title": "Gaussian mixture (BIC)"}
_MOST, _STARTS = 8, 3
_RIDGE = 1e-3
"""Least variance of a component along any axis, where the samples' is 1."""


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
        white = self._whitening.forward(theta)
        with threadpool_limits(1):  # matrices this small lose far more by handing out work than more threads bring
            self._model = self._from(_STARTS, self.components or self._likeliest(white, most), white)

    def _from(self, starts: int, components: int, white: FloatArray) -> GaussianMixture:
        return GaussianMixture(components, reg_covar=_RIDGE, n_init=starts, random_state=self.seed).fit(white)

    def _likeliest(self, white: FloatArray, most: int) -> int:
        most = min(most, _MOST, len(np.unique(white, axis=0)))  # more than there are points say nothing more
        return min(range(1, most + 1), key=lambda components: self._from(1, components, white).bic(white))

    def again(self, rows: int) -> Self:
        """One of as many components, or as many as the rows suffice for."""
        means = self._model.means_
        return type(self)(min(len(means), _most(rows, means.shape[1])), self.seed)

    def log_density(self, theta: FloatArray) -> FloatArray:
        """log p of rows (n, d): (n,)."""
        density: FloatArray = self._model.score_samples(self._whitening.forward(theta)) + self._whitening.log_jacobian
        return density

    @property
    def gaussians(self) -> Components:
        """The mixture's."""
        return self._whitening.gaussians(np.log(self._model.weights_), self._model.means_, self._model.covariances_)

    def sample(self, n: int, generator: np.random.Generator) -> FloatArray:
        """Draws (n, d)."""
        drawn = generator.choice(len(self._model.weights_), size=n, p=self._model.weights_)
        factors = np.linalg.cholesky(self._model.covariances_)[drawn]
        noise = generator.standard_normal((n, factors.shape[1], 1))
        return self._whitening.back(self._model.means_[drawn] + (factors @ noise)[..., 0])


def _most(n: int, d: int) -> int:
    """Most components that n rows of d columns suffice for."""
    return (n - 1) // d
