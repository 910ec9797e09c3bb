"""Densities of single parameters that are stated rather than recorded: ranges, and the distributions of OpenSCENARIO."""

from __future__ import annotations

from dataclasses import dataclass
from functools import singledispatch
from typing import Any, Protocol

import numpy as np

from schemas.errors import UsageError
from xodr.array_types import FloatArray
from xosc.distributions import (
    DistributionRange,
    DistributionSet,
    Histogram,
    LogNormalDistribution,
    NormalDistribution,
    PoissonDistribution,
    ProbabilityDistributionSet,
    UniformDistribution,
)

_TAIL = 1e-4
"""Probability that a distribution without limits has below and above the range that is searched."""
_MOST_CHOICES = 1000


class Marginal(Protocol):
    """p(x) of one parameter; values are continuous, or some choices."""

    @property
    def low(self) -> float:
        """Least value."""

    @property
    def high(self) -> float:
        """Greatest value."""

    @property
    def choices(self) -> tuple[float, ...]:
        """The only values."""

    def log_density(self, values: FloatArray) -> FloatArray:
        """log p of values (n,), −∞ outside; of choices, that of the nearest one."""

    def sample(self, n: int, generator: np.random.Generator) -> FloatArray:
        """Draws (n,)."""


@dataclass(frozen=True)
class Steps:
    """Pieces of constant density: one for a range, several for a histogram.

    Attributes:
        edges: from piece to piece (k + 1,), ascending.
        weights: of the pieces (k,), not negative.
    """

    edges: tuple[float, ...]
    weights: tuple[float, ...] = (1.0,)
    choices: tuple[float, ...] = ()

    @property
    def low(self) -> float:
        """Least value."""
        return self.edges[0]

    @property
    def high(self) -> float:
        """Greatest value."""
        return self.edges[-1]

    def log_density(self, values: FloatArray) -> FloatArray:
        """log p of values (n,)."""
        edges, weights = np.array(self.edges), np.array(self.weights)
        with np.errstate(divide="ignore"):
            pieces = np.log(weights / weights.sum() / np.diff(edges))
        found: FloatArray = pieces[np.clip(np.searchsorted(edges, values, "right") - 1, 0, len(weights) - 1)]
        return np.where((values >= self.low) & (values <= self.high), found, -np.inf)

    def sample(self, n: int, generator: np.random.Generator) -> FloatArray:
        """Draws (n,)."""
        weights = np.array(self.weights) / sum(self.weights)
        piece = generator.choice(len(weights), size=n, p=weights)
        edges = np.array(self.edges)
        return edges[piece] + generator.random(n) * np.diff(edges)[piece]


@dataclass(frozen=True, eq=False)
class Continuous:
    """A distribution of scipy, cut to a range.

    Attributes:
        of: the distribution, frozen.
    """

    of: Any
    low: float
    high: float
    choices: tuple[float, ...] = ()

    def log_density(self, values: FloatArray) -> FloatArray:
        """log p of values (n,)."""
        inside = (values >= self.low) & (values <= self.high)
        share = self.of.cdf(self.high) - self.of.cdf(self.low)
        return np.where(inside, self.of.logpdf(values) - np.log(share), -np.inf)

    def sample(self, n: int, generator: np.random.Generator) -> FloatArray:
        """Draws (n,)."""
        low, high = self.of.cdf(self.low), self.of.cdf(self.high)
        return np.clip(self.of.ppf(low + generator.random(n) * (high - low)), self.low, self.high)


@dataclass(frozen=True)
class Choices:
    """Some values with their weights; a density in that each value has the cell of what is nearest to it."""

    choices: tuple[float, ...]
    weights: tuple[float, ...]

    @property
    def low(self) -> float:
        """Least value."""
        return self.choices[0]

    @property
    def high(self) -> float:
        """Greatest value."""
        return self.choices[-1]

    def log_density(self, values: FloatArray) -> FloatArray:
        """log p of values (n,)."""
        points = np.array(self.choices)
        middles = 0.5 * (points[1:] + points[:-1])
        cells = np.diff([points[0], *middles, points[-1]])
        with np.errstate(divide="ignore"):
            found = np.log(np.array(self.weights) / sum(self.weights) / cells)[np.searchsorted(middles, values)]
        return np.where((values >= self.low) & (values <= self.high), found, -np.inf)

    def sample(self, n: int, generator: np.random.Generator) -> FloatArray:
        """Draws (n,)."""
        return generator.choice(self.choices, size=n, p=np.array(self.weights) / sum(self.weights))


def uniform(low: float, high: float) -> Marginal:
    """Every value of a range alike.

    Raises:
        UsageError: it is empty.
    """
    if not (np.isfinite([low, high]).all() and low < high):
        raise UsageError(f"{low:g}..{high:g} is no range: two finite numbers are expected, the lower one first")
    return Steps((low, high))


@singledispatch
def marginal(of: object) -> Marginal | str:
    """What a distribution of the standard says of one parameter: a density, or its one value.

    Raises:
        UsageError: it has no density that can be searched.
    """
    raise UsageError(f"a {type(of).__name__} has no density that can be searched: pin its parameter")


@marginal.register
def _range(of: DistributionRange) -> Marginal | str:
    low, high = of.range.lower_limit, of.range.upper_limit
    return uniform(low, high) if low < high else of.value(0)


@marginal.register
def _uniform(of: UniformDistribution) -> Marginal | str:
    return uniform(of.range.lower_limit, of.range.upper_limit)


@marginal.register
def _histogram(of: Histogram) -> Marginal | str:
    bins = sorted((each.range.lower_limit, each.range.upper_limit, each.weight) for each in of.bins)
    edges: list[float] = [bins[0][0]]
    weights: list[float] = []
    for low, high, weight in bins:
        if low < edges[-1]:
            raise UsageError("bins of this Histogram overlap: pin its parameter")
        if low > edges[-1]:
            edges, weights = [*edges, low], [*weights, 0.0]
        edges, weights = [*edges, high], [*weights, weight]
    return Steps(tuple(edges), tuple(weights))


@marginal.register
def _normal(of: NormalDistribution) -> Marginal | str:
    from scipy import stats

    if not of.variance:
        return repr(of.expected_value)
    if isinstance(of, LogNormalDistribution):
        spread = np.log1p(of.variance / of.expected_value**2)
        known = stats.lognorm(np.sqrt(spread), scale=of.expected_value * np.exp(-0.5 * spread))
    else:
        known = stats.norm(of.expected_value, np.sqrt(of.variance))
    limits = (known.ppf(_TAIL), known.ppf(1 - _TAIL)) if of.range is None else (of.range.lower_limit, of.range.upper_limit)
    return Continuous(known, float(max(limits[0], known.support()[0])), float(limits[1]))


@marginal.register
def _poisson(of: PoissonDistribution) -> Marginal | str:
    from scipy import stats

    known = stats.poisson(of.expected_value)
    low, high = known.ppf([_TAIL, 1 - _TAIL])
    if of.range is not None:
        low, high = np.ceil(of.range.lower_limit), np.floor(of.range.upper_limit)
    counts = np.arange(max(low, 0.0), high + 1)
    if len(counts) > _MOST_CHOICES:
        raise UsageError(f"a PoissonDistribution of {len(counts)} counts has more than can be searched: give it a Range")
    return _chosen(counts.tolist(), known.pmf(counts).tolist())


@marginal.register
def _probabilities(of: ProbabilityDistributionSet) -> Marginal | str:
    values, weights = zip(*of.elements, strict=True)
    return _listed(list(values), list(weights))


@marginal.register
def _set(of: DistributionSet) -> Marginal | str:
    return _listed(list(of.values), [1.0] * len(of.values))


def _listed(values: list[str], weights: list[float]) -> Marginal | str:
    """Numbers as choices; of words the likeliest, the first one where all are alike."""
    try:
        numbers = [float(value) for value in values]
    except ValueError:
        return max(zip(weights, reversed(range(len(values))), values, strict=True))[2]
    return _chosen(numbers, weights) if len(set(numbers)) > 1 else values[0]


def _chosen(numbers: list[float], weights: list[float]) -> Marginal | str:
    total: dict[float, float] = {}
    for number, weight in zip(numbers, weights, strict=True):
        total[number] = total.get(number, 0.0) + weight
    kept = sorted(number for number, weight in total.items() if weight > 0.0)
    return Choices(tuple(kept), tuple(total[number] for number in kept)) if len(kept) > 1 else repr(kept[0])
