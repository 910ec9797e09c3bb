"""The proposals of importance sampling: where the system fails, with a share of what traffic does."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from generation.density.models.kde import KDE, scott
from generation.density.prior import Prior, until_possible
from xodr.array_types import FloatArray

_COUNTED = 20_000
"""Draws that say which share of the kernels is possible"""
_WIDER, _WIDE = 1.5, 0.3
"""How much wider the second kernel around each failure is than the first, and its share"""
_UNSURE = 0.3
"""Share of the kernels that is around points which may fail"""


class Proposal:
    """q = a·p + (1 − a)·k: a prior p, and kernels k around known failures, cut where the prior ends.

    The defensive share a bounds the weights p/q by 1/a: failures far from those that are known are missed by no more than that.
    Kernels as narrow as the likelihood of the known failures wants them leave others just outside to that share, and one of them
    among the draws weighs as much as all the rest: so there are two around each failure, a narrow and a wide one.
    T. Hesterberg, Weighted average importance sampling and defensive mixture distributions, Technometrics 37, 1995.

    Args:
        prior: p.
        defensive: a.
        failures: points (n, d) at which the system fails, n above the number of parameters that are no nuisances.
        others: points (m, d) at which it may fail, fewer than these numbers where there are none; they have `_UNSURE` of k.

    Raises:
        UsageError: the failures are too few for a density, or all the same in a parameter.
    """

    def __init__(self, prior: Prior, defensive: float, failures: FloatArray, others: FloatArray | None = None) -> None:
        self._prior, self.defensive = prior, defensive
        self._columns = prior.columns(prior.searched)
        unsure = 0.0 if others is None else _UNSURE
        self._kernels = self._around_each(1.0 - unsure, failures)
        if others is not None:
            self._kernels += self._around_each(unsure, others)

    def _around_each(self, share: float, theta: FloatArray) -> tuple[tuple[float, KDE], ...]:
        rows = theta[:, self._columns]
        narrow = KDE().fit(rows)
        wide = KDE(_WIDER * narrow.bandwidth / scott(*rows.shape)).fit(rows)
        return (share * (1.0 - _WIDE), narrow), (share * _WIDE, wide)

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
        common = round(self.defensive * n)
        around = until_possible(self._around, self._prior.possible, n - common, generator)
        return generator.permutation(np.concatenate([self._prior.sample(common, generator), around]))

    def weights(self, theta: FloatArray) -> FloatArray:
        """p/q of possible points (n, d): (n,)."""
        log_p = self._prior.log_density(theta)
        rows = theta[:, self._columns]
        kernels = [np.log(share) + kernel.log_density(rows) for share, kernel in self._kernels]
        log_k = np.logaddexp.reduce(kernels) - self._log_share
        log_q = np.logaddexp(np.log(self.defensive) + log_p, np.log1p(-self.defensive) + log_k)
        found: FloatArray = np.exp(log_p - log_q)
        return found


class Stage(NamedTuple):
    """So many draws of a proposal; of the prior where it is None."""

    number: int
    proposal: Proposal | None


class Stages:
    """What several stages have drawn from together, q = Σ n_t/n q_t: each draw counts as one of all of them.

    A stage that looked where hardly anything fails then spoils nothing. As later proposals follow earlier draws, the estimate is
    consistent, and not exactly unbiased.
    E. Veach, L. J. Guibas, Optimally combining sampling techniques for Monte Carlo rendering, 1995; J.-M. Cornuet et al.,
    Adaptive multiple importance sampling, Scandinavian Journal of Statistics 39, 2012.
    """

    def __init__(self, stages: Sequence[Stage]) -> None:
        total = max(sum(each.number for each in stages), 1)
        self._shares = [(each.number / total, each.proposal) for each in stages]

    def weights(self, theta: FloatArray) -> FloatArray:
        """p/q of possible points (n, d): (n,)."""
        ratio = np.zeros(len(theta))
        for share, proposal in self._shares:
            ratio += share if proposal is None else share / proposal.weights(theta)
        return 1.0 / ratio

    @property
    def greatest(self) -> float:
        """Weight that none exceeds."""
        defensive = sum(share if each is None else share * each.defensive for share, each in self._shares)
        return 1.0 / defensive if defensive else 1.0
