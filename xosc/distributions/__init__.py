"""ParameterValueDistribution files: the variations of a scenario, and every distribution of the
standard as a dataclass.

Modules:

- `deterministic`: deterministic distributions
- `space`: the parameter space that a distribution file spans over its scenario: counted
- `stochastic`: stochastic distributions: test runs drawn from probability distributions
- `values`: shared parts of distributions: ranges, numbers as text, checks, elements

Example::

    for path, parameters in xosc.variations("variation.xosc"): ...
"""

from xosc.distributions.deterministic import (
    Deterministic,
    DeterministicMultiParameterDistribution,
    DeterministicSingleParameterDistribution,
    DistributionRange,
    DistributionSet,
    ParameterValueDistribution,
    write_distribution,
)
from xosc.distributions.space import ParameterSpace, Selection, Variations, sample, variations
from xosc.distributions.stochastic import (
    Histogram,
    HistogramBin,
    LogNormalDistribution,
    NormalDistribution,
    PoissonDistribution,
    ProbabilityDistributionSet,
    Stochastic,
    StochasticDistribution,
    UniformDistribution,
)
from xosc.distributions.values import Range, UserDefinedDistribution, UserDistribution

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
