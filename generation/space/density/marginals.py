"""Stated densities of single parameters (ranges, distributions of OpenSCENARIO), and the prior they
make."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, singledispatch
from typing import Any, Protocol

import numpy as np

from generation.space.density.prior import FORESEEABLE, Prior
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from schemas.common.errors import UsageError
from schemas.common.terminal.text import finite_number
from schemas.expressions import literal
from xosc.distributions import (
    DistributionRange,
    DistributionSet,
    Histogram,
    LogNormalDistribution,
    NormalDistribution,
    PoissonDistribution,
    ProbabilityDistributionSet,
    Range,
    UniformDistribution,
)
from xosc.distributions.values import text

_TAIL = 1e-4
"""Probability that a distribution without limits has below and above the range that is searched."""
_MOST_CHOICES = 1000
_HALF = 0.5


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

    @property
    def follows(self) -> Mapping[float, Mapping[str, str]]:
        """Values of other parameters by name that belong to each of the only values."""

    def log_density(self, values: FloatArray) -> FloatArray:
        """log p of values (n,), −∞ outside; of choices, that of the nearest one."""

    def sample(self, n: int, generator: np.random.Generator) -> FloatArray:
        """Draws (n,)."""


@dataclass(frozen=True)
class PiecewiseConstant:
    """Pieces of constant density: one for a range, several for a histogram.

    Attributes:
        edges: from piece to piece (k + 1,), ascending.
        weights: of the pieces (k,), not negative.
    """

    edges: tuple[float, ...]
    weights: tuple[float, ...] = (1.0,)
    choices: tuple[float, ...] = ()
    follows: Mapping[float, Mapping[str, str]] = field(default_factory=dict)

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
        densities: FloatArray = pieces[
            # `right`: an edge belongs to the piece above it, the last edge to the last piece.
            np.clip(np.searchsorted(edges, values, "right") - 1, 0, len(weights) - 1)
        ]
        return np.where((values >= self.low) & (values <= self.high), densities, -np.inf)

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
    follows: Mapping[float, Mapping[str, str]] = field(default_factory=dict)

    @property
    def _upper(self) -> bool:
        """Whether probabilities are counted from above: far above the median all from below would
        round to 1."""
        return bool(self.of.cdf(self.low) > _HALF)

    @property
    def _probabilities(self) -> tuple[float, float]:
        """Probabilities below the limits, or above them."""
        counted = self.of.sf if self._upper else self.of.cdf
        return float(counted(self.low)), float(counted(self.high))

    def log_density(self, values: FloatArray) -> FloatArray:
        """log p of values (n,)."""
        inside = (values >= self.low) & (values <= self.high)
        # Cut to a range, the density has to integrate to 1 again.
        low, high = self._probabilities
        return np.where(inside, self.of.logpdf(values) - np.log(abs(high - low)), -np.inf)

    def sample(self, n: int, generator: np.random.Generator) -> FloatArray:
        """Draws (n,)."""
        low, high = self._probabilities
        inverse = self.of.isf if self._upper else self.of.ppf
        # Inverse transform within the limits; clipped, since the quantile of a limit may miss it by
        # rounding.
        return np.clip(inverse(low + generator.random(n) * (high - low)), self.low, self.high)


@dataclass(frozen=True)
class Choices:
    """Discrete values with weights; as a density each value has the cell of the points nearest to
    it.

    Words, and sets of values that no number tells apart, have the codes 0, 1, …; what they stand
    for follows.
    """

    choices: tuple[float, ...]
    weights: tuple[float, ...]
    follows: Mapping[float, Mapping[str, str]] = field(default_factory=dict)

    @property
    def low(self) -> float:
        """Least value."""
        return self.choices[0]

    @property
    def high(self) -> float:
        """Greatest value."""
        return self.choices[-1]

    @property
    def _edges(self) -> FloatArray:
        """Limits of the cells (k + 1,)."""
        # Half cells at both ends: nothing beyond the least and the greatest choice is searched.
        points = np.array(self.choices)
        return np.array([points[0], *(0.5 * (points[1:] + points[:-1])), points[-1]])

    def _cells(self, values: FloatArray) -> IntArray:
        """Index of the choice nearest to each value (n,)."""
        # Without the outer limits: each value belongs to a cell, those at the limits too.
        return np.searchsorted(self._edges[1:-1], values)

    def log_density(self, values: FloatArray) -> FloatArray:
        """log p of values (n,)."""
        # A probability over the width of its cell: comparable with densities of continuous
        # parameters.
        with np.errstate(divide="ignore"):
            densities = np.log(np.array(self.weights) / sum(self.weights) / np.diff(self._edges))
        inside = (values >= self.low) & (values <= self.high)
        return np.where(inside, densities[self._cells(values)], -np.inf)

    def nearest(self, values: FloatArray) -> FloatArray:
        """The choice that each value (n,) stands for."""
        return np.array(self.choices)[self._cells(values)]

    def spread(self, values: FloatArray, generator: np.random.Generator) -> FloatArray:
        """Values (n,) drawn evenly from the cells of others."""
        cells, edges = self._cells(values), self._edges
        return edges[cells] + generator.random(len(values)) * np.diff(edges)[cells]

    def sample(self, n: int, generator: np.random.Generator) -> FloatArray:
        """Draws (n,)."""
        return generator.choice(self.choices, size=n, p=np.array(self.weights) / sum(self.weights))


def uniform(low: float, high: float) -> Marginal:
    """Every value of a range alike.

    Raises:
        UsageError: it is empty.
    """
    if not (np.isfinite([low, high]).all() and low < high):
        raise UsageError(
            f"{low:g}..{high:g} is no range: two finite numbers are expected, the lower one first"
        )
    return PiecewiseConstant((low, high))


@singledispatch
def marginal(of: object, name: str) -> Marginal | str:
    """Return a standard distribution's density of one parameter, or its only value.

    Args:
        name: of the parameter.

    Raises:
        UsageError: it has no density that can be searched.
    """
    raise UsageError(
        f"a {type(of).__name__} has no density that can be searched: pin its parameter"
    )


@marginal.register
def _range(of: DistributionRange, _name: str) -> Marginal | str:
    return _even(of.range)


@marginal.register
def _uniform(of: UniformDistribution, _name: str) -> Marginal | str:
    return _even(of.range)


def _even(limits: Range) -> Marginal | str:
    """Every value of a Range alike; where it holds one, this."""
    low, high = limits.lower_limit, limits.upper_limit
    return uniform(low, high) if low < high else text(low)


@marginal.register
def _histogram(of: Histogram, _name: str) -> Marginal | str:
    bins = sorted((bin_.range.lower_limit, bin_.range.upper_limit, bin_.weight) for bin_ in of.bins)
    edges: list[float] = [bins[0][0]]
    weights: list[float] = []
    for low, high, weight in bins:
        # A probability without width has no density beside those of other bins.
        if low == high and weight > 0.0:
            raise UsageError("a bin of this Histogram holds a single value: pin its parameter")
        # Overlapping bins would count twice in some readings and once in others.
        if low < edges[-1]:
            raise UsageError("bins of this Histogram overlap: pin its parameter")
        # A gap between bins is a piece without weight.
        if low > edges[-1]:
            edges, weights = [*edges, low], [*weights, 0.0]
        if high > low:
            edges, weights = [*edges, high], [*weights, weight]
    return PiecewiseConstant(tuple(edges), tuple(weights))


@marginal.register
def _normal(of: NormalDistribution, _name: str) -> Marginal | str:
    from scipy import stats

    # A density without width: the parameter has one value.
    if not of.variance:
        return repr(of.expected_value)
    if of.range is not None and of.range.lower_limit == of.range.upper_limit:
        return text(of.range.lower_limit)
    if isinstance(of, LogNormalDistribution):
        # The standard gives the expected value and the variance of the variable itself; scipy takes
        # those of its logarithm: σ² = log(1 + V/E²), median E·exp(-σ²/2).
        spread = np.log1p(of.variance / of.expected_value**2)
        known = stats.lognorm(np.sqrt(spread), scale=of.expected_value * np.exp(-0.5 * spread))
    else:
        known = stats.norm(of.expected_value, np.sqrt(of.variance))
    limits = (
        (known.ppf(_TAIL), known.ppf(1 - _TAIL))
        if of.range is None
        else (of.range.lower_limit, of.range.upper_limit)
    )
    # Below its support a log-normal variable has no values, whatever the Range says.
    return Continuous(known, float(max(limits[0], known.support()[0])), float(limits[1]))


@marginal.register
def _poisson(of: PoissonDistribution, _name: str) -> Marginal | str:
    from scipy import stats

    known = stats.poisson(of.expected_value)
    low, high = known.ppf([_TAIL, 1 - _TAIL])
    if of.range is not None:
        low, high = np.ceil(of.range.lower_limit), np.floor(of.range.upper_limit)
    # Counts are not negative, whatever the Range says.
    low = max(low, 0.0)
    if high - low >= _MOST_CHOICES:
        raise UsageError(
            f"a PoissonDistribution of {high - low + 1:.0f} counts has more than can be "
            "searched: give it a narrower Range"
        )
    counts = np.arange(low, high + 1)
    return _chosen(counts.tolist(), known.pmf(counts).tolist())


@marginal.register
def _probabilities(of: ProbabilityDistributionSet, name: str) -> Marginal | str:
    values, weights = zip(*of.elements, strict=True)
    return _listed(list(values), list(weights), name)


@marginal.register
def _set(of: DistributionSet, name: str) -> Marginal | str:
    return _listed(list(of.values), [1.0] * len(of.values), name)


def _listed(values: list[str], weights: list[float], name: str) -> Marginal | str:
    """Numbers as choices; words as categories of the parameter of that name."""
    # A word may read as infinity or NaN, between which and a number nothing can be searched.
    numbers = [number for value in values if (number := finite_number(value)) is not None]
    if len(numbers) < len(values):
        return categories([{name: value} for value in values], weights) or values[0]
    return _chosen(numbers, weights, values, name) if len(set(numbers)) > 1 else values[0]


def categories(texts: Sequence[Mapping[str, str]], weights: Sequence[float]) -> Choices | None:
    """Sets of values by parameter as choices, coded 0, 1, … in their order; None where fewer than
    two differ.

    Equal sets, and those without weight, are no choices of their own.
    """
    total: dict[tuple[tuple[str, str], ...], float] = {}
    for assigned, weight in zip(texts, weights, strict=True):
        if weight > 0.0:
            # Sorted: files name the parameters of a set in any order.
            key = tuple(sorted(assigned.items()))
            total[key] = total.get(key, 0.0) + weight
    if len(total) < 2:
        return None
    codes = tuple(map(float, range(len(total))))
    return Choices(
        codes,
        tuple(total.values()),
        {code: dict(key) for code, key in zip(codes, total, strict=True)},
    )


def _chosen(
    numbers: list[float], weights: list[float], texts: Sequence[str] = (), name: str = ""
) -> Marginal | str:
    """Numbers as choices, with their texts where these are written otherwise than numbers are."""
    total: dict[float, float] = {}
    for number, weight in zip(numbers, weights, strict=True):
        # Equal numbers written differently (1, 1.0) are one choice.
        total[number] = total.get(number, 0.0) + weight
    kept = sorted(number for number, weight in total.items() if weight > 0.0)
    # Never none: distributions refuse weights of which none is positive.
    if len(kept) < 2:
        return repr(kept[0])
    written = {number: {name: text} for number, text in zip(numbers, texts, strict=False)}
    # Then numbers are written by the search itself; texts as `007` have to stay as they are.
    usual = all(literal(number) == text[name] for number, text in written.items())
    follows = {} if usual else {number: written[number] for number in kept}
    return Choices(tuple(kept), tuple(total[number] for number in kept), follows)


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
        self.names, self._marginals, self._admits = (
            tuple(marginals),
            list(marginals.values()),
            admits,
        )
        self.low = np.array([marginal.low for marginal in self._marginals])
        self.high = np.array([marginal.high for marginal in self._marginals])
        self.nuisances = tuple(nuisances)
        self.theta = np.empty((0, len(self.names))) if theta is None else theta
        self.recordings = np.full(len(self.theta), "drawn")

    def possible(self, theta: FloatArray) -> BoolArray:
        """Rows (n, d) that are in the box and keep the constraints: (n,)."""
        admitted = self.inside(theta)
        if self._admits is not None:
            admitted[admitted] = self._admits(theta[admitted])
        return admitted

    def _raw(self, theta: FloatArray) -> FloatArray:
        total = np.zeros(len(theta))
        for name, marginal, values in zip(self.names, self._marginals, theta.T, strict=True):
            if name not in self.nuisances:
                total += marginal.log_density(values)
        return total

    def _draw(self, n: int, generator: np.random.Generator) -> FloatArray:
        return np.stack([marginal.sample(n, generator) for marginal in self._marginals], axis=1)

    @cached_property
    def _log_share(self) -> float:
        # By Monte Carlo, with a fixed seed: constraints have any form, and the same file has the
        # same density each time.
        share = float(self.possible(self._draw(_COUNTED, np.random.default_rng(0))).mean())
        if not share:
            raise UsageError("no values of the parameters keep the scenario's constraints")
        return float(np.log(share))

    @cached_property
    def limit(self) -> float:
        """log p that all but 1 % of draws reach."""
        return float(
            np.quantile(
                self.log_density(self.sample(_COUNTED, np.random.default_rng(0))), FORESEEABLE
            )
        )

    def log_density(self, theta: FloatArray) -> FloatArray:
        """log p of rows (n, d): (n,)."""
        return np.where(self.possible(theta), self._raw(theta) - self._log_share, -np.inf)

    def _foreseeable(self, theta: FloatArray) -> BoolArray:
        """Rows (n, d) that are possible and no less likely than 99 % of draws: (n,)."""
        # All of a uniform density are alike but for rounding.
        likely: BoolArray = self.log_density(theta) >= self.limit - 1e-9
        return likely

    def chosen(self, theta: FloatArray) -> FloatArray:
        """Rows (n, d) with each discrete parameter at the choice nearest to its value."""
        return self._discrete(theta, Choices.nearest)

    def spread(self, theta: FloatArray, generator: np.random.Generator) -> FloatArray:
        """Rows (n, d) with each discrete parameter anywhere nearest to its choice."""
        return self._discrete(theta, lambda choices, values: choices.spread(values, generator))

    def _discrete(
        self, theta: FloatArray, change: Callable[[Choices, FloatArray], FloatArray]
    ) -> FloatArray:
        rows = theta.copy()
        for column, marginal in enumerate(self._marginals):
            if isinstance(marginal, Choices):
                rows[:, column] = change(marginal, theta[:, column])
        return rows

    def with_nuisances(self, theta: FloatArray) -> FloatArray:
        """Rows (n, d) as they are: nothing is recorded of nuisances."""
        return theta


class JointPrior(Prior):
    """Parts that are independent of each other, each of some columns.

    Args:
        names: of all columns, in their order.
        parts: priors of some of them each; the recorded rows are those of the first one.
        admits: rows that keep the scenario's constraints.
        alone: priors of some columns that say with the others what is foreseeable, and are no part
            of the density.
    """

    def __init__(
        self,
        names: Sequence[str],
        parts: Sequence[Prior],
        admits: Admits,
        alone: Sequence[Prior] = (),
    ) -> None:
        self.names, self._parts, self._admits, self._alone = (
            tuple(names),
            list(parts),
            admits,
            list(alone),
        )
        owner = {name: part for part in parts for name in part.names}
        self.low = np.array([owner[name].low[owner[name].names.index(name)] for name in names])
        self.high = np.array([owner[name].high[owner[name].names.index(name)] for name in names])
        self.nuisances = tuple(name for part in parts for name in part.nuisances)
        self.theta, self.recordings = (
            np.empty((len(parts[0].theta), len(self.names))),
            parts[0].recordings,
        )
        generator = np.random.default_rng(0)
        for part in parts:
            # Parts are independent, so any of their draws may stand beside a recorded row.
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
        admitted = np.all(
            [part.possible(self._columns(part, theta)) for part in self._parts], axis=0
        )
        admitted[admitted] = self._admits(theta[admitted])
        return admitted

    @cached_property
    def _log_share(self) -> float:
        share = float(self._admits(self._draw(_COUNTED, np.random.default_rng(0))).mean())
        if not share:
            raise UsageError("no values of the parameters keep the scenario's constraints")
        return float(np.log(share))

    def log_density(self, theta: FloatArray) -> FloatArray:
        """log p of rows (n, d): (n,)."""
        densities = (
            np.sum([part.log_density(self._columns(part, theta)) for part in self._parts], axis=0)
            - self._log_share
        )
        return np.where(self.possible(theta), densities, -np.inf)

    def log_ratios(self, theta: FloatArray, n: int, generator: np.random.Generator) -> FloatArray:
        """log p'/p of possible rows (m, d) for densities p' of resampled recordings: (n, m); (0, m)
        without recordings."""
        ratios = [part.log_ratios(self._columns(part, theta), n, generator) for part in self._parts]
        # Parts are independent, so ratios multiply; what is stated is the same in all densities.
        resampled = [of_part for of_part in ratios if len(of_part)]
        return np.sum(resampled, axis=0) if resampled else np.empty((0, len(theta)))

    def _foreseeable(self, theta: FloatArray) -> BoolArray:
        """Rows (n, d) that are possible, and foreseeable in each part and by each prior of what is
        done alone: (n,)."""
        judges = *self._parts, *self._alone
        return self.possible(theta) & np.all(
            [judge.foreseeable(self._columns(judge, theta)) for judge in judges], axis=0
        )

    def chosen(self, theta: FloatArray) -> FloatArray:
        """Rows (n, d) with each discrete parameter at the choice nearest to its value."""
        return self._by_part(theta, lambda part, rows: part.chosen(rows))

    def spread(self, theta: FloatArray, generator: np.random.Generator) -> FloatArray:
        """Rows (n, d) with each discrete parameter anywhere nearest to its choice."""
        return self._by_part(theta, lambda part, rows: part.spread(rows, generator))

    def with_nuisances(self, theta: FloatArray) -> FloatArray:
        """Rows (n, d) with nuisances as each part has them."""
        return self._by_part(theta, lambda part, rows: part.with_nuisances(rows))

    def _by_part(
        self, theta: FloatArray, change: Callable[[Prior, FloatArray], FloatArray]
    ) -> FloatArray:
        rows = theta.copy()
        for part in self._parts:
            rows[:, self.columns(part.names)] = change(part, self._columns(part, theta))
        return rows
