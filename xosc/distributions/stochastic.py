"""Stochastic distributions: test runs drawn from probability distributions (OpenSCENARIO XML,
Stochastic).

Every draw is the distribution's quantile at a uniform number that depends on the seed, the
parameter's name and the number of the run alone. So each parameter has its own stream, a run is the
same whether reached one by one or at once, another parameter added to the file changes nothing, and
truncation to a Range is exact and never rejects."""

from __future__ import annotations

import math
from bisect import bisect_left
from dataclasses import dataclass
from functools import cached_property
from hashlib import blake2b
from itertools import accumulate
from statistics import NormalDist
from typing import Self, get_args

from lxml import etree

from schemas.common.errors import UsageError
from xosc.distributions.values import (
    Range,
    UserDefinedDistribution,
    element,
    finite,
    located,
    text,
    weights,
)
from xosc.document.node import Node

_STANDARD = NormalDist()
_TINY = 5e-324
_LARGEST_EXPONENT = 709.78


@dataclass(frozen=True)
class NormalDistribution:
    """`NormalDistribution`: Gaussian, truncated to a Range where one is given."""

    expected_value: float
    variance: float
    range: Range | None = None

    def __post_init__(self) -> None:
        finite("expectedValue", self.expected_value)
        finite("variance", self.variance)
        if self.variance < 0:
            raise UsageError(f"variance={self.variance:g} must not be negative")
        self._check()

    def _check(self) -> None:
        """Refuse a Range without probability here rather than at the first draw."""
        if (
            self.range is None
            or self.range.lower_limit == self.expected_value == self.range.upper_limit
        ):
            return
        low, high, _ = self._probabilities
        # A Range of one value is that value, however improbable it is.
        if low >= high and (not self.variance or self.range.lower_limit < self.range.upper_limit):
            raise UsageError("the Range holds no probability of this distribution")

    def quantile(self, probability: float) -> float:
        """The value at a cumulative probability."""
        if not self.variance:
            return self.expected_value
        low, high, mirrored = self._probabilities
        aim = high - probability * (high - low) if mirrored else low + probability * (high - low)
        # inv_cdf is not defined at 0 and 1: the least positive double and the last one below 1 are.
        deviation = _STANDARD.inv_cdf(min(max(aim, _TINY), 1 - 2**-53))
        return _clamped(
            self.expected_value
            + math.sqrt(self.variance) * (-deviation if mirrored else deviation),
            self.range,
        )

    @cached_property
    def _probabilities(self) -> tuple[float, float, bool]:
        """Cumulative probabilities of the limits; mirrored above the mean, where they would all
        round to 1."""
        if self.range is None:
            return 0.0, 1.0, False
        if not self.variance:
            return 0.0, float(self.expected_value in self.range), False
        mirrored = self.range.lower_limit > self.expected_value
        scale = math.sqrt(2 * self.variance) * (-1 if mirrored else 1)
        limits = (
            (limit - self.expected_value) / scale
            for limit in (self.range.lower_limit, self.range.upper_limit)
        )
        # By erfc, which keeps its digits in the tails; 1 - erf loses them.
        low, high = sorted(0.5 * math.erfc(-limit) for limit in limits)
        return low, high, mirrored

    @classmethod
    def read(cls, node: Node) -> Self:
        """Read the element."""
        with located(node):
            return cls(node.finite("expectedValue"), node.finite("variance"), _optional_range(node))

    def write(self) -> etree._Element:
        """The element of the distribution."""
        moments = {"expectedValue": text(self.expected_value), "variance": text(self.variance)}
        return element(type(self).__name__, *_written(self.range), **moments)


@dataclass(frozen=True)
class LogNormalDistribution(NormalDistribution):
    """`LogNormalDistribution`: its logarithm is normal; expectedValue and variance are those of the
    values themselves."""

    def _check(self) -> None:
        if self.expected_value <= 0:
            raise UsageError(
                f"expectedValue={self.expected_value:g} of a log-normal "
                "distribution must be positive"
            )
        if self.range is not None and self.range.upper_limit <= 0:
            raise UsageError(
                "the Range holds no probability of this distribution, whose values are positive"
            )
        self._logarithm  # noqa: B018 - its own checks

    def quantile(self, probability: float) -> float:
        """The value at a cumulative probability."""
        return _clamped(
            math.exp(min(self._logarithm.quantile(probability), _LARGEST_EXPONENT)), self.range
        )

    @cached_property
    def _logarithm(self) -> NormalDistribution:
        # Moments of the logarithm: σ² = ln(1 + v / m²), μ = ln m − σ² / 2. Divided twice, as m² of
        # a small mean is 0.
        variance = math.log1p(self.variance / self.expected_value / self.expected_value)
        mean = math.log(self.expected_value) - variance / 2
        if self.range is None:
            return NormalDistribution(mean, variance)
        lower, upper = (
            # A limit at 0 or below cuts nothing off: the logarithm of the least double stands for
            # −∞.
            math.log(max(limit, _TINY))
            for limit in (self.range.lower_limit, self.range.upper_limit)
        )
        return NormalDistribution(mean, variance, Range(lower, upper))


@dataclass(frozen=True)
class UniformDistribution:
    """`UniformDistribution`: every value of a Range is as likely."""

    range: Range

    def quantile(self, probability: float) -> float:
        """The value at a cumulative probability."""
        return _between(self.range, probability)

    @classmethod
    def read(cls, node: Node) -> UniformDistribution:
        """Read the element."""
        return cls(Range.read(node.need("Range")))

    def write(self) -> etree._Element:
        """The element of the distribution."""
        return element("UniformDistribution", self.range.write())


@dataclass(frozen=True)
class PoissonDistribution:
    """`PoissonDistribution`: numbers of events, truncated to a Range where one is given."""

    expected_value: float
    range: Range | None = None

    def __post_init__(self) -> None:
        finite("expectedValue", self.expected_value)
        # Beyond, counts are no exact doubles in scipy's inverse.
        if not 0 < self.expected_value <= 1e9:
            raise UsageError(
                f"expectedValue={self.expected_value:g} of a Poisson distribution must lie "
                "between 0 and 1e9"
            )
        self._probabilities  # noqa: B018 - a Range without probability is refused here, not at the first draw

    def quantile(self, probability: float) -> float:
        """The value at a cumulative probability."""
        from scipy.special import pdtr, pdtrik

        low, high = self._probabilities
        aim = low + probability * (high - low)
        count = (
            math.ceil(max(float(pdtrik(aim, self.expected_value)), 0.0))
            if aim > math.exp(-self.expected_value)
            else 0
        )
        # The inverse is not exact at the steps.
        if count and pdtr(count - 1, self.expected_value) >= aim:
            count -= 1
        return (
            count
            if self.range is None
            else min(
                max(count, math.ceil(self.range.lower_limit)), math.floor(self.range.upper_limit)
            )
        )

    @cached_property
    def _probabilities(self) -> tuple[float, float]:
        from scipy.special import pdtr

        if self.range is None:
            return 0.0, 1.0
        lower, upper = math.ceil(self.range.lower_limit), math.floor(self.range.upper_limit)
        low = float(pdtr(lower - 1, self.expected_value)) if lower > 0 else 0.0
        high = float(pdtr(upper, self.expected_value)) if upper >= 0 else 0.0
        if high <= low:
            raise UsageError("the Range holds no probability of this distribution")
        return low, high

    @classmethod
    def read(cls, node: Node) -> PoissonDistribution:
        """Read the element."""
        with located(node):
            return cls(node.finite("expectedValue"), _optional_range(node))

    def write(self) -> etree._Element:
        """The element of the distribution."""
        return element(
            "PoissonDistribution", *_written(self.range), expectedValue=text(self.expected_value)
        )


@dataclass(frozen=True)
class HistogramBin:
    """`HistogramBin`: a Range and its weight."""

    range: Range
    weight: float


@dataclass(frozen=True)
class Histogram:
    """`Histogram`: a bin is chosen by its weight, within a bin every value is as likely."""

    bins: tuple[HistogramBin, ...]

    def __post_init__(self) -> None:
        weights([bin_.weight for bin_ in self.bins])

    def quantile(self, probability: float) -> float:
        """The value at a cumulative probability."""
        index, rest = _choose([bin_.weight for bin_ in self.bins], probability)
        # The rest of the same number: a second one would need a stream of its own.
        return _between(self.bins[index].range, rest)

    @classmethod
    def read(cls, node: Node) -> Histogram:
        """Read the element."""
        with located(node):
            return cls(
                tuple(
                    HistogramBin(Range.read(n.need("Range")), n.finite("weight"))
                    for n in node.children("Bin")
                )
            )

    def write(self) -> etree._Element:
        """The element of the distribution."""
        return element(
            "Histogram",
            *(element("Bin", bin_.range.write(), weight=text(bin_.weight)) for bin_ in self.bins),
        )


@dataclass(frozen=True)
class ProbabilityDistributionSet:
    """`ProbabilityDistributionSet`: listed values, each with a weight."""

    elements: tuple[tuple[str, float], ...]

    def __post_init__(self) -> None:
        weights([weight for _, weight in self.elements])

    def quantile(self, probability: float) -> str:
        """The value at a cumulative probability."""
        return self.elements[_choose([weight for _, weight in self.elements], probability)[0]][0]

    @classmethod
    def read(cls, node: Node) -> ProbabilityDistributionSet:
        """Read the element."""
        with located(node):
            return cls(
                tuple(
                    (child.get("value"), child.finite("weight"))
                    for child in node.children("Element")
                )
            )

    def write(self) -> etree._Element:
        """Return its element."""
        listed = (
            element("Element", value=value, weight=text(weight)) for value, weight in self.elements
        )
        return element("ProbabilityDistributionSet", *listed)


def _clamped(value: float, limits: Range | None) -> float:
    return value if limits is None else min(max(value, limits.lower_limit), limits.upper_limit)


def _between(limits: Range, probability: float) -> float:
    """Linear in the probability; the two products cannot overflow where a difference of the limits
    could."""
    return _clamped(
        limits.lower_limit * (1 - probability) + limits.upper_limit * probability, limits
    )


def _choose(shares: list[float], probability: float) -> tuple[int, float]:
    """The index chosen by weight, and the place within its share, between 0 and 1."""
    sums = list(accumulate(shares))
    aim = probability * sums[-1]
    # The left one: a share of 0 has the sum of the share before it, and is never chosen.
    index = bisect_left(sums, aim)
    # Rounding may lead a bit out of [0, 1].
    return index, min(max((aim - (sums[index] - shares[index])) / shares[index], 0.0), 1.0)


def _optional_range(node: Node) -> Range | None:
    limits = node.find("Range")
    return Range.read(limits) if limits is not None else None


def _written(limits: Range | None) -> list[etree._Element]:
    return [limits.write()] if limits is not None else []


Distribution = (
    ProbabilityDistributionSet
    | NormalDistribution
    | LogNormalDistribution
    | UniformDistribution
    | PoissonDistribution
    | Histogram
    | UserDefinedDistribution
)
_KINDS = {kind.__name__: kind for kind in get_args(Distribution)}


@dataclass(frozen=True)
class StochasticDistribution:
    """`StochasticDistribution`: the probability distribution of one parameter."""

    parameter_name: str
    distribution: Distribution

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """The parameters that get values here."""
        return (self.parameter_name,)

    @classmethod
    def read(cls, node: Node) -> StochasticDistribution:
        """Read the element."""
        child = node.only()
        if child.tag not in _KINDS:
            raise child.invalid("not a stochastic distribution of the standard")
        return cls(node.get("parameterName"), _KINDS[child.tag].read(child))

    def write(self) -> etree._Element:
        """The element of the distribution."""
        return element(
            "StochasticDistribution", self.distribution.write(), parameterName=self.parameter_name
        )


@dataclass(frozen=True)
class Stochastic:
    """`Stochastic`: a number of test runs, each with every parameter drawn on its own. No seed
    means seed 0."""

    number_of_test_runs: int
    distributions: tuple[StochasticDistribution, ...]
    random_seed: float | None = None

    def __post_init__(self) -> None:
        if self.number_of_test_runs < 1:
            raise UsageError(f"numberOfTestRuns={self.number_of_test_runs} must be at least 1")
        if not self.distributions:
            raise UsageError("a Stochastic needs at least one StochasticDistribution")
        if self.random_seed is not None:
            finite("randomSeed", self.random_seed)

    @property
    def size(self) -> int:
        """Number of test runs."""
        return self.number_of_test_runs

    def assignment(self, index: int, seed: float | None = None) -> dict[str, str | float]:
        """Parameters and values of a run; numbers are not yet written in their parameter's type."""
        # 1 and 1.0 are the same seed: it becomes part of a text.
        seed = float(seed if seed is not None else self.random_seed or 0)
        return {
            distribution.parameter_name: distribution.distribution.quantile(
                uniform(f"{seed}/{distribution.parameter_name}/{index}")
            )
            for distribution in self.distributions
        }

    @classmethod
    def read(cls, node: Node) -> Stochastic:
        """Read the element."""
        distributions = tuple(
            StochasticDistribution.read(child) for child in node.children("StochasticDistribution")
        )
        with located(node):
            return cls(node.int("numberOfTestRuns"), distributions, node.finite("randomSeed", None))

    def write(self) -> etree._Element:
        """The element of the distribution."""
        written = element(
            "Stochastic", *(distribution.write() for distribution in self.distributions)
        )
        written.set("numberOfTestRuns", str(self.number_of_test_runs))
        if self.random_seed is not None:
            written.set("randomSeed", text(self.random_seed))
        return written


def uniform(key: str) -> float:
    """A number uniform in (0, 1) that depends on the key alone; 52 bits, so that neither end is
    ever reached."""
    bits = int.from_bytes(blake2b(key.encode(), digest_size=8).digest(), "big") >> 12
    return (bits + 0.5) * 2**-52
