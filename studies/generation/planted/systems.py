"""Systems with planted failures, made by seed: regions of foreseeable manoeuvres in which a driver sleeps.

The undriven run, in arrays or on SUMO, says what happens there: a point fails if it
lies in a region and collides undriven. Outside its regions the driver is perfect, or any system
under test. With a gradient it gets worse near a region; without one nothing announces a failure.

The development generator plants boxes, ellipsoids, slabs, shells at the edge of the foreseeable,
interactions of two parameters, and sleep at certain times of the scene. The reported one plants
corners, curved bands, hollow shells, cones, tails beyond a plane, and sleep that depends on how
long a danger has lasted.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from generation.search.methods.cover import Frame
from generation.search.outcomes import Outcomes, joined
from generation.search.problem import Plays
from generation.space.density.prior import Prior
from generation.space.space import Space
from schemas.common.array_types import BoolArray, FloatArray, IntArray

Score = Callable[[FloatArray, Outcomes], FloatArray]
"""Distance (n,) of points (n, d), with their undriven outcomes, from the middle of a region, in a measure of its shape"""
UNDRIVEN, PERFECT = "none", "perfect"
"""System under test that never acts, and the base that survives everything"""
_CLEAR, _BRAKES = 1.0, 4.0
"""Clearance (m) that the perfect driver keeps at least, and its greatest deceleration (m/s²)"""
_WORSE = 4.0
"""Deceleration (m/s²) by which it is worse at the border of a region, with a gradient"""
_RARE = 0.2
"""Share of the draws that counts as the edge of the foreseeable"""


_KEPT = "collision", "conflict", "r_risk"
"""Undriven outcomes that regions are made of"""


class Pool(NamedTuple):
    """Draws of the density: points (n, d), and their undriven outcomes as far as regions are made of them."""

    theta: FloatArray
    undriven: Outcomes

    @classmethod
    def of(cls, prior: Prior, plays: Plays, n: int, path: Path) -> Pool:
        """Draw and play, or read what was kept at a path."""
        if not path.exists():
            theta = prior.sample(n, np.random.default_rng(20_000))
            found = plays(theta, UNDRIVEN)
            collided = found.collision & found.executed
            path.parent.mkdir(parents=True, exist_ok=True)
            np.savez_compressed(
                path, theta=theta, collision=collided, conflict=found.conflict, r_risk=found.r_risk
            )
        with np.load(path, allow_pickle=False) as kept:
            theta = kept["theta"]
            return cls(theta, Outcomes.of(len(theta), **{name: kept[name] for name in _KEPT}))

    @property
    def hits(self) -> IntArray:
        """Indices of the draws whose undriven run collides."""
        return np.flatnonzero(self.undriven.collision)


@dataclass(frozen=True, eq=False)
class Region:
    """A planted region.

    Attributes:
        shape: name in `SHAPES`.
        score: distance from its middle. level: score at its border. reach: score at which nothing
            announces it any more.
    """

    shape: str
    score: Score
    level: float
    reach: float

    def holds(self, theta: FloatArray, undriven: Outcomes) -> BoolArray:
        """Points (n, d) with undriven outcomes that lie in it: (n,)."""
        return self.score(theta, undriven) <= self.level

    def nearness(self, theta: FloatArray, undriven: Outcomes) -> FloatArray:
        """1 at the border, less outside, 0 from `reach` on (n,)."""
        return np.clip(
            (self.reach - self.score(theta, undriven)) / (self.reach - self.level), 0.0, 1.0
        )


@dataclass(frozen=True)
class Plan:
    """Plan of a planted failure.

    Attributes:
        shape: of the regions, a name in `SHAPES`. number: of regions.
        probability: of a failure under the density, all regions together.
        gradient: whether the system gets worse before it fails.
        base: driver outside the regions, a system under test; `PERFECT` survives everything.
    """

    shape: str
    number: int
    probability: float
    gradient: bool
    base: str = PERFECT

    def __str__(self) -> str:
        several = "regions" if self.number > 1 else "region"
        base = "" if self.base == PERFECT else f", {self.base}"
        return f"{self.number} {several}, {self.shape}, {self.probability:g}, {'gradient' if self.gradient else 'no gradient'}{base}"


@dataclass(frozen=True, eq=False)
class Planted:
    """A system with planted failures; evaluates points of its space."""

    plan: Plan
    regions: Sequence[Region]
    plays: Plays

    def __call__(self, theta: FloatArray) -> Outcomes:
        """The outcomes at points (n, d)."""
        undriven = self.plays(theta, UNDRIVEN)
        held = self.within(theta, undriven)
        driven = (
            self._perfect(undriven)
            if self.plan.base == PERFECT
            else self.plays(theta, self.plan.base)
        )
        near = np.max([each.nearness(theta, undriven) for each in self.regions], axis=0)
        worse = np.where(undriven.collision & self.plan.gradient, near, 0.0)
        worsened = replace(
            driven,
            r_risk=np.maximum(driven.r_risk, worse * undriven.r_risk),
            clearance=driven.clearance * (1.0 - worse),
            max_drac=driven.max_drac + _WORSE * worse,
        )
        return joined([worsened, undriven]).take(
            np.arange(len(theta)) + len(theta) * (undriven.collision & held.any(axis=0))
        )

    @staticmethod
    def _perfect(undriven: Outcomes) -> Outcomes:
        """Outcomes of the driver that survives everything."""
        return replace(
            undriven,
            collision=np.zeros(len(undriven), bool),
            r_risk=np.zeros(len(undriven)),
            clearance=np.maximum(undriven.clearance, _CLEAR),
            max_drac=np.minimum(undriven.max_drac, _BRAKES),
            impact_speed=np.zeros(len(undriven)),
        )

    def within(self, theta: FloatArray, undriven: Outcomes) -> BoolArray:
        """Points (n, d), with undriven outcomes, that lie in each region (k, n)."""
        return np.array([each.holds(theta, undriven) for each in self.regions])


class Place(NamedTuple):
    """Place of a region: its middle as a point (1, d) with its undriven outcome, drawn columns of coordinates, scales (k,) of all
    coordinates, and a drawn number from 0.5 to 1 for shapes that need one."""

    frame: Frame
    space: Space
    prior: Prior
    middle: FloatArray
    undriven: Outcomes
    columns: IntArray
    scales: FloatArray
    drawn: float

    def off(self, theta: FloatArray) -> FloatArray:
        """Scaled differences (n, k) from the middle, in whitened coordinates."""
        return (self.frame.coordinates(theta) - self.frame.coordinates(self.middle)) / self.scales


def _box(place: Place) -> Score:
    return lambda theta, _: np.abs(place.off(theta)[:, place.columns]).max(axis=1)


def _ellipsoid(place: Place) -> Score:
    return lambda theta, _: np.sqrt(np.square(place.off(theta)[:, place.columns]).mean(axis=1))


def _slab(place: Place) -> Score:
    """Between two parallel planes: a sum of differences in some parameters."""
    return lambda theta, _: np.abs(place.off(theta)[:, place.columns].sum(axis=1))


def _shell(place: Place) -> Score:
    """A part of the rarest draws."""
    limit = float(
        np.quantile(
            place.prior.log_density(place.prior.sample(2000, np.random.default_rng(0))), _RARE
        )
    )

    def score(theta: FloatArray, undriven: Outcomes) -> FloatArray:
        return np.where(
            place.prior.log_density(theta) <= limit, _ellipsoid(place)(theta, undriven), _FAR
        )

    return score


def _interaction(place: Place) -> Score:
    """A product of two parameters in a band: neither of them alone says anything."""
    one, other = place.columns[:2]

    def product(theta: FloatArray) -> FloatArray:
        z = place.frame.coordinates(theta) + 3.0  # positive for nearly all draws
        found: FloatArray = z[:, one] * z[:, other]
        return found

    middle = product(place.middle)
    return lambda theta, _: np.abs(product(theta) - middle)


def _timing(place: Place) -> Score:
    """Sleep during some time of the scene, for part of the manoeuvres."""
    column = [
        number for number, name in enumerate(place.space.names) if name in place.prior.nuisances
    ][:1]
    scale = max(float(np.ptp(place.prior.sample(200, np.random.default_rng(0))[:, column])), 1e-9)

    def score(theta: FloatArray, _: Outcomes) -> FloatArray:
        late = np.abs(theta[:, column] - place.middle[:, column])[:, 0] / (0.1 * scale)
        return np.maximum(late, np.abs(place.off(theta)[:, place.columns[0]]))

    return score


def _corner(place: Place) -> Score:
    """All parameters of some beyond a value, away from the density's middle."""
    away = np.where(place.frame.coordinates(place.middle)[0, place.columns] >= 0.0, 1.0, -1.0)
    return lambda theta, _: np.max(-away * place.off(theta)[:, place.columns], axis=1)


def _ridge(place: Place) -> Score:
    """A curved band in two parameters."""
    one, other = place.columns[:2]

    def score(theta: FloatArray, _: Outcomes) -> FloatArray:
        off = place.off(theta)
        found: FloatArray = np.abs(off[:, one] - place.drawn * np.square(off[:, other]))
        return found

    return score


def _ring(place: Place) -> Score:
    """Between two ellipsoids."""
    return lambda theta, _: np.abs(
        np.sqrt(np.square(place.off(theta)[:, place.columns]).mean(axis=1)) - place.drawn
    )


def _cone(place: Place) -> Score:
    """About a direction from the density's middle: from the likely outwards."""
    middle = place.frame.coordinates(place.middle)[0] / place.scales
    away = middle / np.linalg.norm(middle)

    def score(theta: FloatArray, _: Outcomes) -> FloatArray:
        rows = place.frame.coordinates(theta) / place.scales
        found: FloatArray = 1.0 - rows @ away / np.maximum(np.linalg.norm(rows, axis=1), 1e-9)
        return found

    return score


def _tail(place: Place) -> Score:
    """Beyond a plane, away from the density's middle: a sum of some parameters."""
    away = np.where(place.frame.coordinates(place.middle)[0, place.columns] >= 0.0, 1.0, -1.0)
    return lambda theta, _: -(place.off(theta)[:, place.columns] @ away)


def _history(place: Place) -> Score:
    """Sleep once a danger has lasted for some share of the scene, at contacts about a time."""
    middle = place.undriven

    def score(theta: FloatArray, undriven: Outcomes) -> FloatArray:
        late = np.abs(undriven.conflict - middle.conflict) / _SECONDS
        return np.maximum(late, np.abs(undriven.r_risk - middle.r_risk) / (_LASTING * place.drawn))

    return score


_SECONDS, _LASTING = 3.0, 0.2
"""Scales of the time (s) of contact, and of the share of the scene in danger"""
_FAR = 1e6
DEVELOPMENT: Mapping[str, Callable[[Place], Score]] = {
    "box": _box,
    "ellipsoid": _ellipsoid,
    "interaction": _interaction,
    "shell": _shell,
    "slab": _slab,
    "timing": _timing,
}
REPORTED: Mapping[str, Callable[[Place], Score]] = {
    "cone": _cone,
    "corner": _corner,
    "history": _history,
    "ridge": _ridge,
    "ring": _ring,
    "tail": _tail,
}
SHAPES = {**DEVELOPMENT, **REPORTED}


def plant(plan: Plan, space: Space, prior: Prior, plays: Plays, pool: Pool, seed: int) -> Planted:
    """A system after a plan, by seed: each region has its share of the probability, measured on the pool.

    Raises:
        ValueError: the pool is too small for that probability.
    """
    generator = np.random.default_rng([seed, sorted(SHAPES).index(plan.shape)])
    frame, hits = Frame.of(space, prior, np.random.default_rng(0)), pool.hits
    count = round(plan.probability / plan.number * len(pool.theta))
    if count < _FEWEST:
        raise ValueError(f"{count} draws of the pool in a region: {_FEWEST} are needed")
    regions, undriven = [], pool.undriven.take(hits)
    for middle in generator.choice(hits, plan.number, replace=False):
        columns = generator.permutation(frame.dimension)[
            : generator.integers(2, frame.dimension + 1)
        ]
        scales, drawn = (
            np.exp(generator.uniform(-0.7, 0.7, frame.dimension)),
            float(generator.uniform(0.5, 1.0)),
        )
        of = pool.theta[[middle]], pool.undriven.take(np.array([middle]))
        score = SHAPES[plan.shape](Place(frame, space, prior, *of, columns, scales, drawn))
        scores = np.sort(score(pool.theta[hits], undriven))
        level = float(scores[min(count, len(scores)) - 1])
        usual = scores[scores < _FAR]
        regions.append(
            Region(
                plan.shape,
                score,
                level,
                max(float(np.median(usual)), level + _BORDER * (1.0 + abs(level))),
            )
        )
    return Planted(plan, regions, plays)


_FEWEST = 10
"""Draws of the pool in a region"""
_BORDER = 1e-6
"""Least width of the surroundings that announce a region, relative to its level"""
