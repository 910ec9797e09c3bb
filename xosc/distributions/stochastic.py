"""Stochastic distributions: test runs drawn from probability distributions (OpenSCENARIO XML, Stochastic).

Every draw is the distribution's quantile at a uniform number that depends on the seed, the parameter's name and the
number of the run alone. So each parameter has its own stream, a run is the same whether reached one by one or at
once, another parameter added to the file changes nothing, and truncation to a Range is exact and never rejects.
"""

from __future__ import annotations

from dataclasses import dataclass
from hashlib import blake2b
from typing import get_args

from lxml import etree

from schemas.errors import UsageError
from xosc.distributions.probability import (
    Histogram,
    LogNormalDistribution,
    NormalDistribution,
    PoissonDistribution,
    ProbabilityDistributionSet,
    UniformDistribution,
)
from xosc.distributions.user import UserDefinedDistribution
from xosc.distributions.values import element, finite, located, text
from xosc.node import Node

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
        """From its element."""
        child = node.only()
        if child.tag not in _KINDS:
            raise child.invalid("not a stochastic distribution of the standard")
        return cls(node.get("parameterName"), _KINDS[child.tag].read(child))

    def write(self) -> etree._Element:
        """As its element."""
        return element("StochasticDistribution", self.distribution.write(), parameterName=self.parameter_name)


@dataclass(frozen=True)
class Stochastic:
    """`Stochastic`: a number of test runs, each with every parameter drawn on its own. No seed means seed 0."""

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
        seed = float(seed if seed is not None else self.random_seed or 0)
        return {
            each.parameter_name: each.distribution.quantile(uniform(f"{seed}/{each.parameter_name}/{index}"))
            for each in self.distributions
        }

    @classmethod
    def read(cls, node: Node) -> Stochastic:
        """From its element."""
        distributions = tuple(StochasticDistribution.read(child) for child in node.children("StochasticDistribution"))
        with located(node):
            return cls(node.int("numberOfTestRuns"), distributions, node.finite("randomSeed", None))

    def write(self) -> etree._Element:
        """As its element."""
        written = element("Stochastic", *(distribution.write() for distribution in self.distributions))
        written.set("numberOfTestRuns", str(self.number_of_test_runs))
        if self.random_seed is not None:
            written.set("randomSeed", text(self.random_seed))
        return written


def uniform(key: str) -> float:
    """A number uniform in (0, 1) that depends on the key alone; 52 bits, so that neither end is ever reached."""
    bits = int.from_bytes(blake2b(key.encode(), digest_size=8).digest(), "big") >> 12
    return (bits + 0.5) * 2**-52
