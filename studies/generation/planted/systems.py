"""Systems with planted failures, made by seed: regions of foreseeable manoeuvres in which an otherwise perfect driver sleeps.

The undriven run of the kinematic twin says what happens there: a point fails if it lies in a region and collides undriven.
Outside its regions the driver never fails. With a gradient it gets worse near a region; without one nothing announces a failure.

The development generator plants boxes and ellipsoids; the reported one slabs, shells at the edge of the foreseeable, interactions
of two parameters, and sleep at certain times of the scene.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from generation.density.prior import Prior
from generation.outcomes.outcomes import Outcomes
from generation.search.emitters import Frame
from generation.search.problem import Plays
from generation.search.space import Space
from schemas.common.array_types import BoolArray, FloatArray, IntArray

Score = Callable[[FloatArray], FloatArray]
"""Distance (n,) of points (n, d) from the middle of a region, in a measure of its shape"""
UNDRIVEN = "none"
"""System under test that never acts"""
_CLEAR, _BRAKES = 1.0, 4.0
"""Clearance (m) that the perfect driver keeps at least, and its greatest deceleration (m/s²)"""
_WORSE = 4.0
"""Deceleration (m/s²) by which it is worse at the border of a region, with a gradient"""
_RARE = 0.2
"""Share of the draws that counts as the edge of the foreseeable"""


class Pool(NamedTuple):
    """Draws of the density: points (n, d), and whether an undriven run collides there (n,)."""

    theta: FloatArray
    collides: BoolArray

    @classmethod
    def of(cls, prior: Prior, twin: Plays, n: int, path: Path) -> Pool:
        """Draw and play, or read what was kept at a path."""
        if path.exists():
            with np.load(path, allow_pickle=False) as kept:
                return cls(kept["theta"], kept["collides"])
        theta = prior.sample(n, np.random.default_rng(20_000))
        found = cls(theta, twin(theta, UNDRIVEN).survived == np.False_)
        path.parent.mkdir(parents=True, exist_ok=True)
        np.savez_compressed(path, **found._asdict())
        return found


@dataclass(frozen=True, eq=False)
class Region:
    """A planted region.

    Attributes:
        shape: name in `SHAPES`.
        score: distance from its middle. level: score at its border. reach: score at which nothing announces it any more.
    """

    shape: str
    score: Score
    level: float
    reach: float

    def holds(self, theta: FloatArray) -> BoolArray:
        """Points (n, d) that lie in it: (n,)."""
        return self.score(theta) <= self.level

    def nearness(self, theta: FloatArray) -> FloatArray:
        """1 at the border, less outside, 0 from `reach` on (n,)."""
        return np.clip((self.reach - self.score(theta)) / (self.reach - self.level), 0.0, 1.0)


@dataclass(frozen=True)
class Plan:
    """Plan of a planted failure.

    Attributes:
        shape: of the regions, a name in `SHAPES`. number: of regions.
        probability: of a failure under the density, all regions together.
        gradient: whether the system gets worse before it fails.
    """

    shape: str
    number: int
    probability: float
    gradient: bool

    def __str__(self) -> str:
        several = "regions" if self.number > 1 else "region"
        return f"{self.number} {several}, {self.shape}, {self.probability:g}, {'gradient' if self.gradient else 'no gradient'}"


@dataclass(frozen=True, eq=False)
class Planted:
    """A system with planted failures; evaluates points of its space."""

    plan: Plan
    regions: Sequence[Region]
    twin: Plays

    def __call__(self, theta: FloatArray) -> Outcomes:
        """The outcomes at points (n, d)."""
        undriven = self.twin(theta, UNDRIVEN)
        near = np.max([each.nearness(theta) for each in self.regions], axis=0)
        failing = undriven.collision & np.any(self.within(theta), axis=0)
        worse = np.where(undriven.collision & self.plan.gradient, near, 0.0)
        clearance = np.maximum(undriven.clearance, _CLEAR * (1.0 - worse))
        drac = np.minimum(undriven.max_drac, _BRAKES) + _WORSE * worse
        return replace(
            undriven,
            collision=failing,
            r_risk=np.where(failing, undriven.r_risk, worse * undriven.r_risk),
            clearance=np.where(failing, 0.0, clearance),
            max_drac=np.where(failing, undriven.max_drac, drac),
            impact_speed=np.where(failing, undriven.impact_speed, 0.0),
        )

    def within(self, theta: FloatArray) -> BoolArray:
        """Points (n, d) that lie in each region (k, n)."""
        return np.array([each.holds(theta) for each in self.regions])


class Place(NamedTuple):
    """Place of a region: its middle as a point (1, d), drawn columns of coordinates, and scales (k,) of all coordinates."""

    frame: Frame
    space: Space
    prior: Prior
    middle: FloatArray
    columns: IntArray
    scales: FloatArray

    def off(self, theta: FloatArray) -> FloatArray:
        """Scaled differences (n, k) from the middle, in whitened coordinates."""
        return (self.frame.coordinates(theta) - self.frame.coordinates(self.middle)) / self.scales


def _box(place: Place) -> Score:
    return lambda theta: np.abs(place.off(theta)[:, place.columns]).max(axis=1)


def _ellipsoid(place: Place) -> Score:
    return lambda theta: np.sqrt(np.square(place.off(theta)[:, place.columns]).mean(axis=1))


def _slab(place: Place) -> Score:
    """Between two parallel planes: a sum of differences in some parameters."""
    return lambda theta: np.abs(place.off(theta)[:, place.columns].sum(axis=1))


def _shell(place: Place) -> Score:
    """A part of the rarest draws."""
    limit = float(np.quantile(place.prior.log_density(place.prior.sample(2000, np.random.default_rng(0))), _RARE))

    def score(theta: FloatArray) -> FloatArray:
        return np.where(place.prior.log_density(theta) <= limit, _ellipsoid(place)(theta), _FAR)

    return score


def _interaction(place: Place) -> Score:
    """A product of two parameters in a band: neither of them alone says anything."""
    one, other = place.columns[:2]

    def product(theta: FloatArray) -> FloatArray:
        z = place.frame.coordinates(theta) + 3.0  # positive for nearly all draws
        found: FloatArray = z[:, one] * z[:, other]
        return found

    middle = product(place.middle)
    return lambda theta: np.abs(product(theta) - middle)


def _timing(place: Place) -> Score:
    """Sleep during some time of the scene, for part of the manoeuvres."""
    column = [number for number, name in enumerate(place.space.names) if name in place.prior.nuisances][:1]
    scale = max(float(np.ptp(place.prior.sample(200, np.random.default_rng(0))[:, column])), 1e-9)

    def score(theta: FloatArray) -> FloatArray:
        late = np.abs(theta[:, column] - place.middle[:, column])[:, 0] / (0.1 * scale)
        return np.maximum(late, np.abs(place.off(theta)[:, place.columns[0]]))

    return score


_FAR = 1e6
DEVELOPMENT: Mapping[str, Callable[[Place], Score]] = {"box": _box, "ellipsoid": _ellipsoid}
REPORTED: Mapping[str, Callable[[Place], Score]] = {
    "interaction": _interaction,
    "shell": _shell,
    "slab": _slab,
    "timing": _timing,
}
SHAPES = {**DEVELOPMENT, **REPORTED}


def plant(plan: Plan, space: Space, prior: Prior, twin: Plays, pool: Pool, seed: int) -> Planted:
    """A system after a plan, by seed: each region has its share of the probability, measured on the pool.

    Raises:
        ValueError: the pool is too small for that probability.
    """
    generator = np.random.default_rng([seed, sorted(SHAPES).index(plan.shape)])
    frame = Frame.of(space, prior, np.random.default_rng(0))
    hits = np.flatnonzero(pool.collides)
    count = round(plan.probability / plan.number * len(pool.theta))
    if count < _FEWEST:
        raise ValueError(f"{count} draws of the pool in a region: {_FEWEST} are needed")
    regions = []
    for middle in generator.choice(hits, plan.number, replace=False):
        columns = generator.permutation(frame.dimension)[: generator.integers(2, frame.dimension + 1)]
        scales = np.exp(generator.uniform(-0.7, 0.7, frame.dimension))
        score = SHAPES[plan.shape](Place(frame, space, prior, pool.theta[[middle]], columns, scales))
        scores = np.sort(score(pool.theta[hits]))
        level = float(scores[min(count, len(scores)) - 1])
        usual = scores[scores < _FAR]
        regions.append(Region(plan.shape, score, level, max(float(np.median(usual)), level * (1.0 + 1e-6) + 1e-9)))
    return Planted(plan, regions, twin)


_FEWEST = 10
"""Draws of the pool in a region"""
