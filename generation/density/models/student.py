"""Mixture of Student's t: Gaussians with tails as heavy as recordings have them."""

from __future__ import annotations

from itertools import product
from typing import Self

import numpy as np

from generation.density.base import Density, folds
from generation.density.components import Components
from generation.density.models.mixture import Mixture
from xodr.array_types import FloatArray, IntArray

DENSITY = {"class": "Student", "title": "mixture of Student's t"}
FREEDOMS = (np.inf, 30.0, 15.0, 10.0, 6.0, 4.0)
"""Degrees of freedom that cross-validation chooses from; infinitely many are Gaussian"""
_SCALES = 5
"""Gaussians of different scales that stand for one Student's t"""


class Student(Density):
    """A Gaussian mixture whose components have the tails of Student's t with ν degrees of freedom.

    Fitted on few rows of many parameters, a Gaussian mixture is too sure of itself: rows that it has not seen lie further out
    than its own draws. Student's t is a Gaussian whose covariance is divided by a draw of χ²_ν / ν; here by five equally likely
    values of it, so that the density is a sum of Gaussians as before, and can be conditioned. The components have the covariances
    of the mixture's, or where rows are few, and covariances too small by that, the mixture's are the scale of t and are exceeded.
    ν and which of the two have the greatest log-likelihood in a 5-fold cross-validation by recording; the number of components is
    that of the mixture.
    D. Peel, G. J. McLachlan, Robust mixture modelling using the t distribution, Statistics and Computing 10, 2000.

    Args:
        freedom, exceeded: ν, and whether covariances exceed the mixture's; chosen by cross-validation where ν is None.
        mixture: of Gaussians, unfitted; by default one that finds out how many they are.
    """

    def __init__(self, freedom: float | None = None, exceeded: bool = False, mixture: Mixture | None = None) -> None:
        self.freedom, self.exceeded, self.mixture = freedom, exceeded, mixture

    def _learn(self, theta: FloatArray, groups: IntArray) -> None:
        self._mixture = (self.mixture or Mixture()).fit(theta)
        self._chosen = (self.freedom, self.exceeded) if self.freedom is not None else _best(self._mixture, theta, groups)
        self._gaussians = _spread(self._mixture.gaussians, *self._chosen)

    def again(self, rows: int) -> Self:
        """One with the same tails, of as many components, or as many as the rows suffice for."""
        return type(self)(*self._chosen, self._mixture.again(rows))

    def log_density(self, theta: FloatArray) -> FloatArray:
        """log p of rows (n, d): (n,)."""
        return self._gaussians.log_density(theta)

    @property
    def gaussians(self) -> Components:
        """Those of all scales."""
        return self._gaussians

    def sample(self, n: int, generator: np.random.Generator) -> FloatArray:
        """Draws (n, d)."""
        return self._gaussians.sample(n, generator)


def _spread(gaussians: Components, freedom: float, exceeded: bool) -> Components:
    """Each component as Gaussians of equally likely scales."""
    from scipy.stats import chi2

    if not np.isfinite(freedom):
        return gaussians
    scales = freedom / chi2.ppf((np.arange(_SCALES) + 0.5) / _SCALES, freedom)
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
