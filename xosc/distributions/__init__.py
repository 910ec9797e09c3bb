"""ParameterValueDistribution files: the variations of a scenario, and every distribution of the standard as a dataclass."""

from xosc.distributions.deterministic import (
    Deterministic,
    DeterministicMultiParameterDistribution,
    DeterministicSingleParameterDistribution,
    DistributionRange,
    DistributionSet,
)
from xosc.distributions.file import ParameterValueDistribution, write_distribution
from xosc.distributions.probability import (
    Histogram,
    HistogramBin,
    LogNormalDistribution,
    NormalDistribution,
    PoissonDistribution,
    ProbabilityDistributionSet,
    UniformDistribution,
)
from xosc.distributions.selection import Selection
from xosc.distributions.space import ParameterSpace, Variations, sample, variations
from xosc.distributions.stochastic import Stochastic, StochasticDistribution
from xosc.distributions.user import UserDefinedDistribution, UserDistribution
from xosc.distributions.values import Range

__all__ = [
    "Deterministic",
    "DeterministicMultiParameterDistribution",
    "DeterministicSingleParameterDistribution",
    "DistributionRange",
    "DistributionSet",
    "Histogram",
    "HistogramBin",
    "LogNormalDistribution",
    "NormalDistribution",
    "ParameterSpace",
    "ParameterValueDistribution",
    "PoissonDistribution",
    "ProbabilityDistributionSet",
    "Range",
    "Selection",
    "Stochastic",
    "StochasticDistribution",
    "UniformDistribution",
    "UserDefinedDistribution",
    "UserDistribution",
    "Variations",
    "sample",
    "variations",
    "write_distribution",
]
