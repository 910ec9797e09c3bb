"""Edge cases: failures that traffic may cause and a careful driver prevents, none of them much like another."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from generation.outcomes.outcomes import Episodes, Outcomes
from generation.outcomes.references import CAREFUL, Drivers, matrix, remembering, survivors
from generation.search.diversity import apart, distinctive, diverse
from generation.search.space import Space
from xodr.array_types import BoolArray, FloatArray, IntArray

COLLISION, VIOLATION = "collision", "violation of RSS distances"
AVOIDED, UNKNOWN = "avoids a collision", "unknown: the run failed"
Judged = Callable[[FloatArray], tuple[FloatArray, BoolArray]]
"""Log-densities (n,) of points (n, d), and which of them are foreseeable."""


_FARTHEST = 1e3
"""Clearances above this (m) are written as this"""


class Choice(NamedTuple):
    """Which episodes become files.

    Attributes:
        most: how many.
        apart: least distance of two in the unit cube, root mean square over the parameters that tell cases apart.
        violations: whether episodes that violate RSS distances without a failure are cases too, after the failures.
    """

    most: int = 100
    apart: float = 0.05
    violations: bool = False


@dataclass(frozen=True, eq=False)
class Cases:
    """Edge cases, one a row: failures first, the likelier first.

    Attributes:
        theta: parameters (n, d).
        outcomes, rewards: what came of them.
        log_likelihood: log-density (n,) at theta.
        drivers: what came of the reference drivers there, by their names (`generation.outcomes.references.REFERENCES`).
        agreed: verdicts of the judges that the twin shares, all of them, where it played the other drivers; 0 where all were run.
    """

    theta: FloatArray
    outcomes: Outcomes
    rewards: FloatArray
    log_likelihood: FloatArray
    drivers: Mapping[str, Outcomes]
    agreed: int = 0

    def __len__(self) -> int:
        return len(self.rewards)

    def take(self, rows: BoolArray | IntArray) -> Cases:
        """Some of them, by a mask (n,) or by indices."""
        drivers = {name: each.take(rows) for name, each in self.drivers.items()}
        return Cases(
            self.theta[rows], self.outcomes.take(rows), self.rewards[rows], self.log_likelihood[rows], drivers, self.agreed
        )

    @property
    def careful(self) -> Outcomes:
        """What came of the careful and competent driver of UN R157."""
        return self.drivers[CAREFUL]

    @property
    def avoidable(self) -> BoolArray:
        """The collisions (n,) that the careful driver is known to avoid."""
        return self.outcomes.collision & self.careful.survived

    def tags(self) -> dict[str, list[str] | list[float]]:
        """The values of each case, by the names of their tags."""
        outcomes = self.outcomes
        survived = {name: found.survived for name, found in self.drivers.items()}
        return {
            "Verdict": [COLLISION if collided else VIOLATION for collided in outcomes.collision],
            "CarefulDriver": np.select([self.careful.survived, self.careful.collision], [AVOIDED, COLLISION], UNKNOWN).tolist(),
            "SurvivedBy": [", ".join(name for name in survived if survived[name][row]) for row in range(len(self))],
            "Reward": _rounded(self.rewards),
            "LogLikelihood": _rounded(self.log_likelihood),
            "RRisk": _rounded(outcomes.r_risk),
            "Risk": _rounded(outcomes.risk),
            "ConflictTime": _rounded(outcomes.conflict),
            "Clearance": _rounded(np.minimum(outcomes.clearance, _FARTHEST)),
            "MaxDRAC": _rounded(outcomes.max_drac),
            "ImpactSpeed": _rounded(outcomes.impact_speed),
            "ImpactSide": outcomes.side.tolist(),
            "Striking": np.where(outcomes.striking, "ego", np.where(outcomes.side != "", "other", "")).tolist(),
        }


def choose(
    space: Space,
    episodes: Episodes,
    judged: Judged,
    drivers: Drivers,
    choice: Choice = Choice(),  # noqa: B008 - frozen
    found: FloatArray | None = None,
    twin: Drivers | None = None,
) -> Cases:
    """The foreseeable and preventable failures that are far enough from each other, the likelier first.

    Args:
        judged: says how likely points are, and which are foreseeable.
        drivers: runs scenarios with a system under test of a name.
        found: points (m, d) that the cases are to be far enough from as well.
        twin: plays reference drivers that are no judges, where it agrees with the judges' runs; None for none.
    """
    drivers = remembering(drivers)
    log_likelihood, foreseeable = judged(episodes.theta)
    executed, collision = episodes.outcomes.executed, episodes.outcomes.collision
    order = np.argsort(-log_likelihood, kind="stable")
    taken = _Taken(space, choice, found)
    taken.add(episodes.theta, order[(executed & collision & foreseeable)[order]], lambda rows: survivors(rows, drivers))
    if choice.violations:
        touched = executed & ~collision & foreseeable & (episodes.outcomes.risk > 0.0)
        taken.add(episodes.theta, order[touched[order]], lambda rows: np.ones(len(rows), bool))
    chosen = np.array(taken.rows, np.int64)
    theta = episodes.theta[chosen]
    references = matrix(theta, drivers, twin)
    outcomes = episodes.outcomes.take(chosen)
    return Cases(theta, outcomes, episodes.rewards[chosen], log_likelihood[chosen], *references)


class _Taken:
    """The rows that are cases so far."""

    def __init__(self, space: Space, choice: Choice, found: FloatArray | None) -> None:
        self.rows: list[int] = []
        self._space, self._choice, self._told = space, choice, distinctive(space)
        self._found = np.empty((0, len(space.parameters))) if found is None else found

    def add(self, theta: FloatArray, order: IntArray, counts: Callable[[FloatArray], BoolArray]) -> None:
        """Take rows in an order, those that count and are apart; no row is looked at that is near to one taken.

        Args:
            theta: all points (n, d). order: of the rows that may be taken.
            counts: which of some points (k, d) count; to be asked of as few as possible.
        """
        unit, found = (self._space.unit(rows)[:, self._told] for rows in (theta, self._found))
        order = order[apart(unit[order], np.concatenate([unit[self.rows], found]), self._choice.apart)]
        while order.size and len(self.rows) < self._choice.most:
            some = order[diverse(unit[order], self._choice.apart, self._choice.most - len(self.rows))]
            self.rows += some[counts(theta[some])].tolist()
            order = order[~np.isin(order, some)]
            order = order[apart(unit[order], unit[self.rows], self._choice.apart)]


def _rounded(values: FloatArray) -> list[float]:
    """Values to six decimal digits."""
    found: list[float] = np.round(values, 6).tolist()
    return found
