"""The proposal of importance sampling: where the system fails, with a share of what traffic does."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from generation.density.models.kde import KDE, scott
from generation.density.prior import Prior, until_possible
from xodr.array_types import FloatArray

_COUNTED = 20_000
"""Draws that say which share of the kernels is possible"""
_WIDER, _WIDE = 1.5, 0.3
"""How much wider the second kernel around each failure is than the first, and its share"""


class Proposal:
    """q = a·p + (1 − a)·k: a prior p, and kernels k around known failures, cut where the prior ends.

    The defensive share a bounds the weights p/q by 1/a: failures far from those that are known are missed by no more than that.
    Kernels as narrow as the likelihood of the known failures wants them leave others just outside to that share, and one of them
    among the draws weighs as much as all the rest: so there are two around each failure, a narrow and a wide one.
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
        rows = failures[:, self._columns]
        narrow = KDE().fit(rows)
        wide = KDE(_WIDER * narrow.bandwidth / scott(*rows.shape)).fit(rows)
        self._kernels = (1.0 - _WIDE, narrow), (_WIDE, wide)

    def _around(self, n: int, generator: np.random.Generator) -> FloatArray:
        """Draws (n, d) of the kernels, with nuisances as recorded; some are not possible."""
        theta = np.broadcast_to((self._prior.low + self._prior.high) / 2, (n, len(self._prior.names))).copy()
        counts = generator.multinomial(n, [share for share, _ in self._kernels])
        drawn = [kernel.sample(count, generator) for count, (_, kernel) in zip(counts, self._kernels, strict=True)]
        theta[:, self._columns] = generator.permutation(np.concatenate(drawn))
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
        rows = theta[:, self._columns]
        log_k = np.logaddexp(*(np.log(share) + kernel.log_density(rows) for share, kernel in self._kernels)) - self._log_share
        log_q = np.logaddexp(np.log(self._defensive) + log_p, np.log1p(-self._defensive) + log_k)
        found: FloatArray = np.exp(log_p - log_q)
        return found
