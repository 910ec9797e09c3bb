"""Priors without recordings, and of what recordings tell in part: parameters that are independent of each other."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property

import numpy as np

from generation.density.marginals import Marginal
from generation.density.prior import FORESEEABLE, Prior
from schemas.errors import UsageError
from xodr.array_types import BoolArray, FloatArray

_COUNTED = 2000
"""Draws that say which share is possible, and how likely 99 % of all are."""
Admits = Callable[[FloatArray], BoolArray]
"""Rows (n, d) that keep the scenario's constraints (n,)."""


class DeclaredPrior(Prior):
    """p(θ) = Π_j p_j(θ_j), as stated, within the scenario's constraints.

    Args:
        marginals: of the parameters, in the order of the columns.
        admits: rows that keep the constraints; all where it is None.
        nuisances: names of the columns that are nuisances.
        theta: rows (m, d) in the place of recorded ones.
    """

    def __init__(
        self,
        marginals: Mapping[str, Marginal],
        admits: Admits | None,
        nuisances: Sequence[str] = (),
        theta: FloatArray | None = None,
    ) -> None:
        self.names, self._marginals, self._admits = tuple(marginals), list(marginals.values()), admits
        self.low = np.array([each.low for each in self._marginals])
        self.high = np.array([each.high for each in self._marginals])
        self.nuisances = tuple(nuisances)
        self.theta = np.empty((0, len(self.names))) if theta is None else theta
        self.recordings = np.full(len(self.theta), "drawn")

    def possible(self, theta: FloatArray) -> BoolArray:
        """Rows (n, d) that are in the box and keep the constraints: (n,)."""
        found = self.inside(theta)
        if self._admits is not None:
            found[found] = self._admits(theta[found])
        return found

    def _raw(self, theta: FloatArray) -> FloatArray:
        found = np.zeros(len(theta))
        for name, each, values in zip(self.names, self._marginals, theta.T, strict=True):
            if name not in self.nuisances:
                found += each.log_density(values)
        return found

    def _draw(self, n: int, generator: np.random.Generator) -> FloatArray:
        return np.stack([each.sample(n, generator) for each in self._marginals], axis=1)

    @cached_property
    def _log_share(self) -> float:
        share = float(self.possible(self._draw(_COUNTED, np.random.default_rng(0))).mean())
        if not share:
            raise UsageError("no values of the parameters keep the scenario's constraints")
        return float(np.log(share))

    @cached_property
    def limit(self) -> float:
        """log p that all but 1 % of draws reach."""
        return float(np.quantile(self.log_density(self.sample(_COUNTED, np.random.default_rng(0))), FORESEEABLE))

    def log_density(self, theta: FloatArray) -> FloatArray:
        """log p of rows (n, d): (n,)."""
        return np.where(self.possible(theta), self._raw(theta) - self._log_share, -np.inf)

    def foreseeable(self, theta: FloatArray) -> BoolArray:
        """Rows (n, d) that are possible and no less likely than 99 % of draws: (n,)."""
        found: BoolArray = self.log_density(theta) >= self.limit - 1e-9  # all of a uniform density are alike but for rounding
        return found

    def with_nuisances(self, theta: FloatArray) -> FloatArray:
        """Rows (n, d) as they are: nothing is recorded of nuisances."""
        return theta


class JointPrior(Prior):
    """Parts that are independent of each other, each of some columns.

    Args:
        names: of all columns, in their order.
        parts: priors of some of them each; the recorded rows are those of the first one.
        admits: rows that keep the scenario's constraints.
        alone: priors of some columns that say with the others what is foreseeable, and are no part of the density.
    """

    def __init__(self, names: Sequence[str], parts: Sequence[Prior], admits: Admits, alone: Sequence[Prior] = ()) -> None:
        self.names, self._parts, self._admits, self._alone = tuple(names), list(parts), admits, list(alone)
        owner = {name: part for part in parts for name in part.names}
        self.low = np.array([owner[name].low[owner[name].names.index(name)] for name in names])
        self.high = np.array([owner[name].high[owner[name].names.index(name)] for name in names])
        self.nuisances = tuple(name for part in parts for name in part.nuisances)
        self.theta, self.recordings = np.empty((len(parts[0].theta), len(self.names))), parts[0].recordings
        generator = np.random.default_rng(0)
        for part in parts:
            rows = part.theta if part is parts[0] else part.sample(len(self.theta), generator)
            self.theta[:, self.columns(part.names)] = rows

    def _columns(self, part: Prior, theta: FloatArray) -> FloatArray:
        return theta[:, self.columns(part.names)]

    def _draw(self, n: int, generator: np.random.Generator) -> FloatArray:
        theta = np.empty((n, len(self.names)))
        for part in self._parts:
            theta[:, self.columns(part.names)] = part.sample(n, generator)
        return theta

    def possible(self, theta: FloatArray) -> BoolArray:
        """Rows (n, d) that are possible in each part: (n,)."""
        found = np.all([part.possible(self._columns(part, theta)) for part in self._parts], axis=0)
        found[found] = self._admits(theta[found])
        return found

    @cached_property
    def _log_share(self) -> float:
        share = float(self._admits(self._draw(_COUNTED, np.random.default_rng(0))).mean())
        if not share:
            raise UsageError("no values of the parameters keep the scenario's constraints")
        return float(np.log(share))

    def log_density(self, theta: FloatArray) -> FloatArray:
        """log p of rows (n, d): (n,)."""
        found = np.sum([part.log_density(self._columns(part, theta)) for part in self._parts], axis=0) - self._log_share
        return np.where(self.possible(theta), found, -np.inf)

    def foreseeable(self, theta: FloatArray) -> BoolArray:
        """Rows (n, d) that are possible, and foreseeable in each part and by each prior of what is done alone: (n,)."""
        judges = *self._parts, *self._alone
        return self.possible(theta) & np.all([each.foreseeable(self._columns(each, theta)) for each in judges], axis=0)

    def with_nuisances(self, theta: FloatArray) -> FloatArray:
        """Rows (n, d) with nuisances as each part has them."""
        found = theta.copy()
        for part in self._parts:
            found[:, self.columns(part.names)] = part.with_nuisances(self._columns(part, theta))
        return found
