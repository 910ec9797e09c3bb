"""Gaussian mixtures by expectation maximisation.

The same steps as those of scikit-learn's GaussianMixture, to rounding, as two products of matrices each: log-densities of all
components are linear in the products of a row's values, and so are the moments that components are made of.
A. Dempster, N. Laird, D. Rubin, Maximum likelihood from incomplete data via the EM algorithm, JRSS B 39, 1977.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from generation.density.components import Components
from xodr.array_types import FloatArray

_RIDGE = 1e-3
"""Least variance of a component along any axis, where the samples' is 1."""
_TOLERANCE, _STEPS = 1e-3, 100
"""Gain of the mean log-likelihood at which it ends, and most steps."""


class Found(NamedTuple):
    """A mixture, and the mean log-likelihood of the samples before its last step."""

    gaussians: Components
    log_likelihood: float

    def bic(self, n: int) -> float:
        """Bayesian information criterion of n samples: less is better. G. Schwarz, Annals of Statistics 6, 1978."""
        count, d = self.gaussians.means.shape
        free = count * (d * (d + 1) // 2 + d + 1) - 1
        return float(free * np.log(n) - 2.0 * n * self.log_likelihood)


class Maximisation:
    """Samples that mixtures are fitted on.

    Args:
        white: rows (n, d) with mean 0 and covariance 1.
    """

    def __init__(self, white: FloatArray) -> None:
        self._white = white
        self._first, self._second = np.triu_indices(white.shape[1])
        columns = white.T
        self._products = np.vstack([np.ones(len(white)), columns, columns[self._first] * columns[self._second]])

    def likeliest(self, components: int, starts: int, seed: int) -> Found:
        """The likeliest of some mixtures, each from clusters of the samples."""
        generator = np.random.RandomState(seed)  # what scikit-learn takes
        with threadpool_limits(1):  # matrices this small lose far more by handing out work than more threads bring
            found = [self._from(self._clusters(components, generator)) for _ in range(starts)]
        return max(found, key=lambda each: each.log_likelihood)

    def _clusters(self, components: int, generator: np.random.RandomState) -> FloatArray:
        """Which row is in which cluster: (k, n)."""
        from sklearn.cluster import KMeans

        labels = KMeans(components, n_init=1, random_state=generator).fit(self._white).labels_
        return (labels == np.arange(components)[:, None]).astype(np.float64)

    def _from(self, shares: FloatArray) -> Found:
        found, before = self._maximised(shares), -np.inf
        for _ in range(_STEPS):
            shares = self._coefficients(found) @ self._products
            most = shares.max(axis=0)
            np.exp(np.subtract(shares, most, out=shares), out=shares)
            sums = shares.sum(axis=0)
            likelihood = float((np.log(sums) + most).mean())
            found = self._maximised(np.divide(shares, sums, out=shares))
            if abs(likelihood - before) < _TOLERANCE:
                break
            before = likelihood
        return Found(found, likelihood)

    def _maximised(self, shares: FloatArray) -> Components:
        """The likeliest components of rows that belong to them by these shares (k, n)."""
        moments = shares @ self._products.T
        d = self._white.shape[1]
        counts = moments[:, :1] + 10.0 * np.finfo(float).eps
        means = moments[:, 1 : d + 1] / counts
        squares = np.empty((len(counts), d, d))
        squares[:, self._first, self._second] = squares[:, self._second, self._first] = moments[:, d + 1 :] / counts
        covariances = squares - means[:, :, None] * means[:, None] + _RIDGE * np.eye(d)
        return Components(np.log(counts / counts.sum())[:, 0], means, covariances)

    def _coefficients(self, of: Components) -> FloatArray:
        """What log w_k N(z; μ_k, Σ_k) has of each product: (k, products)."""
        d = of.means.shape[1]
        inverse = np.linalg.inv(of.covariances)
        linear = (inverse @ of.means[..., None])[..., 0]
        log_determinant = np.linalg.slogdet(of.covariances)[1]
        constant = of.log_weights - 0.5 * (d * np.log(2.0 * np.pi) + log_determinant + (linear * of.means).sum(axis=1))
        twice = np.where(self._first == self._second, 0.5, 1.0)
        return np.column_stack([constant, linear, -twice * inverse[:, self._first, self._second]])
