"""Edge cases: the critical ones among episodes, the best first, none of them much like another."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from generation.density.base import Density
from generation.outcomes.outcomes import Episodes, Outcomes
from generation.search.diversity import apart, diverse
from generation.search.problem import Evaluate
from generation.search.space import Space
from xodr.array_types import BoolArray, FloatArray, IntArray

COLLISION, VIOLATION = "collision", "violation of RSS distances"
AVOIDED, UNKNOWN = "avoids a collision", "unknown: the run failed"
CAREFUL = "r157-cc"
"""System under test that says which collisions can be avoided."""


class Choice(NamedTuple):
    """Which episodes become files.

    Attributes:
        most: how many.
        apart: least distance of two in the unit cube, root mean square over the parameters.
    """

    most: int = 100
    apart: float = 0.05


@dataclass(frozen=True, eq=False)
class Cases:
    """Edge cases, one a row, the best first.

    Attributes:
        theta: parameters (n, d).
        outcomes, rewards: what came of them.
        log_likelihood: log-density (n,) of recorded parameters at theta.
        careful: what came of the careful and competent driver of UN R157 there.
    """

    theta: FloatArray
    outcomes: Outcomes
    rewards: FloatArray
    log_likelihood: FloatArray
    careful: Outcomes

    def __len__(self) -> int:
        return len(self.rewards)

    @property
    def avoidable(self) -> BoolArray:
        """The collisions (n,) that the careful driver is known to avoid."""
        return self.outcomes.collision & self.careful.survived

    def tags(self) -> dict[str, list[str] | list[float]]:
        """The values of each case, by the names of their tags."""
        return {
            "Verdict": [COLLISION if collided else VIOLATION for collided in self.outcomes.collision],
            "CarefulDriver": np.select([self.careful.survived, self.careful.collision], [AVOIDED, COLLISION], UNKNOWN).tolist(),
            "Reward": _rounded(self.rewards),
            "LogLikelihood": _rounded(self.log_likelihood),
            "RRisk": _rounded(self.outcomes.r_risk),
        }


def critical(outcomes: Outcomes) -> BoolArray:
    """Episodes (n,) with a collision or a violation of RSS distances."""
    return outcomes.executed & (outcomes.collision | (outcomes.r_risk > 0.0))


def choose(
    space: Space,
    episodes: Episodes,
    density: Density,
    careful: Evaluate,
    choice: Choice = Choice(),  # noqa: B008 - frozen
    found: FloatArray | None = None,
) -> Cases:
    """The critical episodes with the greatest rewards, of equal ones the likeliest, that are far enough from each other.

    Args:
        density: of recorded parameters.
        careful: runs scenarios with the system under test `CAREFUL`.
        found: points (m, d) that the cases are to be far enough from as well.
    """
    log_likelihood = density.log_density(episodes.theta)
    chosen = best(space, episodes, log_likelihood, choice, found)
    outcomes = Outcomes(**{name: values[chosen] for name, values in vars(episodes.outcomes).items()})
    theta = episodes.theta[chosen]
    return Cases(theta, outcomes, episodes.rewards[chosen], log_likelihood[chosen], careful(theta))


def best(
    space: Space, episodes: Episodes, log_likelihood: FloatArray, choice: Choice, found: FloatArray | None = None
) -> IntArray:
    """Indices of the episodes that `choose` chooses, given their log-densities (n,)."""
    order = np.lexsort((-log_likelihood, -episodes.rewards))
    order = order[critical(episodes.outcomes)[order]]
    if found is not None:
        order = order[apart(space.unit(episodes.theta[order]), space.unit(found), choice.apart)]
    return order[diverse(space.unit(episodes.theta[order]), choice.apart, choice.most)]


def _rounded(values: FloatArray) -> list[float]:
    """Values to six decimal digits."""
    found: list[float] = np.round(values, 6).tolist()
    return found
