"""Judges of failures: reference drivers, the bound of full braking, and the edge cases that they decide."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from generation.outcomes.outcomes import Episodes, Outcomes, joined
from generation.search.space import Space, apart, distinctive, diverse
from generation.settings import Choice
from runner.sut.base import Control, Observation, Participant
from schemas.common.array_types import BoolArray, FloatArray, IntArray

_CHANGED = 1e-3
"""Change of a speed (m/s) or of a lateral position (m) above which a vehicle is active"""


@dataclass
class FullBraking:
    """Brakes fully from the first instant at which anyone changes speed or place in the lane, the ego itself included.

    It is no system that could be built: it knows that whatever begins will be dangerous. What it hits, braking does not avoid.

    Args:
        brake: deceleration, m/s².
    """

    brake: float = 9.0
    _before: dict[str, tuple[float, float]] = field(init=False, repr=False, default_factory=dict)
    _begun: bool = field(init=False, repr=False, default=False)

    def reset(self, ego: Participant, timestep: float, seed: int) -> None:
        """Forget the last run."""
        self._before, self._begun = {}, False

    def control(self, observation: Observation, dt: float) -> Control:
        """Nothing until the manoeuvre begins, then full braking."""
        now = {each.name: _state(observation, each) for each in (observation.ego, *observation.others)}
        self._begun = self._begun or any(
            _changed(self._before[name], state) for name, state in now.items() if name in self._before
        )
        self._before = now
        return Control(-self.brake, reason="the manoeuvre has begun") if self._begun else Control()


def _state(observation: Observation, who: Participant) -> tuple[float, float]:
    """Speed (m/s), and offset (m) from the middle of the lane; 0 off the roads."""
    network = observation.network
    return who.speed, network.locate(who.x, who.y, who.z).offset if network is not None else 0.0


def _changed(before: tuple[float, float], now: tuple[float, float]) -> bool:
    return any(abs(a - b) > _CHANGED for a, b in zip(before, now, strict=True))


CAREFUL = "r157-cc"
"""The careful and competent human driver of UN Regulation 157"""
JUDGES = (CAREFUL, "fsm")
"""A failure is preventable where one of these drivers survives the same case (METHOD.md §6)."""
FULL_BRAKING = "generation.outcomes.judges:FullBraking"
"""Full braking from the instant at which the manoeuvre begins: what this hits, no braking from then on avoids"""
NEVER_BRAKED = "nobody changes speed or lane before the contact, so that full braking never begins"
REFERENCES: Mapping[str, str] = {
    **{name: name for name in (*JUDGES, "aeb", "idm", "rss", "r157-reg")},
    "full braking": FULL_BRAKING,
}
"""Systems under test by the names that reports have for them: the columns of the matrix of reference drivers."""
Drivers = Callable[[FloatArray, str], Outcomes]
"""Outcomes of points (n, d), driven by the system under test of a name; `generation.outcomes.outcomes.Evaluator` is one."""


def survivors(theta: FloatArray, drivers: Drivers) -> BoolArray:
    """The points (n,) of (n, d) that one of the `JUDGES` survives; each is asked only where those before it have not."""
    found = np.zeros(len(theta), bool)
    for judge in JUDGES:
        left = np.flatnonzero(~found)
        if left.size:
            found[left] = drivers(theta[left], judge).survived
    return found


class Matrix(NamedTuple):
    """Outcomes of points with each of the reference drivers, by their names in reports.

    Attributes:
        drivers: outcomes by name.
        agreed: verdicts of the judges, all the same on the twin, on which the others were played; 0 where all were run.
    """

    drivers: Mapping[str, Outcomes]
    agreed: int = 0


def matrix(theta: FloatArray, drivers: Drivers, twin: Drivers | None = None) -> Matrix:
    """The matrix of points (n, d). The judges are run; the others are played on the twin, if it agrees with all verdicts of the
    judges, and run otherwise.

    Args:
        twin: plays points with the system of a name; None for none.
    """
    judged = {name: drivers(theta, REFERENCES[name]) for name in JUDGES}
    others = {name: sut for name, sut in REFERENCES.items() if name not in JUDGES}
    if twin is None or not len(theta) or not all(agrees(judged[name], twin(theta, REFERENCES[name])) for name in JUDGES):
        return Matrix(judged | {name: _driven(theta, sut, drivers) for name, sut in others.items()})
    return Matrix(judged | {name: _driven(theta, sut, twin) for name, sut in others.items()}, len(JUDGES) * len(theta))


def _driven(theta: FloatArray, sut: str, drivers: Drivers) -> Outcomes:
    """Outcomes of a driver; where full braking never begins, its collision says nothing of what braking can do, and counts as a
    run that failed: it is the same as that of what the scenario scripts alone."""
    found = drivers(theta, sut)
    rows = np.flatnonzero(found.executed & found.collision)
    if sut != FULL_BRAKING or not rows.size:
        return found
    hit, scripted = found.take(rows), drivers(theta[rows], "none")
    same = np.isclose(hit.conflict, scripted.conflict) & np.isclose(hit.impact_speed, scripted.impact_speed)
    never = np.zeros(len(theta), bool)
    never[rows] = scripted.executed & scripted.collision & same
    status, error = np.where(never, "error", found.status), np.where(never, NEVER_BRAKED, found.error)
    return replace(found, status=status, error=error, collision=found.collision & ~never)


def agrees(one: Outcomes, other: Outcomes) -> bool:
    """Whether all points were executed twice, with the same verdicts."""
    return bool(((one.collision == other.collision) & one.executed & other.executed).all())


def remembering(drivers: Drivers) -> Drivers:
    """The same drivers, which run no case twice with the same system."""
    known: dict[tuple[str, tuple[float, ...]], Outcomes] = {}

    def driving(theta: FloatArray, sut: str) -> Outcomes:
        keys = [(sut, tuple(row)) for row in theta.tolist()]
        missing = {key: row for row, key in enumerate(keys) if key not in known}
        if missing:
            found = drivers(theta[list(missing.values())], sut)
            known.update((key, found.take(np.array([place]))) for place, key in enumerate(missing))
        return joined([known[key] for key in keys]) if keys else Outcomes.of(0)

    return driving


COLLISION, VIOLATION = "collision", "violation of RSS distances"
AVOIDED, UNKNOWN = "avoids a collision", "unknown: the run failed"
Judged = Callable[[FloatArray], tuple[FloatArray, BoolArray]]
"""Log-densities (n,) of points (n, d), and which of them are foreseeable."""


_FARTHEST = 1e3
"""Clearances above this (m), and log-densities below its negative, are written as this"""


@dataclass(frozen=True, eq=False)
class Cases:
    """Edge cases, one a row: failures first, the likelier first.

    Attributes:
        theta: parameters (n, d).
        outcomes, rewards: what came of them.
        log_likelihood: log-density (n,) at theta.
        drivers: what came of the reference drivers there, by their names (`generation.outcomes.judges.REFERENCES`).
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
        """Outcomes with the careful and competent driver of UN R157."""
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
            "LogLikelihood": _rounded(np.maximum(self.log_likelihood, -_FARTHEST)),
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
