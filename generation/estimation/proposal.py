"""The proposal of importance sampling: where the system fails, with a share of what traffic does."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from generation.density.models.kde import KDE
from generation.density.prior import Prior, until_possible
from xodr.array_types import FloatArray

_COUNTED = 20_000
"""Draws that say which share of the kernels is possible"""


class Proposal:
    """q = a·p + (1 − a)·k: a prior p, and kernels k around known failures, cut where the prior ends.

    The defensive share a bounds the weights p/q by 1/a: failures far from those that are known are missed by no more than that.
    T. Hesterberg, Weighted average importance sampling and defensive mixture distributions, Technometrics 37, 1995.

    Args:
        prior: p.
        failures: points (n, d) at which the system fails, n above the number of parameters that are no nuisances.
        defensive: a.

    Raises:
        UsageError: the failures are too few for a density, or all the same in a parameter.
    """

    def __init__(self, prior: Prior, failures: FloatArray, defensive: float) -> None:
        self._prior, self._defensive = prior, defensive
        self._columns = prior.columns(prior.searched)
        self._kernels = KDE().fit(failures[:, self._columns])

    def _around(self, n: int, generator: np.random.Generator) -> FloatArray:
        """Draws (n, d) of the kernels, with nuisances as recorded; some are not possible."""
        theta = np.broadcast_to((self._prior.low + self._prior.high) / 2, (n, len(self._prior.names))).copy()
        theta[:, self._columns] = self._kernels.sample(n, generator)
        inside = self._prior.inside(theta)
        theta[inside] = self._prior.with_nuisances(theta[inside])
        return theta

    @cached_property
    def _log_share(self) -> float:
        """log of the share of the kernels that is possible."""
        return float(np.log(self._prior.possible(self._around(_COUNTED, np.random.default_rng(0))).mean()))

    def sample(self, n: int, generator: np.random.Generator) -> FloatArray:
        """Draws (n, d), all possible, as many of the prior as its share says, in random order.

        Raises:
            UsageError: nearly nothing around the failures is possible.
        """
        common = round(self._defensive * n)
        around = until_possible(self._around, self._prior.possible, n - common, generator)
        return generator.permutation(np.concatenate([self._prior.sample(common, generator), around]))

    def weights(self, theta: FloatArray) -> FloatArray:
        """p/q of possible points (n, d): (n,)."""
        log_p = self._prior.log_density(theta)
        log_k = self._kernels.log_density(theta[:, self._columns]) - self._log_share
        log_q = np.logaddexp(np.log(self._defensive) + log_p, np.log1p(-self._defensive) + log_k)
        found: FloatArray = np.exp(log_p - log_q)
        return found
