"""Prior p(θ | c) of traffic given pinned values, fitted on recordings, and the limits of
foreseeable points (METHOD §6)."""

from __future__ import annotations

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property, wraps
from typing import Any, NamedTuple, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from generation.space.density.base import Components, Density, folds
from generation.space.density.models import cached, model
from generation.space.density.roles import BEHIND, EGO, EGO_SPEED, NUISANCES, Role
from recognition.labels.maneuvers.parameters import JERK
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from schemas.common.errors import UsageError

_Found = TypeVar("_Found")
_Work = Callable[[str, FloatArray, NDArray[Any]], _Found]


def _once(work: _Work[_Found]) -> _Work[_Found]:
    """Cache the model of the same rows, for the rounds of a loop and the tables of a report."""
    results: dict[Hashable, _Found] = {}

    @wraps(work)
    def remembering(name: str, theta: FloatArray, recordings: NDArray[Any]) -> _Found:
        key = name, theta.shape, _content(theta, recordings)
        if key not in results:
            results[key] = work(name, theta, recordings)
        return results[key]

    remembering.__dict__["cache_clear"] = results.clear  # as of `functools.cache`
    return remembering


def _content(theta: FloatArray, recordings: NDArray[Any]) -> bytes:
    return hashlib.blake2b(theta.tobytes() + repr(recordings.tolist()).encode()).digest()


@_once
def fitted(name: str, theta: FloatArray, recordings: NDArray[Any]) -> Density:
    """The model fitted on rows (n, d) of recordings (n,), the same object each time: not to be
    fitted anew."""
    key = b"all" + _content(theta, recordings)
    return cached(name, key, lambda: [model(name).fit(theta, recordings)])[0]


@_once
def held_out(name: str, theta: FloatArray, recordings: NDArray[Any]) -> FloatArray:
    """Log-density (n,) of each row (n, d) by the model fitted on a part of the other recordings
    (n,); read-only."""
    # A model that was fitted on a row finds it likelier than any new one: each is judged by others.
    densities = np.empty(len(theta))
    for density, tested in others(name, theta, recordings):
        densities[tested] = density.log_density(theta[tested])
    densities.flags.writeable = False
    return densities


@_once
def others(
    name: str, theta: FloatArray, recordings: NDArray[Any]
) -> list[tuple[Density, IntArray]]:
    """Models fitted on parts of the recordings, each with the rows of the others; every row is in
    one of them.

    What takes long to choose, as how many components a mixture has, is that of the model of all
    recordings (`Density.again`).
    """
    parts = list(folds(recordings))

    def fit() -> list[Density]:
        whole = fitted(name, theta, recordings)
        return [whole.again(len(rows)).fit(theta[rows], recordings[rows]) for rows, _ in parts]

    densities = cached(name, b"others" + _content(theta, recordings), fit)
    return list(zip(densities, (tested for _, tested in parts), strict=True))


FORESEEABLE = 0.01
"""Share of what is recorded (or, without recordings, stated) that is less likely than what counts
as foreseeable."""
_TRIES = 200
"""Times that draws are made before it is given up."""


class Prior(ABC):
    """A density of the parameters that a search chooses, under the condition of those that are
    pinned.

    Columns are those of a space, in its order. Some may be nuisances: when a scene begins and ends.
    They are no part of the density, a search is not rewarded for them, and cases that differ in
    nothing else are the same. They are drawn with the others (`sample`, `with_nuisances`), or
    pinned.

    Attributes:
        names: of the columns (d,).
        low, high: the box (d,): what the scenario declares.
        nuisances: names of the columns that are nuisances.
        theta: recorded rows (m, d) inside the box; none without recordings.
        recordings: of each of these (m,).
        domain: rows (n, d) that are within the operational domain; None where that is not limited.
    """

    names: tuple[str, ...]
    low: FloatArray
    high: FloatArray
    nuisances: tuple[str, ...] = ()
    theta: FloatArray
    recordings: NDArray[np.str_]
    domain: Callable[[FloatArray], BoolArray] | None = None

    @property
    def searched(self) -> tuple[str, ...]:
        """Names of the columns that are no nuisances."""
        return tuple(name for name in self.names if name not in self.nuisances)

    def columns(self, names: Sequence[str]) -> list[int]:
        """Indices of columns."""
        return [self.names.index(name) for name in names]

    def inside(self, theta: FloatArray) -> BoolArray:
        """Rows (n, d) that are in the box: (n,)."""
        return np.all((theta >= self.low) & (theta <= self.high), axis=1)

    @abstractmethod
    def possible(self, theta: FloatArray) -> BoolArray:
        """Rows (n, d) that are in the box and within the physical limits: (n,)."""

    @abstractmethod
    def log_density(self, theta: FloatArray) -> FloatArray:
        """log p(searched | pinned) of rows (n, d), in the parameters' units: (n,); −∞ where they
        are not `possible`.

        Normalised over what is possible. The weights p/q of importance sampling are ratios of these
        where both draw nuisances alike.
        """

    @abstractmethod
    def _draw(self, n: int, generator: np.random.Generator) -> FloatArray:
        """Draws (n, d); some may not be `possible`."""

    def sample(self, n: int, generator: np.random.Generator) -> FloatArray:
        """Draws (n, d), all `possible`: impossible ones are drawn again, none is moved onto a
        limit.

        Raises:
            UsageError: nearly nothing that it draws is possible.
        """
        # Moving draws onto the limit would pile them up there.
        return until_possible(self._draw, self.possible, n, generator)

    def foreseeable(self, theta: FloatArray) -> BoolArray:
        """Rows (n, d) within the operational domain that traffic does: possible, no less likely
        than 99 % of recorded units, each by the density of other recordings, and no further from a
        recorded unit than 99 % of them: (n,). Costs no simulation."""
        likely = self._foreseeable(np.asarray(theta, np.float64))
        return likely if self.domain is None else likely & self.domain(theta)

    @abstractmethod
    def _foreseeable(self, theta: FloatArray) -> BoolArray:
        """`foreseeable` in any domain."""

    def within(self, domain: Callable[[FloatArray], BoolArray] | None) -> Self:
        """The same prior with an operational domain."""
        limited = copy(self)
        limited.domain = domain
        return limited

    def judged(self, theta: FloatArray) -> tuple[FloatArray, BoolArray]:
        """`log_density` and `foreseeable` of rows (n, d)."""
        return self.log_density(theta), self.foreseeable(theta)

    def unjudged(self, theta: FloatArray) -> tuple[FloatArray, BoolArray]:
        """`log_density` of rows (n, d), and none of them foreseeable: for a density that does not
        pass the gate."""
        return self.log_density(theta), np.zeros(len(theta), bool)

    @abstractmethod
    def with_nuisances(self, theta: FloatArray) -> FloatArray:
        """Rows (n, d) with the nuisances of the recorded unit that is most like each of them."""

    def chosen(self, theta: FloatArray) -> FloatArray:
        """Rows (n, d) with each discrete parameter at the choice nearest to its value."""
        return theta

    def spread(self, theta: FloatArray, generator: np.random.Generator) -> FloatArray:
        """Rows (n, d) with each discrete parameter anywhere nearest to its choice, as `log_density`
        takes it to be."""
        return theta

    def log_ratios(self, theta: FloatArray, n: int, generator: np.random.Generator) -> FloatArray:
        """log p'/p of possible rows (m, d) for densities p' of resampled recordings: (n, m); (0, m)
        without recordings."""
        return np.empty((0, len(theta)))


def until_possible(
    draw: Callable[[int, np.random.Generator], FloatArray],
    possible: Callable[[FloatArray], BoolArray],
    n: int,
    generator: np.random.Generator,
) -> FloatArray:
    """Draw until n possible rows (n, d) are found.

    Raises:
        UsageError: nearly no draw is possible.
    """
    parts: list[FloatArray] = []
    for _ in range(_TRIES):
        # Blocks of 64 at least, so that small n does not end in `_TRIES` draws of a single row
        # each.
        drawn = draw(max(n, 64), generator)
        parts.append(drawn[possible(drawn)])
        if sum(map(len, parts)) >= n:
            return np.concatenate(parts)[:n]
    raise UsageError("nearly nothing that the density draws is inside the limits of the parameters")


_COUNTED = 20_000
"""Draws that say which share of the density is possible."""
_RESAMPLED = 5
"""Fewest recordings that are resampled"""


@dataclass(frozen=True)
class Box:
    """Names, least and greatest values of searched parameters, and values of pinned ones."""

    names: tuple[str, ...]
    low: FloatArray
    high: FloatArray
    pinned: Mapping[str, float]


class RecordedPrior(Prior):
    """See the module.

    Args:
        box: of the space.
        values: recorded values (m,) by parameter, of searched and of pinned ones.
        recordings: of each value (m,).
        roles: of these parameters.
        name: of the density (`generation.space.density.models`).

    Attributes:
        left_out: number of units without a logarithm, those of followers below the least gap
            included.

    Raises:
        UsageError: there is no such density, it can't be conditioned, or the units make none.
    """

    def __init__(
        self,
        box: Box,
        values: Mapping[str, FloatArray],
        recordings: NDArray[np.str_],
        roles: Mapping[str, Role],
        name: str,
    ) -> None:
        self.names, self.low, self.high, self._roles = box.names, box.low, box.high, dict(roles)
        self.nuisances = tuple(name for name in box.names if roles[name].role in NUISANCES)
        self._pinned = {name: value for name, value in box.pinned.items() if name in values}
        self._given = [name for name in self._pinned if roles[name].role not in NUISANCES]
        held = [*self.searched, *self._given]
        self._least_gap = LeastGap.of(values, roles)
        rows = np.stack([values[name] for name in held], axis=1)
        # Gaps of followers are modelled beyond the least gap, which grows with the speed: the
        # logarithm then keeps draws above it.
        rows[:, : len(self.searched)] -= self._least(values)
        # The density is one of logarithms: rows without one are left out and counted.
        usable = (rows > 0.0).all(axis=1)
        self.left_out = int((~usable).sum())
        self._log_rows, self._recordings, self._model = (
            np.log(rows[usable]),
            recordings[usable],
            name,
        )
        everything = np.stack([values[name] for name in box.names], axis=1)[usable]
        inside = self.inside(everything)
        self.theta, self.recordings = everything[inside], self._recordings[inside]
        self._limits = {
            actor: Limits.of(by_role) for actor, by_role in self._by_actor(values).items()
        }

    # physics

    def _by_actor(self, values: Mapping[str, FloatArray]) -> dict[str, ByRole]:
        """Values in SI units by role, for each actor."""
        actors: dict[str, dict[str, FloatArray]] = {}
        for name, (actor, role, factor) in self._roles.items():
            if name in values:
                actors.setdefault(actor, {})[role] = values[name] / factor
        return dict(actors)

    def possible(self, theta: FloatArray) -> BoolArray:
        """Rows (n, d) that are in the box and within the physical limits: (n,)."""
        values = self._by_name(theta)
        # Accelerations belong to an actor: its own speeds and times only.
        kept = [
            self._limits[actor].kept(by_role) for actor, by_role in self._by_actor(values).items()
        ]
        if self._least_gap is not None:
            kept.append(values[self._least_gap.gap] > self._least_gap.at(values))
        return np.all([self.inside(theta), *kept], axis=0)

    # density

    @cached_property
    def _density(self) -> Density | Components:
        """Density of the logarithms of searched parameters, given the pinned values."""
        whole = fitted(self._model, self._log_rows, self._recordings)
        return self._conditioned(whole) if self._given else whole

    def _conditioned(self, whole: Density) -> Components:
        values = np.array([self._pinned[name] for name in self._given])
        if not (values > 0.0).all():
            name = self._given[int(np.flatnonzero(values <= 0.0)[0])]
            raise UsageError(
                f"{name} is pinned at {self._pinned[name]:g}, where recordings have no density"
            )
        # Pinned values condition the density; cutting it at them would ignore how parameters depend
        # on each other.
        return _gaussians(whole, self._model).given(self._given_columns, np.log(values))

    @property
    def _given_columns(self) -> list[int]:
        return list(range(len(self.searched), len(self.searched) + len(self._given)))

    def _by_name(self, theta: FloatArray) -> dict[str, FloatArray]:
        """Values (n,) of searched and pinned parameters, by name."""
        pinned = {name: np.full(len(theta), value) for name, value in self._pinned.items()}
        return pinned | dict(zip(self.names, theta.T, strict=True))

    def _least(self, values: Mapping[str, FloatArray]) -> FloatArray:
        """Return the offset (n, k) subtracted before the logarithm."""
        offsets = np.zeros((len(next(iter(values.values()))), len(self.searched)))
        if self._least_gap is not None and self._least_gap.gap in self.searched:
            offsets[:, self.searched.index(self._least_gap.gap)] = self._least_gap.at(values)
        return offsets

    def _logs(self, theta: FloatArray) -> FloatArray:
        """Logarithms of searched parameters."""
        beyond = theta[:, self.columns(self.searched)] - self._least(self._by_name(theta))
        return np.log(np.maximum(beyond, np.finfo(float).tiny))

    def _raw(self, theta: FloatArray) -> FloatArray:
        """log p over all positive values, possible or not (n,)."""
        logs = self._logs(theta)
        # Change of variables: p(θ) = p(log θ) / θ, so minus the sum of the logs.
        return self._density.log_density(logs) - logs.sum(axis=1)

    @cached_property
    def _log_share(self) -> float:
        """log of the share of the density that is possible."""
        drawn = self._draw(_COUNTED, np.random.default_rng(0))
        share = float(self.possible(drawn).mean())
        if not share:
            raise UsageError(
                "the density of recordings has nothing inside the limits of the parameters"
            )
        return float(np.log(share))

    def log_density(self, theta: FloatArray) -> FloatArray:
        """log p(searched | pinned) of rows (n, d): (n,)."""
        theta = np.asarray(theta, np.float64)
        densities = np.full(len(theta), -np.inf)
        possible = self.possible(theta)
        if possible.any():
            densities[possible] = self._raw(theta[possible]) - self._log_share
        return densities

    def _draw(self, n: int, generator: np.random.Generator) -> FloatArray:
        return self.of_logs(self._density.sample(n, generator))

    def of_logs(self, logs: FloatArray) -> FloatArray:
        """Rows (n, d), possible or not, from logarithms (n, k) of searched parameters, with
        recorded nuisances."""
        theta = np.empty((len(logs), len(self.names)))
        columns = self.columns(self.searched)
        theta[:, columns] = np.exp(logs)
        # Undoes what was subtracted before the logarithm in `__init__`.
        theta[:, columns] += self._least(self._by_name(theta))  # of what is not shifted itself
        return self.with_nuisances(theta)

    @property
    def gaussians(self) -> Components:
        """The density of the logarithms, possible or not.

        Raises:
            UsageError: it is no sum of Gaussians.
        """
        return (
            self._density
            if isinstance(self._density, Components)
            else _gaussians(self._density, self._model)
        )

    # what is foreseeable

    @cached_property
    def held_out(self) -> FloatArray:
        """log p(searched | pinned) of each recorded unit (m,) by the density of other recordings,
        given its own values of what is pinned; over all that is positive."""
        densities = np.empty(len(self._log_rows))
        for other, tested in others(self._model, self._log_rows, self._recordings):
            densities[tested] = other.log_density(self._log_rows[tested])
            if self._given:
                given = _gaussians(other, self._model).marginal(self._given_columns)
                # p(searched | pinned) = p(searched, pinned) / p(pinned).
                densities[tested] -= given.log_density(
                    self._log_rows[tested][:, self._given_columns]
                )
        return densities - self._log_rows[:, : len(self.searched)].sum(axis=1)

    @cached_property
    def limit(self) -> float:
        """log p that all but 1 % of the recorded units reach."""
        return float(np.quantile(self.held_out, FORESEEABLE))

    @property
    def possible_share(self) -> float:
        """Share of the density's draws that are inside the box and the physical limits."""
        return float(np.exp(self._log_share))

    def _foreseeable(self, theta: FloatArray) -> BoolArray:
        likely = self.possible(theta)
        if likely.any():
            # The density alone would allow a gap between two clusters; the distance alone, a rare
            # corner.
            likely[likely] = (self._raw(theta[likely]) >= self.limit) & self._recorded_like(
                theta[likely]
            )
        return likely

    @cached_property
    def _standard(self) -> FloatArray:
        """Standardised logarithms of the searched parameters of all recorded units (m, k)."""
        standard: FloatArray = self._log_rows[:, : len(self.searched)] / self._spread
        return standard

    @cached_property
    def farthest(self) -> float:
        """Distance to the nearest unit of other recordings, in standardised logarithms, that 99 %
        of units keep within."""
        from scipy.spatial import KDTree

        # By recordings, as `held_out`: units of one recording are nearer to each other than traffic
        # is.
        distances = np.empty(len(self._standard))
        for rest, tested in folds(self._recordings):
            distances[tested] = KDTree(self._standard[rest]).query(self._standard[tested])[0]
        return float(np.quantile(distances, 1.0 - FORESEEABLE))

    @cached_property
    def _nearest(self) -> Any:
        """KDTree of all recorded units: a search asks for it in every round."""
        from scipy.spatial import KDTree

        return KDTree(self._standard)

    def _recorded_like(self, theta: FloatArray) -> BoolArray:
        """Rows (n, d) that are no further from recorded units than these are from those of other
        recordings: (n,)."""
        return np.asarray(self._nearest.query(self._logs(theta) / self._spread)[0] <= self.farthest)

    # uncertainty

    def log_ratios(self, theta: FloatArray, n: int, generator: np.random.Generator) -> FloatArray:
        """log p'/p of possible rows (m, d) for densities p' of resampled recordings: (n, m).

        Recordings are drawn with replacement, as units of one recording are alike. What takes long
        to choose is that of p.
        """
        names = np.unique(self._recordings)
        # A bootstrap over fewer recordings says more about these than about traffic.
        if len(names) < _RESAMPLED:
            return np.empty((0, len(theta)))
        whole, logs = fitted(self._model, self._log_rows, self._recordings), self._logs(theta)
        rows_of = {name: np.flatnonzero(self._recordings == name) for name in names}
        ratios, present = (
            np.empty((n, len(theta))),
            self._density.log_density(logs) - self._log_share,
        )
        for number in range(n):
            rows = np.concatenate([rows_of[name] for name in generator.choice(names, len(names))])
            other: Density | Components = whole.again(len(rows)).fit(
                self._log_rows[rows], self._recordings[rows]
            )
            if self._given and isinstance(other, Density):
                other = self._conditioned(other)
            # Each resampled density has its own share of what is possible: without it ratios would
            # be biased.
            share = self.possible(self.of_logs(other.sample(_COUNTED // 10, generator))).mean()
            ratios[number] = other.log_density(logs) - np.log(max(float(share), 1e-9)) - present
        return ratios

    # nuisances

    @cached_property
    def _donors(self) -> tuple[FloatArray, FloatArray]:
        """Standardised logarithms of recorded rows, and these rows."""
        if not len(self.theta):
            raise UsageError("no recorded manoeuvre is inside the limits of its parameters")
        return self._logs(self.theta) / self._spread, self.theta

    @cached_property
    def _spread(self) -> FloatArray:
        # A parameter that is the same in all units has no spread to divide by.
        return np.maximum(self._log_rows[:, : len(self.searched)].std(axis=0), np.finfo(float).eps)

    def with_nuisances(self, theta: FloatArray) -> FloatArray:
        """Rows (n, d) with the nuisances of the recorded unit that is most like each of them."""
        from scipy.spatial import cKDTree

        if not self.nuisances:
            return theta
        standard, donors = self._donors
        columns, drawn = self.columns(self.nuisances), theta.copy()
        # As a whole, from one unit: start and rest time depend on each other.
        nearest = cKDTree(standard).query(self._logs(theta) / self._spread)[1]
        drawn[:, columns] = donors[nearest][:, columns]
        return drawn


def _gaussians(density: Density, name: str) -> Components:
    gaussians = density.gaussians
    if gaussians is None:
        raise UsageError(
            f"the density {name} can't be conditioned on pinned values; kde, "
            "mixture and gaussian can"
        )
    return gaussians


QUANTILE = 0.999
"""Share of the recorded units that keep within a limit, of each quantity."""
LANE = 3.5
"""Width (m) that the lateral acceleration of lane changes is worked out for"""
_BRIEF = 1.0
"""Rest times (s) that are shorter say nothing of an acceleration: differences of speeds are as
large as their errors"""

ByRole = Mapping[str, FloatArray]
"""Values (n,) by the names of their roles, in SI units; roles that are not known are missing."""


def quantities(values: ByRole) -> dict[str, FloatArray]:
    """Return deceleration, acceleration, jerk and lateral acceleration (n,), without any that the
    known roles leave open.

    m/s², jerk m/s³: the change from the mean acceleration of the manoeuvre to that of what follows,
    over the time between their middles; the jerk at the onset is a parameter of its own. 0 where
    nothing can be said.
    """
    amounts: dict[str, FloatArray] = {"jerk at the onset": values[JERK]} if JERK in values else {}
    duration = values.get("duration")
    phases = []
    if duration is not None:
        # Greatest second derivative of a sinusoidal change over the width of a lane
        # (`dynamics.SHAPES`).
        amounts["lateral acceleration"] = 0.5 * np.pi**2 * LANE / np.square(duration)
        if {"start_speed", "end_speed"} <= values.keys():
            phases.append((values["end_speed"] - values["start_speed"]) / duration)
    if {"end_speed", "final_speed", "rest_time"} <= values.keys():
        rest = values["rest_time"]
        phases.append(
            np.where(
                rest >= _BRIEF,
                (values["final_speed"] - values["end_speed"]) / np.maximum(rest, _BRIEF),
                0.0,
            )
        )
        # Between both changes of speed; with one known there is no change of acceleration.
        if duration is not None and len(phases) == 2:
            amounts["jerk"] = np.where(
                rest >= _BRIEF, np.abs(phases[1] - phases[0]) / (0.5 * (duration + rest)), 0.0
            )
    if phases:
        amounts["deceleration"] = np.max([-phase for phase in phases], axis=0)
        amounts["acceleration"] = np.max(phases, axis=0)
    return amounts


@dataclass(frozen=True)
class LeastGap:
    """The gap that a follower keeps at least, which grows with the speed.

    Attributes:
        gap, speed: names of the two parameters.
        headway: gap by speed that all but 0.1 % of recorded followers keep.
    """

    gap: str
    speed: str
    headway: float

    @classmethod
    def of(cls, values: Mapping[str, FloatArray], roles: Mapping[str, Role]) -> LeastGap | None:
        """Fit to recorded values (n,) by parameter; None without a follower."""
        names = {role.role: name for name, role in roles.items() if name in values}
        if not {BEHIND, EGO_SPEED} <= names.keys():
            return None
        gap, speed = names[BEHIND], names[EGO_SPEED]
        # A headway at standstill is infinite.
        moving = values[speed] > 0.0
        if not moving.any():
            return None
        # A quantile, not the least one: a single faulty recorded gap must not set the limit for
        # all.
        return cls(
            gap,
            speed,
            float(np.quantile(values[gap][moving] / values[speed][moving], 1.0 - QUANTILE)),
        )

    def at(self, values: Mapping[str, FloatArray]) -> FloatArray:
        """The least gap (n,)."""
        return self.headway * values[self.speed]


@dataclass(frozen=True)
class Limits:
    """Greatest values of `quantities`.

    Attributes:
        most: by the name of the quantity.
    """

    most: Mapping[str, float]

    @classmethod
    def of(cls, values: ByRole) -> Limits:
        """Return the limits that all but 0.1 % of recorded units keep."""
        return cls(
            {
                name: float(np.quantile(amounts, QUANTILE))
                for name, amounts in quantities(values).items()
            }
        )

    def kept(self, values: ByRole) -> BoolArray:
        """Whether each is within them (n,)."""
        amounts = quantities(values)
        n = len(next(iter(values.values()), np.zeros(0)))
        # Of a space that lacks a role some quantities can't be said: these limit nothing.
        within = [amounts[name] <= most for name, most in self.most.items() if name in amounts]
        return np.all(within, axis=0) if within else np.ones(n, bool)


LEAST = 0.1
"""Least duration (s) and speed (m/s) to divide by"""


class Reading(NamedTuple):
    """Values (n,) in SI units; None where a role that they take is not known.

    Attributes:
        closing: how much faster the one behind is than the one ahead, m/s. headway: time headway of
            the one behind, s.
        ego: speed of the vehicle that is not the actor, m/s.
    """

    closing: FloatArray | None
    headway: FloatArray | None
    ego: FloatArray | None


def by_actor(
    values: Mapping[str, FloatArray], roles: Mapping[str, Role]
) -> dict[str, dict[str, FloatArray]]:
    """Values (n,) in SI units by role for each actor, with the speed of the vehicle that is not an
    actor in all of them.

    Args:
        values: by parameter. roles: of parameters; those without values are left out.
    """
    actors: dict[str, dict[str, FloatArray]] = {}
    shared: dict[str, FloatArray] = {}
    for name, (actor, role, factor) in roles.items():
        if name in values:
            (shared if role == EGO_SPEED else actors.setdefault(actor, {}))[role] = (
                values[name] / factor
            )
    # Without an actor the ego's own speed is all there is.
    return {actor: of | shared for actor, of in actors.items()} or {"": shared}


def reading(of: Mapping[str, FloatArray], actor: str) -> Reading:
    """Read off one actor's values (n,) by role; the one behind is the ego, or the actor where that
    is the ego."""
    start, other, gap = (of.get(role) for role in ("start_speed", EGO_SPEED, "gap"))
    behind, ahead = (start, other) if actor == EGO else (other, start)
    closing = None if behind is None or ahead is None else behind - ahead
    headway = None if behind is None or gap is None else gap / np.maximum(behind, LEAST)
    return Reading(closing, headway, other)
