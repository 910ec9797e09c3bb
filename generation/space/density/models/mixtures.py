"""Mixtures: one Gaussian, several, and several with the tails of Student's t."""

from __future__ import annotations

from itertools import product
from typing import Self

import numpy as np
from sklearn.mixture import GaussianMixture
from threadpoolctl import threadpool_limits

from generation.space.density.base import Components, Density, Whitening, folds
from schemas.common.array_types import FloatArray, IntArray
from schemas.common.errors import UsageError

DENSITIES = {
    "gaussian": {"class": "Gaussian", "title": "one Gaussian"},
    "mixture": {"class": "Mixture", "title": "Gaussian mixture (BIC)"},
    "student": {"class": "Student", "title": "mixture of Student's t"},
}


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
        """Components of the only scale."""
        d = len(self._whitening.mean)
        return self._whitening.gaussians(np.zeros(1), np.zeros((1, d)), np.eye(d)[None])

    def sample(self, n: int, generator: np.random.Generator) -> FloatArray:
        """Draws (n, d)."""
        return self._whitening.back(generator.standard_normal((n, len(self._whitening.mean))))


_MOST, _STARTS = 8, 3
_RIDGE = 1e-3
"""Least variance of a component along any axis, where the samples' is 1."""


class Mixture(Density):
    """Gaussians with full covariances, by expectation maximisation on whitened samples, the
    likeliest of three starts.

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
            raise UsageError(
                f"{len(theta)} samples are too few for a mixture of {self.components} components"
            )
        self._whitening = Whitening.of(theta)
        white = self._whitening.forward(theta)
        with threadpool_limits(
            1
        ):  # matrices this small lose far more by handing out work than more threads bring
            self._model = self._from(
                _STARTS, self.components or self._likeliest(white, most), white
            )

    def _from(self, starts: int, components: int, white: FloatArray) -> GaussianMixture:
        return GaussianMixture(
            components, reg_covar=_RIDGE, n_init=starts, random_state=self.seed
        ).fit(white)

    def _likeliest(self, white: FloatArray, most: int) -> int:
        most = min(
            most, _MOST, len(np.unique(white, axis=0))
        )  # more than there are points say nothing more
        return min(
            range(1, most + 1), key=lambda components: self._from(1, components, white).bic(white)
        )

    def again(self, rows: int) -> Self:
        """Return an unfitted mixture with the same number of components, or fewer if there are too
        few rows."""
        means = self._model.means_
        return type(self)(min(len(means), _most(rows, means.shape[1])), self.seed)

    def log_density(self, theta: FloatArray) -> FloatArray:
        """log p of rows (n, d): (n,)."""
        density: FloatArray = (
            self._model.score_samples(self._whitening.forward(theta)) + self._whitening.log_jacobian
        )
        return density

    @property
    def gaussians(self) -> Components:
        """The mixture's."""
        return self._whitening.gaussians(
            np.log(self._model.weights_), self._model.means_, self._model.covariances_
        )

    def sample(self, n: int, generator: np.random.Generator) -> FloatArray:
        """Draws (n, d)."""
        drawn = generator.choice(len(self._model.weights_), size=n, p=self._model.weights_)
        factors = np.linalg.cholesky(self._model.covariances_)[drawn]
        noise = generator.standard_normal((n, factors.shape[1], 1))
        return self._whitening.back(self._model.means_[drawn] + (factors @ noise)[..., 0])


def _most(n: int, d: int) -> int:
    """Most components that n rows of d columns suffice for."""
    # Each component needs more rows than columns for a covariance.
    return (n - 1) // d


FREEDOMS = (np.inf, 30.0, 15.0, 10.0, 6.0, 4.0)
"""Degrees of freedom that cross-validation chooses from; infinitely many are Gaussian"""
_SCALES = 5
"""Gaussians of different scales that stand for one Student's t"""


class Student(Density):
    """A Gaussian mixture whose components have the tails of Student's t with ν degrees of freedom.

    Fitted on few rows of many parameters, a Gaussian mixture is too sure of itself: rows that it
    has not seen lie further out than its own draws. Student's t is a Gaussian whose covariance is
    divided by a draw of χ²_ν / ν; here by five equally likely values of it, so that the density is
    a sum of Gaussians as before, and can be conditioned. The components have the covariances of the
    mixture's, or where rows are few, and covariances too small by that, the mixture's are the scale
    of t and are exceeded. ν and which of the two have the greatest log-likelihood in a 5-fold
    cross-validation by recording; the number of components is that of the mixture. D. Peel, G. J.
    McLachlan, Robust mixture modelling using the t distribution, Statistics and Computing 10, 2000.

    Args:
        freedom, exceeded: ν, and whether covariances exceed the mixture's; chosen by
            cross-validation where ν is None.
        mixture: of Gaussians, unfitted; by default one that finds out how many they are.
    """

    def __init__(
        self, freedom: float | None = None, exceeded: bool = False, mixture: Mixture | None = None
    ) -> None:
        self.freedom, self.exceeded, self.mixture = freedom, exceeded, mixture

    def _learn(self, theta: FloatArray, groups: IntArray) -> None:
        self._mixture = (self.mixture or Mixture()).fit(theta)
        self._chosen = (
            (self.freedom, self.exceeded)
            if self.freedom is not None
            else _best(self._mixture, theta, groups)
        )
        self._gaussians = _spread(self._mixture.gaussians, *self._chosen)

    def again(self, rows: int) -> Self:
        """Return an unfitted mixture with the same tails and number of components, or fewer if
        there are too few rows."""
        return type(self)(*self._chosen, self._mixture.again(rows))

    def log_density(self, theta: FloatArray) -> FloatArray:
        """log p of rows (n, d): (n,)."""
        return self._gaussians.log_density(theta)

    @property
    def gaussians(self) -> Components:
        """Components of all scales."""
        return self._gaussians

    def sample(self, n: int, generator: np.random.Generator) -> FloatArray:
        """Draws (n, d)."""
        return self._gaussians.sample(n, generator)


def _spread(gaussians: Components, freedom: float, exceeded: bool) -> Components:
    """Each component as Gaussians of equally likely scales."""
    from scipy.stats import chi2

    if not np.isfinite(freedom):
        return gaussians
    # Quantiles in the middles of five equally likely parts of the distribution of χ²/ν.
    scales = freedom / chi2.ppf((np.arange(_SCALES) + 0.5) / _SCALES, freedom)
    # Divided by their mean the mixture keeps its covariance; else it is wider than the samples.
    scales = scales if exceeded else scales / scales.mean()
    weights = np.tile(gaussians.log_weights - np.log(_SCALES), _SCALES)
    covariances = np.concatenate([scale * gaussians.covariances for scale in scales])
    return Components(weights, np.tile(gaussians.means, (_SCALES, 1)), covariances)


def _best(mixture: Mixture, theta: FloatArray, groups: IntArray) -> tuple[float, bool]:
    choices = list(product(FREEDOMS, (False, True)))
    total = np.zeros(len(choices))
    for fitted, tested in folds(groups):
        part = mixture.again(len(fitted)).fit(theta[fitted]).gaussians
        total += [_spread(part, *choice).log_density(theta[tested]).sum() for choice in choices]
    return choices[int(total.argmax())]
