"""P(failure | manoeuvre) by another library: subset simulation of OpenTURNS in arrays, with none of
our estimate in it.

S.-K. Au, J. L. Beck, Estimation of small failure probabilities in high dimensions by subset
simulation, Probabilistic Engineering Mechanics 16, 2001.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.special import ndtr

from generation.search.problem import Plays
from generation.space.density.prior import RecordedPrior
from schemas.common.array_types import FloatArray
from studies.generation.packages import package

_BLOCK, _BLOCKS, _LEVEL = 2000, 2, 0.1
"""Points of a level at once, how often, and the share of them that is beyond the next level"""
_FAILS, _SAFE, _IMPOSSIBLE = -1e3, -999.0, 1e3
"""Values of a collision, of the lowest other point, and of a point that no traffic makes"""


class Found(NamedTuple):
    """The probability of a collision, its coefficient of variation, and how many points were
    played."""

    value: float
    variation: float
    played: int

    def __str__(self) -> str:
        return (
            f"{self.value:.2e}, coefficient of variation {self.variation:.3f}, {self.played} "
            "points played"
        )


def openturns() -> Any:
    """The package.

    Raises:
        UsageError: it is not installed.
    """
    return package("openturns", "subset simulation is that")


def subset_simulation(prior: RecordedPrior, plays: Plays, seed: int) -> Found:
    """Estimate the probability of a collision of draws of a prior.

    Levels are of the greatest deceleration that avoids a crash (DRAC). By the least clearance,
    vehicles that pass closely are mistaken for near misses, and most failures are not found.

    Args:
        prior: a sum of Gaussians of logarithms.

    Raises:
        UsageError: OpenTURNS is not installed, or the prior is another one.
    """
    ot, level = openturns(), Level(prior, plays)
    ot.RandomGenerator.SetSeed(seed)
    function = ot.PythonFunction(level.dimensions, 1, func_sample=level)
    output = ot.CompositeRandomVector(function, ot.RandomVector(ot.Normal(level.dimensions)))
    algorithm = ot.SubsetSampling(ot.ThresholdEvent(output, ot.Less(), (_FAILS + _SAFE) / 2))
    algorithm.setBlockSize(_BLOCK)
    algorithm.setMaximumOuterSampling(_BLOCKS)
    algorithm.setConditionalProbability(_LEVEL)
    algorithm.run()
    found = algorithm.getResult()
    return Found(
        found.getProbabilityEstimate() / prior.possible_share,
        found.getCoefficientOfVariation(),
        level.played,
    )


class Level:
    """Distance of standard normal points from a collision: −DRAC, less than all of these with a
    collision.

    The last column chooses the Gaussian that the others are turned into.

    Attributes:
        dimensions: of the points. played: in arrays so far.
    """

    def __init__(self, prior: RecordedPrior, plays: Plays) -> None:
        self._prior, self._plays, self._parts = prior, plays, prior.gaussians
        self._factors = np.linalg.cholesky(self._parts.covariances)
        self._until = np.cumsum(np.exp(self._parts.log_weights))
        self.dimensions, self.played = len(prior.searched) + 1, 0

    def points(self, normal: FloatArray) -> FloatArray:
        """The prior's points (n, d), possible or not, that standard normal ones (n, dimensions)
        stand for."""
        chosen = np.minimum(np.searchsorted(self._until, ndtr(normal[:, -1])), len(self._until) - 1)
        factors = self._factors[
            chosen if len(self._factors) > 1 else np.zeros(len(chosen), np.int64)
        ]
        return self._prior.of_logs(
            self._parts.means[chosen] + (factors @ normal[:, :-1, None])[..., 0]
        )

    def __call__(self, sample: Any) -> FloatArray:
        """The levels (n, 1) of a sample (n, dimensions)."""
        theta = self.points(np.array(sample))
        found = np.full((len(theta), 1), _IMPOSSIBLE)
        possible = self._prior.possible(theta)
        if possible.any():
            outcomes = self._plays(theta[possible])
            found[possible, 0] = np.where(
                outcomes.collision, _FAILS, np.maximum(-outcomes.max_drac, _SAFE)
            )
            self.played += int(possible.sum())
        return found
