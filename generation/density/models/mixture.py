"""Mixture of Gaussians."""

from __future__ import annotations

import numpy as np

from generation.density.base import Density, Whitening
from generation.density.components import Components
from schemas.errors import UsageError
from xodr.array_types import FloatArray, IntArray

DENSITY = {"class": "Mixture", "title": "Gaussian mixture (BIC)"}
_MOST = 8
_RIDGE = 1e-3
"""Least variance of a component along any axis, where the samples' is 1."""


class Mixture(Density):
    """Gaussians with full covariances, by expectation maximisation on whitened samples.

    Their number is that of the least BIC among 1 … 8 (G. Schwarz, Estimating the dimension of a model, 1978), unless given.

    Args:
        components: their number.
        seed: of the starts.
    """

    def __init__(self, components: int | None = None, seed: int = 0) -> None:
        self.components, self.seed = components, seed

    def _learn(self, theta: FloatArray, groups: IntArray) -> None:
        from sklearn.mixture import GaussianMixture
        from threadpoolctl import threadpool_limits

        counts = range(1, _MOST + 1) if self.components is None else [self.components]
        possible = [count for count in counts if count * theta.shape[1] < len(theta)]
        if not possible:
            raise UsageError(f"{len(theta)} samples are too few for a mixture of {self.components} components")
        self._whitening = Whitening.of(theta)
        white = self._whitening.forward(theta)
        models = [GaussianMixture(count, reg_covar=_RIDGE, n_init=3, random_state=self.seed) for count in possible]
        with threadpool_limits(1):  # matrices this small lose far more by handing out work than more threads bring
            self._model = min((model.fit(white) for model in models), key=lambda model: model.bic(white))

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
