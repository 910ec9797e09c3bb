"""Sums of Gaussians: what densities that can be conditioned on pinned values give of themselves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from xodr.array_types import FloatArray

_CHUNK = 4_000_000
"""Most numbers held at once."""


@dataclass(frozen=True, eq=False)
class Components:
    """p(z) = Σ_k w_k N(z; μ_k, Σ_k).

    Attributes:
        log_weights: log w_k (k,), normalised.
        means: μ (k, d).
        covariances: Σ (k, d, d), or (1, d, d) where all have the same.
    """

    log_weights: FloatArray
    means: FloatArray
    covariances: FloatArray

    def log_density(self, z: FloatArray) -> FloatArray:
        """log p of rows (n, d): (n,)."""
        from scipy.special import logsumexp

        n, (count, d) = len(z), self.means.shape
        if not d:
            return np.zeros(n)
        parts = np.array_split(z, max(1, -(-n * count * d // _CHUNK)))
        return np.concatenate([logsumexp(self._log_kernels(part) + self.log_weights, axis=1) for part in parts])

    def _log_kernels(self, z: FloatArray) -> FloatArray:
        """log N(z_i; μ_k, Σ_k): (n, k)."""
        from scipy.spatial.distance import cdist

        factors = np.linalg.cholesky(self.covariances)
        white = np.linalg.inv(factors)
        if len(white) == 1:
            squares = cdist(z @ white[0].T, self.means @ white[0].T, "sqeuclidean")
        else:
            turned = np.swapaxes(white, 1, 2)
            squares = np.square(z @ turned - self.means[:, None] @ turned).sum(axis=2).T
        log_volume = np.log(np.diagonal(factors, axis1=1, axis2=2)).sum(axis=1) + 0.5 * z.shape[1] * np.log(2.0 * np.pi)
        return -0.5 * squares - log_volume

    def sample(self, n: int, generator: np.random.Generator) -> FloatArray:
        """Draws (n, d)."""
        chosen = generator.choice(len(self.means), size=n, p=np.exp(self.log_weights))
        factors = np.linalg.cholesky(self.covariances)
        noise = generator.standard_normal((n, self.means.shape[1], 1))
        moved = factors[chosen if len(factors) > 1 else np.zeros(n, np.int64)] @ noise
        return self.means[chosen] + moved[..., 0]

    def marginal(self, columns: Sequence[int]) -> Components:
        """The density of some columns alone."""
        kept = np.asarray(columns, np.int64)
        return Components(self.log_weights, self.means[:, kept], self.covariances[:, kept[:, None], kept])

    def given(self, columns: Sequence[int], values: FloatArray) -> Components:
        """The density of the other columns where some have these values (c,): each component counts by its density there.

        C. M. Bishop, Pattern Recognition and Machine Learning, 2006, §2.3.1.
        """
        from scipy.special import logsumexp

        fixed = np.asarray(columns, np.int64)
        if not len(fixed):
            return self
        free = np.setdiff1d(np.arange(self.means.shape[1]), fixed)
        at_fixed = self.marginal(columns)
        log_weights = self.log_weights + at_fixed._log_kernels(np.asarray(values, np.float64)[None])[0]
        across = self.covariances[:, free[:, None], fixed]
        gain = np.swapaxes(np.linalg.solve(at_fixed.covariances, np.swapaxes(across, 1, 2)), 1, 2)
        means = self.means[:, free] + (gain @ (values - at_fixed.means)[..., None])[..., 0]
        covariances = self.covariances[:, free[:, None], free] - gain @ np.swapaxes(across, 1, 2)
        return Components(log_weights - logsumexp(log_weights), means, covariances)
