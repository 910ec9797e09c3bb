"""Density of parameters: interface of all models, whitening, cross-validation folds, sums of
Gaussians."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schemas.common.array_types import FloatArray, IntArray
from schemas.common.errors import UsageError

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
        # Of no columns, as where all are pinned: the density of nothing is 1.
        if not d:
            return np.zeros(n)
        # Ceiling division: the matrix of rows by components is bounded, whatever both are.
        parts = np.array_split(z, max(1, -(-n * count * d // _CHUNK)))
        return np.concatenate(
            [logsumexp(self._log_kernels(part) + self.log_weights, axis=1) for part in parts]
        )

    def _log_kernels(self, z: FloatArray) -> FloatArray:
        """log N(z_i; μ_k, Σ_k): (n, k)."""
        from scipy.spatial.distance import cdist

        factors = np.linalg.cholesky(self.covariances)
        white = np.linalg.inv(factors)
        if len(white) == 1:
            # Mahalanobis distances are Euclidean ones after whitening; one covariance needs no
            # loop.
            squares = cdist(z @ white[0].T, self.means @ white[0].T, "sqeuclidean")
        else:
            turned = np.swapaxes(white, 1, 2)
            squares = np.square(z @ turned - self.means[:, None] @ turned).sum(axis=2).T
        # log √|Σ| is the sum of the logs of the Cholesky factor's diagonal.
        log_volume = np.log(np.diagonal(factors, axis1=1, axis2=2)).sum(axis=1) + 0.5 * z.shape[
            1
        ] * np.log(2.0 * np.pi)
        return -0.5 * squares - log_volume

    def sample(self, n: int, generator: np.random.Generator) -> FloatArray:
        """Draws (n, d)."""
        chosen = generator.choice(len(self.means), size=n, p=np.exp(self.log_weights))
        factors = np.linalg.cholesky(self.covariances)
        noise = generator.standard_normal((n, self.means.shape[1], 1))
        # One covariance for all components is stored once.
        moved = factors[chosen if len(factors) > 1 else np.zeros(n, np.int64)] @ noise
        return self.means[chosen] + moved[..., 0]

    def marginal(self, columns: Sequence[int]) -> Components:
        """The density of some columns alone."""
        kept = np.asarray(columns, np.int64)
        return Components(
            self.log_weights, self.means[:, kept], self.covariances[:, kept[:, None], kept]
        )

    def given(self, columns: Sequence[int], values: FloatArray) -> Components:
        """The density of the other columns where some have these values (c,): each component counts
        by its density there.

        C. M. Bishop, Pattern Recognition and Machine Learning, 2006, §2.3.1.
        """
        from scipy.special import logsumexp

        fixed = np.asarray(columns, np.int64)
        if not len(fixed):
            return self
        free = np.setdiff1d(np.arange(self.means.shape[1]), fixed)
        at_fixed = self.marginal(columns)
        # Components that are unlikely to have these values lose weight; `logsumexp` normalises
        # below.
        log_weights = (
            self.log_weights + at_fixed._log_kernels(np.asarray(values, np.float64)[None])[0]
        )
        across = self.covariances[:, free[:, None], fixed]
        gain = np.swapaxes(np.linalg.solve(at_fixed.covariances, np.swapaxes(across, 1, 2)), 1, 2)
        means = self.means[:, free] + (gain @ (values - at_fixed.means)[..., None])[..., 0]
        covariances = self.covariances[:, free[:, None], free] - gain @ np.swapaxes(across, 1, 2)
        return Components(log_weights - logsumexp(log_weights), means, covariances)


FOLDS = 5
"""Of a cross-validation."""
_INDEPENDENT = 1e-9
"""Least share of a column's variance that the columns before it must not explain."""


class Density(ABC):
    """A probability density over parameters θ, in the units of θ."""

    def fit(self, theta: ArrayLike, groups: ArrayLike | None = None) -> Self:
        """Learn from samples.

        Args:
            theta: rows (n, d), finite.
            groups: recording (n,) of each row; what is chosen by cross-validation never tests on
                the recording that it was fitted on. Without them every row is one of its own.

        Raises:
            UsageError: no table of finite numbers, too few rows, or columns that are constant or
                depend on each other.
        """
        rows = samples(theta)
        numbers = (
            np.arange(len(rows))
            if groups is None
            else np.unique(np.asarray(groups), return_inverse=True)[1]
        )
        if numbers.shape != (len(rows),):
            raise UsageError(f"{len(rows)} samples need as many recordings, not {numbers.shape}")
        self._learn(rows, numbers)
        return self

    @abstractmethod
    def _learn(self, theta: FloatArray, groups: IntArray) -> None:
        """Learn from rows (n, d), n > d, of recordings that are numbered from 0."""

    @abstractmethod
    def log_density(self, theta: FloatArray) -> FloatArray:
        """log p of rows (n, d): (n,)."""

    @abstractmethod
    def sample(self, n: int, generator: np.random.Generator) -> FloatArray:
        """Draws (n, d)."""

    def again(self, rows: int) -> Self:
        """Unfitted model for a part of the samples, with that many rows; slow choices are taken
        over from the fit on all samples."""
        return copy(self)

    def arrays(self) -> dict[str, FloatArray] | None:
        """The fitted density for files, as `restore` reads it; None for a model that is fitted
        faster than it is read, or that its arrays do not say."""
        return None

    def restore(self, arrays: Mapping[str, FloatArray]) -> Self:
        """Take the fit that `arrays` gave."""
        raise NotImplementedError

    @property
    def gaussians(self) -> Components | None:
        """The sum of Gaussians that it is after `fit`, which can be conditioned; None where it is
        none."""
        return None


@dataclass(frozen=True)
class Whitening:
    """z = L⁻¹(θ − μ) with Σ = LLᵀ, so that z of the samples has mean 0 and covariance 1.

    Attributes:
        mean: μ (d,). factor: L (d, d), lower triangular.
    """

    mean: FloatArray
    factor: FloatArray

    @classmethod
    def of(cls, theta: FloatArray) -> Whitening:
        """Fit to samples (n, d), with the unbiased covariance.

        Raises:
            UsageError: a column is constant, or follows from those before it.
        """
        covariance = np.atleast_2d(np.cov(theta, rowvar=False))
        spread = np.sqrt(np.diag(covariance))
        # Relative to the size of the values: of equal numbers the computed deviation may be a
        # rounding.
        constant = np.flatnonzero(spread <= 1e-12 * np.maximum(np.abs(theta).max(axis=0), 1.0))
        if len(constant):
            raise UsageError(
                f"parameter {constant[0] + 1} is the same in all samples: a density "
                "can't hold it, pin it"
            )
        try:
            # Of correlations, so that the test below does not depend on the parameters' units.
            factor = np.linalg.cholesky(covariance / np.outer(spread, spread))
        except np.linalg.LinAlgError:
            # Not positive definite: as dependent as can be, and refused by the test below.
            factor = np.zeros_like(covariance)
        if np.square(np.diag(factor)).min() < _INDEPENDENT:
            raise UsageError(
                "one parameter follows exactly from others in all samples: a density "
                "can't hold it, pin it"
            )
        return cls(theta.mean(axis=0), spread[:, None] * factor)

    @property
    def log_jacobian(self) -> float:
        """log |dz/dθ|, to be added to log-densities of z."""
        return -float(np.log(np.diag(self.factor)).sum())

    def forward(self, theta: FloatArray) -> FloatArray:
        """z (n, d) of θ (n, d)."""
        from scipy.linalg import solve_triangular

        whitened: FloatArray = solve_triangular(self.factor, (theta - self.mean).T, lower=True).T
        return whitened

    def gaussians(
        self, log_weights: FloatArray, means: FloatArray, covariances: FloatArray
    ) -> Components:
        """Components (k,), (k, d), (k or 1, d, d) of z as those of θ."""
        return Components(log_weights, self.back(means), self.factor @ covariances @ self.factor.T)

    def back(self, white: FloatArray) -> FloatArray:
        """θ (n, d) of z (n, d)."""
        restored: FloatArray = self.mean + white @ self.factor.T
        return restored


def samples(theta: ArrayLike) -> FloatArray:
    """Rows as a table of floats.

    Raises:
        UsageError: it is none, holds what is not finite, or has no more rows than columns.
    """
    rows = np.asarray(theta, dtype=np.float64)
    if rows.ndim != 2 or not rows.shape[1]:
        raise UsageError(
            f"samples must be a table (samples, parameters), not of shape {rows.shape}"
        )
    if not np.isfinite(rows).all():
        raise UsageError(
            f"sample {np.flatnonzero(~np.isfinite(rows).all(axis=1))[0] + 1} is not finite"
        )
    # Fewer span no volume: their covariance has no inverse.
    if len(rows) <= rows.shape[1] + 1:
        raise UsageError(
            f"{len(rows)} samples are too few for a density of {rows.shape[1]} parameters"
        )
    return rows


def folds(groups: NDArray[Any], most: int = FOLDS) -> Iterator[tuple[IntArray, IntArray]]:
    """Rows to fit and rows to test, so that every row is tested once, and never beside a fitted row
    of its own group.

    Groups are dealt out by their size to the fold that has fewest rows; there are no more folds
    than groups.

    Args:
        groups: (n,), any labels.

    Raises:
        UsageError: all rows are of one group.
    """
    _, numbers, sizes = np.unique(groups, return_inverse=True, return_counts=True)
    count = min(most, len(sizes))
    if count < 2:
        raise UsageError(
            "all that is recorded is of one recording, and a density is tested on another one: "
            "give more recordings, or --density uniform, which needs none"
        )
    fold_of, filled = np.empty(len(sizes), dtype=np.int64), np.zeros(count, dtype=np.int64)
    # Largest first: the greedy choice then comes close to equal folds.
    for group in np.argsort(-sizes, kind="stable"):
        fold_of[group] = filled.argmin()
        filled[fold_of[group]] += sizes[group]
    tested = fold_of[numbers]
    for fold in range(count):
        yield np.flatnonzero(tested != fold), np.flatnonzero(tested == fold)
