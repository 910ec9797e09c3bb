"""Agreement of verdicts of plays in arrays with SUMO's: at draws of the prior, and at failures in
arrays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.stats import binomtest

from generation.search.methods.cover import cover
from generation.search.outcomes import REFERENCES
from generation.search.problem import BATCH, SearchProblem
from schemas.common.array_types import FloatArray
from schemas.common.errors import UsageError
from studies.generation.problem import Posed

CONFIDENCE = 0.95
HEADER = (
    f"| points, system | verdicts that are SUMO's | interval, {CONFIDENCE:.0%} |\n|---|---|---|"
)


class Agreement(NamedTuple):
    """Of verdicts at some points.

    Attributes:
        points: what they are. system: who drives.
        same: verdicts that are the same. number: of all.
    """

    points: str
    system: str
    same: int
    number: int

    def __str__(self) -> str:
        """Row of a table with the columns of `HEADER`."""
        low, high = binomtest(self.same, self.number).proportion_ci(CONFIDENCE, "exact")
        return (
            f"| {self.points}, {self.system} | {self.same} of {self.number} "
            f"| {low:.1%} to {high:.1%} |"
        )


def measured(posed: Posed, draws: int, finds: int, seed: int) -> list[Agreement]:
    """Play draws of the prior and uniform ones, and finds of a search in arrays, on both.

    Args:
        draws: how many of each of the first two. finds: how many of the last, at most.

    Raises:
        UsageError: the scenario does not play in arrays.
    """
    problem, generator = posed.problem, np.random.default_rng(seed)
    if problem.plays is None or problem.prior is None:
        raise UsageError("this scenario does not play in arrays")
    points = {
        "draws of the prior": problem.prior.sample(draws, generator),
        "uniform draws": problem.space.draw(draws, generator),
        "finds in arrays": _finds(problem, finds, seed),
    }
    found = [
        _compared(posed, problem, name, theta, None) for name, theta in points.items() if len(theta)
    ]
    others = points["uniform draws"][: draws // 4]
    return found + [
        _compared(posed, problem, "uniform draws", others, system) for system in REFERENCES
    ]


def _finds(problem: SearchProblem, most: int, seed: int) -> FloatArray:
    """Failures that a search in arrays alone finds."""
    assert problem.plays is not None
    if not most:
        return np.empty((0, len(problem.space.parameters)))
    alone = SearchProblem(
        problem.space,
        problem.plays,
        problem.reward,
        problem.real,
        None,
        problem.prior,
        problem.plays,
    )
    found = cover(alone, max(2 * most, BATCH), seed)
    return found.theta[found.outcomes.collision & found.outcomes.executed][:most]


def _compared(
    posed: Posed, problem: SearchProblem, name: str, theta: FloatArray, system: str | None
) -> Agreement:
    assert problem.plays is not None
    sut = None if system is None else REFERENCES[system]
    sumo, plays = posed.sumo(theta, sut), problem.plays(theta, sut)
    both = sumo.executed & plays.executed
    return Agreement(
        name,
        system or "system under test",
        int((sumo.collision == plays.collision)[both].sum()),
        int(both.sum()),
    )
