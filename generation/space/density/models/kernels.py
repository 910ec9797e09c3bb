"""Kernel density estimates: of all parameters, or of each alone."""

from __future__ import annotations

import numpy as np

from generation.space.density.base import Components, Density, Whitening, folds
from schemas.common.array_types import FloatArray, IntArray

DENSITIES = {
    "kde": {"class": "KDE", "title": "KDE, full covariance"},
    "independent": {"class": "Independent", "title": "independent 1-D KDEs"},
}
FACTORS = np.geomspace(0.2, 2.0, 19)
"""Multiples of Scott's bandwidth that cross-validation chooses from."""
_COMPARED = 1500
"""Most samples that bandwidths are compared on, evenly chosen: the cost grows with their square,
the choice hardly changes"""
_CHUNK = 2_000_000
"""Most distances held at once."""


def scott(n: int, d: int) -> float:
    """Scott's bandwidth n^(−1/(d+4)) in units of the standard deviation."""
    return float(n ** (-1.0 / (d + 4)))


class KDE(Density):
    """Gaussian kernels with covariance H = h²Σ̂, Σ̂ that of the samples.

    h is Scott's times the factor of 0.2 … 2 with the greatest log-likelihood in a 5-fold
    cross-validation by recording. D. W. Scott, Multivariate Density Estimation, 1992, §6.3.

    Args:
        factor: multiple of Scott's bandwidth; chosen by cross-validation where it is None.

    Attributes:
        bandwidth: h after `fit`.
    """

    def __init__(self, factor: float | None = None) -> None:
        self.factor = factor

    def _learn(self, theta: FloatArray, groups: IntArray) -> None:
        factor = self.factor if self.factor is not None else _best_factor(theta, groups)
        self._whitening = Whitening.of(theta)
        self._centres = self._whitening.forward(theta)
        self.bandwidth = factor * scott(*theta.shape)

    def log_density(self, theta: FloatArray) -> FloatArray:
        """log p of rows (n, d): (n,)."""
        white = self._whitening.forward(theta)
        chunks = np.array_split(white, max(1, -(-len(white) * len(self._centres) // _CHUNK)))
        parts = [
            _log_kernels(chunk, self._centres, np.array([self.bandwidth]))[0] for chunk in chunks
        ]
        return np.concatenate(parts) + self._whitening.log_jacobian

    @property
    def gaussians(self) -> Components:
        """A kernel for each sample."""
        n, d = self._centres.shape
        return self._whitening.gaussians(
            np.full(n, -np.log(n)), self._centres, self.bandwidth**2 * np.eye(d)[None]
        )

    def sample(self, n: int, generator: np.random.Generator) -> FloatArray:
        """Draws (n, d): a sample each, moved by its kernel."""
        chosen = self._centres[generator.integers(len(self._centres), size=n)]
        return self._whitening.back(
            chosen + self.bandwidth * generator.standard_normal(chosen.shape)
        )


def _best_factor(theta: FloatArray, groups: IntArray) -> float:
    # Evenly over all recordings, which come one after the other.
    chosen = np.unique(np.linspace(0, len(theta) - 1, min(len(theta), _COMPARED)).astype(np.int64))
    theta, groups = theta[chosen], groups[chosen]
    total = np.zeros(len(FACTORS))
    for fitted, tested in folds(groups):
        # By the fitted rows alone, so that the tested ones are unseen in every respect.
        whitening = Whitening.of(theta[fitted])
        bandwidths = FACTORS * scott(len(fitted), theta.shape[1])
        centres, white = whitening.forward(theta[fitted]), whitening.forward(theta[tested])
        total += (
            _log_kernels(white, centres, bandwidths).sum(axis=1)
            + len(tested) * whitening.log_jacobian
        )
    return float(FACTORS[total.argmax()])


def _log_kernels(white: FloatArray, centres: FloatArray, bandwidths: FloatArray) -> FloatArray:
    """log of the mean of round Gaussian kernels around the centres, at white (n, d), for each
    bandwidth: (bandwidths, n)."""
    from scipy.spatial.distance import cdist

    d, squares = white.shape[1], cdist(white, centres, "sqeuclidean")
    nearest = squares.min(axis=1)
    # The nearest kernel is factored out: far from all samples every kernel would underflow to 0.
    squares -= nearest[:, None]
    scale = np.log(len(centres)) + 0.5 * d * np.log(2.0 * np.pi) + d * np.log(bandwidths)
    kernels, sums = np.empty_like(squares), []
    for h in bandwidths:
        np.exp(
            np.multiply(squares, -0.5 / h**2, out=kernels), out=kernels
        )  # new memory takes as long
        sums.append(np.log(kernels.sum(axis=1)) - 0.5 * nearest / h**2)
    return np.array(sums) - scale[:, None]


class Independent(Density):
    """p(θ) = Π_j p_j(θ_j), each p_j a `KDE` with a bandwidth of its own."""

    def _learn(self, theta: FloatArray, groups: IntArray) -> None:
        self._marginals = [KDE().fit(column[:, None], groups) for column in theta.T]

    def log_density(self, theta: FloatArray) -> FloatArray:
        """log p of rows (n, d): (n,)."""
        columns = zip(self._marginals, theta.T, strict=True)
        return np.sum(
            [marginal.log_density(column[:, None]) for marginal, column in columns], axis=0
        )

    def sample(self, n: int, generator: np.random.Generator) -> FloatArray:
        """Draws (n, d)."""
        return np.hstack([marginal.sample(n, generator) for marginal in self._marginals])
