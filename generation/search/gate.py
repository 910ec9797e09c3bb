"""Unguided runs: the gate that a density has to pass before it judges what is foreseeable, and the
bound on unknown failures.

Recordings replayed with their own values say how often the scenario and the system under test
collide in traffic as it was. None of the recorded vehicles collided: a scenario in which careful
drivers collide too does not replay the recordings. A density whose draws collide far more often
than replays with the same system draws something else than traffic.

Draws of the density that no search has guided or learnt from bound the probability of failures
that the search has not found. Guided runs add nothing to that bound.

The operational domain has the conditions that a system is made for: failures outside of them are
not foreseeable.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.special import betaincinv

from generation.search.outcomes import R157, Drivers, Outcomes, survivors
from generation.space.density.roles import EGO, EGO_SPEED, Role
from schemas.common.array_types import BoolArray, FloatArray
from schemas.common.errors import UsageError, nearest
from schemas.common.terminal.text import many

if TYPE_CHECKING:
    from generation.space.space import Space
    from runner.judging.settings import RunSettings

CONFIDENCE = 0.95
UNFAITHFUL = 0.01
"""Share of colliding replays that is certainly exceeded where a scenario does not replay what was
recorded."""


TESTABLE = 0.05
"""Share of colliding draws that a gate with power refuses, where replays do not collide"""


class Share(NamedTuple):
    """Share of runs that collided."""

    collisions: int
    runs: int

    @classmethod
    def of(cls, outcomes: Outcomes) -> Share:
        """Count the runs that took place."""
        # A limit says nothing of a density: traffic itself may not keep it.
        return cls(int(outcomes.touching.sum()), int(outcomes.executed.sum()))

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval of the probability, exact: C. Clopper, E. Pearson,
        Biometrika 26, 1934.
        """
        # Exact, not normal: with no collision in n runs a normal interval would have no width.
        tail, others = (1.0 - CONFIDENCE) / 2.0, self.runs - self.collisions
        low = betaincinv(self.collisions, others + 1, tail) if self.collisions else 0.0
        high = betaincinv(self.collisions + 1, others, 1.0 - tail) if others else 1.0
        return float(low), float(high)

    def __str__(self) -> str:
        low, high = self.interval
        return f"{self.collisions} of {self.runs} ({low:.2%} to {high:.2%})"


class Statement(NamedTuple):
    """Upper bound on the probability of failures that a search has not found, from unguided draws
    of the density.

    The draws are independent of the search: a draw that fails unlike all that it found is a trial
    that hits an unknown failure. The bound is the one-sided one of Clopper and Pearson; with
    `outside` = 0 it is 1 − 0.05^(1/draws).

    Attributes:
        draws: number of draws that were executed.
        failing: number of draws that fail.
        outside: number of draws that fail at a distance of `NEAR` or more from each failure that
            the search found.
    """

    draws: int
    failing: int
    outside: int

    @classmethod
    def of(cls, outcomes: Outcomes, outside: BoolArray) -> Statement:
        """Count draws; `outside` (n,) marks points that are unlike all failures of the search."""
        failing = outcomes.executed & outcomes.collision
        return cls(int(outcomes.executed.sum()), int(failing.sum()), int((failing & outside).sum()))

    @property
    def unknown(self) -> float:
        """Probability that unknown failures stay below with 95 % confidence; 1 without draws."""
        return _upper(self.outside, self.draws)

    @property
    def total(self) -> float:
        """Probability that all failures together stay below with 95 %
        confidence; 1 without draws.
        """
        return _upper(self.failing, self.draws)

    def as_json(self) -> dict[str, float]:
        """Return counts and bounds as a JSON object, for files."""
        bounds = {"unknown_below": self.unknown, "all_below": self.total, "confidence": CONFIDENCE}
        return {**self._asdict(), "near": NEAR, **bounds}

    @property
    def in_arrays(self) -> str:
        """Sentence where the draws were played in arrays that agree with all runs."""
        return (
            f"{self.failing} of {many(self.draws, 'draw')} in arrays, which have the verdicts of "
            f"all these, fail, {self.outside} unlike all that the search found: by them it is "
            f"below {self.unknown:.2g}"
        )

    def __str__(self) -> str:
        if not self.draws:
            return (
                "no unguided draw was executed: nothing bounds the probability of failures that "
                "were not found"
            )
        near = (
            ""
            if not self.failing
            else f", {self.outside} of these unlike all that the search found"
        )
        bound = (
            "with 95 % confidence failures that were not found have a probability below "
            f"{self.unknown:.2g}"
        )
        return (
            f"{self.failing} of {many(self.draws, 'unguided draw')} fail{near}: {bound} under "
            "this density"
        )


NO_DRAWS = Statement(0, 0, 0)
NEAR = 0.1
"""Distance from a found failure, as a share of the ranges, within which a failure is known"""


def _upper(hits: int, trials: int) -> float:
    """One-sided upper limit of a binomial probability: C. Clopper, E. Pearson,
    Biometrika 26, 1934.
    """
    # Clopper and Pearson's upper limit is this quantile of a beta distribution.
    return float(betaincinv(hits + 1, trials - hits, CONFIDENCE)) if hits < trials else 1.0


class Gate(NamedTuple):
    """Test of a density.

    Attributes:
        replayed: recorded units with their own values; None where nothing is recorded.
        drawn: draws of the density.
        unprevented: replays in which the careful drivers collide too; None counts all that collide.
        played: whether they were played in arrays.
        unrecorded: searched parameters of which nothing is recorded, which is why there are no
            replays; none where that holds for all of them.
    """

    replayed: Share | None
    drawn: Share
    unprevented: Share | None = None
    played: bool = False
    unrecorded: tuple[str, ...] = ()

    @property
    def refusal(self) -> str | None:
        """Reason why the density is no judge of foreseeable points; None if it is one, or without
        replays to compare with."""
        if self.replayed is None:
            return None
        unfaithful = self.unprevented or self.replayed
        # First the scenario: if replays of traffic collide, it does not replay them, and no draw
        # says anything.
        if unfaithful.interval[0] > UNFAITHFUL:
            careful = " with each careful driver too" if self.unprevented is not None else ""
            return (
                f"{unfaithful} replays of recordings collide{careful}, where none of the "
                "recordings did"
            )
        # Intervals apart: the density collides more often than chance explains.
        if self.drawn.interval[0] > self.replayed.interval[1]:
            return (
                f"{self.drawn} of its draws collide, far more often than {self.replayed} replays "
                "of recordings"
            )
        return None

    @property
    def power(self) -> float:
        """Least share of colliding draws that so many replays and draws refuse; above 1 where they
        refuse none, and without replays."""
        if self.replayed is None or not self.drawn.runs:
            return math.inf
        # With few replays their interval is so wide that nothing would be refused.
        runs, most = self.drawn.runs, self.replayed.interval[1]
        collisions = np.arange(1, runs + 1)
        low = betaincinv(collisions, runs - collisions + 1, (1.0 - CONFIDENCE) / 2.0)
        refused = collisions[low > most]
        return float(refused[0]) / runs if refused.size else math.inf

    @property
    def testable(self) -> bool:
        """Whether replays and draws suffice to refuse a density that collides in `TESTABLE` of its
        draws."""
        return self.power <= TESTABLE

    def __str__(self) -> str:
        if self.replayed is None:
            of = f"of {' and '.join(self.unrecorded)} " if self.unrecorded else ""
            return (
                f"collisions in {self.drawn} draws of the density; {of}nothing is recorded "
                "that could be replayed"
            )
        where = ", in arrays: not the unguided ones, not run, no edge cases" if self.played else ""
        measured = (
            f"collisions in {self.replayed} replays of recordings, in {self.drawn} draws of the "
            f"density{where}"
        )
        if self.refusal is not None:
            return measured
        if self.testable:
            told = f"it would be refused if {self.power:.2%} of its draws collided"
            return f"{measured}: the density passes, {told}"
        return (
            f"{measured}: not testable, as so few would pass a density of which "
            f"{TESTABLE:.0%} collides"
        )


def replay_shares(units: FloatArray, outcomes: Outcomes, drivers: Drivers) -> tuple[Share, Share]:
    """Collisions of recorded rows (m, k) with outcomes, and those that no
    careful driver prevents.
    """
    colliding = np.flatnonzero(outcomes.touching)
    share = Share.of(outcomes)

    def touching(theta: FloatArray, sut: str) -> Outcomes:
        found = drivers(theta, sut)
        return replace(found, collision=found.touching)

    return share, Share(int((~survivors(units[colliding], touching)).sum()), share.runs)


ROAD = "road"
R157_SPEED = 130.0 / 3.6
"""Greatest speed (m/s) of an automated lane keeping system: UN Regulation 157 with its 01 series of
amendments"""
_FORM = f"{R157}, {ROAD} or NAME=LOW..HIGH is expected, as Ego_Speed_mps=0..36"


@dataclass(frozen=True)
class Domain:
    """Limits of parameters, searched or pinned.

    Attributes:
        limits: least and greatest value by the parameter's name.
    """

    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def __bool__(self) -> bool:
        return bool(self.limits)

    def holds(self, space: Space, theta: FloatArray) -> BoolArray:
        """Points (n, d) of a space that are within it: (n,)."""
        found, values = np.ones(len(theta), bool), space.by_name(theta)
        for name, (low, high) in self.limits.items():
            found &= (values[name] >= low) & (values[name] <= high)
        return found

    def __str__(self) -> str:
        told = (f"{name} {low:g} to {high:g}" for name, (low, high) in self.limits.items())
        return ", ".join(told) or "not limited"

    @classmethod
    def of(
        cls,
        texts: Sequence[str],
        scenario: Path,
        space: Space,
        roles: Mapping[str, Role],
        run: RunSettings,
    ) -> Domain:
        """The domain of texts: `r157`, the ego up to 130 km/h; `road`, the ego up to the greatest
        speed limit of the scenario's roads; or a parameter's range.

        Args:
            roles: of the scenario's parameters, which tell the ego's speed.

        Raises:
            UsageError: a text is of no form, a parameter is not known, roads have no limit, or a
                pinned value is outside.
            InvalidFile: a road network is malformed.
        """
        found: dict[str, tuple[float, float]] = {}
        values = space.by_name((space.low + space.high)[None] / 2)
        for text in texts:
            for name, (low, high) in _limits(text, scenario, roles, run).items():
                if name not in values:
                    raise UsageError(
                        f"--domain {text}: there is no number {name!r}; {nearest(name, values)}",
                        path=scenario,
                    )
                least, most = found.get(name, (low, high))
                # Limits of several texts hold together.
                found[name] = max(low, least), min(high, most)
                pinned = space.pinned.get(name)
                if pinned is not None and not low <= float(pinned) <= high:
                    raise UsageError(
                        f"--domain {text}: {name} is pinned at {pinned}, "
                        f"outside {low:g} to {high:g}",
                        path=scenario,
                    )
        return cls(found)


EVERYWHERE = Domain()
"""The domain without limits"""


def _limits(
    text: str, scenario: Path, roles: Mapping[str, Role], run: RunSettings
) -> dict[str, tuple[float, float]]:
    if text in (R157, ROAD):
        most = R157_SPEED if text == R157 else _speed_limit(scenario, run)
        speeds = {name: role for name, role in roles.items() if _is_ego_speed(role, roles)}
        if not speeds:
            raise UsageError(
                f"--domain {text}: no parameter is known as the ego's speed; "
                "NAME=LOW..HIGH limits one",
                path=scenario,
            )
        return {name: (0.0, most * role.factor) for name, role in speeds.items()}
    name, equals, limits = text.partition("=")
    low, dots, high = limits.partition("..")
    try:
        if not (name and equals and dots and float(low) < float(high)):
            raise ValueError
    except ValueError:
        raise UsageError(f"--domain {text!r}: {_FORM}") from None
    return {name: (float(low), float(high))}


def _is_ego_speed(role: Role, roles: Mapping[str, Role]) -> bool:
    """Whether it is the ego's speed: that of the vehicle that is not the actor, unless the ego acts
    itself."""
    # In a lane change of the ego the ego is the actor, and the role `ego_speed` is its leader's.
    acts = any(
        assigned.actor == EGO and assigned.role == "start_speed" for assigned in roles.values()
    )
    return (
        role.role in ("start_speed", "end_speed", "final_speed") and role.actor == EGO
        if acts
        else role.role == EGO_SPEED
    )


def _speed_limit(scenario: Path, run: RunSettings) -> float:
    """Greatest speed limit (m/s) of the scenario's roads."""
    from runner.engine.compile.road_network import load_roads
    from xosc.document import load
    from xosc.resolve import resolve

    resolved = resolve(load(scenario), catalog_path=run.catalog_path)
    network, _ = load_roads(resolved, run.road, run.road_path, run.strict)
    limits = (
        [record.speed for road in network.roads.values() for record in road.types if record.speed]
        if network
        else []
    )
    if not limits:
        raise UsageError("--domain road: its roads have no speed limit", path=scenario)
    return max(limits)
