"""Mixtures: one Gaussian, several, and several with the tails of Student's t."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from itertools import product
from typing import TYPE_CHECKING, Self

import numpy as np

from generation.space.density.base import Components, Density, Whitening, folds
from schemas.common.array_types import FloatArray, IntArray
from schemas.common.errors import UsageError

if TYPE_CHECKING:  # takes a second to load, and cached mixtures do without
    from sklearn.mixture import GaussianMixture

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
        from threadpoolctl import threadpool_limits

        self._whitening = Whitening.of(theta)
        white = self._whitening.forward(theta)
        with threadpool_limits(
            1
        ):  # matrices this small lose far more by handing out work than more threads bring
            fitted = self._from(_STARTS, self.components or self._likeliest(white, most), white)
        self._white = Components(np.log(fitted.weights_), fitted.means_, fitted.covariances_)

    def _from(self, starts: int, components: int, white: FloatArray) -> GaussianMixture:
        from sklearn.mixture import GaussianMixture

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
        # Not from these components: started from what all rows say, parts would know of the rows
        # that they are tested on.
        means = self._white.means
        return type(self)(min(len(means), _most(rows, means.shape[1])), self.seed)

    def log_density(self, theta: FloatArray) -> FloatArray:
        """log p of rows (n, d): (n,)."""
        white = self._whitening.forward(theta)
        density: FloatArray = self._white.log_density(white) + self._whitening.log_jacobian
        return density

    @property
    def gaussians(self) -> Components:
        """The mixture's."""
        return self._whitening.gaussians(
            self._white.log_weights, self._white.means, self._white.covariances
        )

    def sample(self, n: int, generator: np.random.Generator) -> FloatArray:
        """Draws (n, d)."""
        weights, covariances = np.exp(self._white.log_weights), self._white.covariances
        drawn = generator.choice(len(weights), size=n, p=weights / weights.sum())
        factors = np.linalg.cholesky(covariances)[drawn]
        noise = generator.standard_normal((n, factors.shape[1], 1))
        return self._whitening.back(self._white.means[drawn] + (factors @ noise)[..., 0])

    def arrays(self) -> dict[str, FloatArray]:
        """The fitted mixture for files."""
        return {**asdict(self._whitening), **asdict(self._white)}

    def restore(self, arrays: Mapping[str, FloatArray]) -> Self:
        """Take the fit that `arrays` gave."""
        self._whitening = Whitening(arrays["mean"], arrays["factor"])
        self._white = Components(
            *(arrays[name] for name in ("log_weights", "means", "covariances"))
        )
        return self


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

    def arrays(self) -> dict[str, FloatArray]:
        """The fitted mixture and what cross-validation chose, for files."""
        freedom, exceeded = self._chosen
        return {**self._mixture.arrays(), "chosen": np.array([freedom, float(exceeded)])}

    def restore(self, arrays: Mapping[str, FloatArray]) -> Self:
        """Take the fit that `arrays` gave."""
        freedom, exceeded = arrays["chosen"].tolist()
        self._mixture, self._chosen = Mixture().restore(arrays), (freedom, bool(exceeded))
        self._gaussians = _spread(self._mixture.gaussians, *self._chosen)
        return self


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
