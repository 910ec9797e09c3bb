"""Systems with planted failures, made by seed: regions of foreseeable manoeuvres in which a driver
sleeps.

The undriven run, in arrays or on SUMO, says what happens there: a point fails if it
lies in a region and collides undriven. Outside its regions the driver is perfect, fails where no
judge survives, or is any system under test. Margins announce a region, say nothing, or deceive:
they get better near regions, and worse near others that never fail.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from generation.search.methods.models import Frame
from generation.search.outcomes import Outcomes, joined, survivors
from generation.search.problem import Plays
from generation.space.density.prior import Prior
from generation.space.space import Space
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from studies.generation.planted.shapes import FAR, SHAPES, Place, Score

UNDRIVEN, PERFECT, CAREFUL = "none", "perfect", "careful"
"""System under test that never acts, the base that survives everything, and the one that fails
where no judge survives"""
GRADIENT, SILENT, DECEPTIVE = "gradient", "silent", "deceptive"
"""Margins near a region: worse, as elsewhere, or better there and worse elsewhere"""
_CLEAR, _BRAKES = 1.0, 4.0
"""Clearance (m) that the perfect driver keeps at least, and its greatest deceleration (m/s²)"""
_WORSE = 4.0
"""Deceleration (m/s²) by which it is worse at the border of a region, with a gradient"""
_KEPT = "collision", "conflict", "r_risk"
"""Undriven outcomes that regions are made of"""


class Pool(NamedTuple):
    """Draws of the density.

    Attributes:
        theta: points (n, d).
        undriven: their undriven outcomes as far as regions are made of them.
        preventable: whether a judge survives each (n,); only undriven collisions were judged.
    """

    theta: FloatArray
    undriven: Outcomes
    preventable: BoolArray

    @classmethod
    def of(cls, prior: Prior, plays: Plays, n: int, path: Path) -> Pool:
        """Draw and play, or read what was kept at a path."""
        if not path.exists():
            theta = prior.sample(n, np.random.default_rng(20_000))
            found = plays(theta, UNDRIVEN)
            collided = found.collision & found.executed
            path.parent.mkdir(parents=True, exist_ok=True)
            prevented = collided.copy()
            prevented[collided] = survivors(theta[collided], plays)
            np.savez_compressed(
                path, theta=theta, collision=collided, conflict=found.conflict, r_risk=found.r_risk,
                preventable=prevented,
            )  # fmt: skip
        with np.load(path, allow_pickle=False) as kept:
            theta = kept["theta"]
            undriven = Outcomes.of(len(theta), **{name: kept[name] for name in _KEPT})
            return cls(theta, undriven, kept["preventable"])

    @property
    def hits(self) -> IntArray:
        """Indices of the draws whose undriven run collides, and that a judge survives."""
        return np.flatnonzero(self.undriven.collision & self.preventable)


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
        shape: of the regions, a name in `SHAPES`.
        sizes: of the regions, relative to each other.
        probability: of a preventable failure under the density, all regions together.
        margin: `GRADIENT`, `SILENT` or `DECEPTIVE`.
        base: driver outside the regions: `PERFECT`, `CAREFUL` or a system under test.
    """

    shape: str
    sizes: tuple[float, ...]
    probability: float
    margin: str = GRADIENT
    base: str = PERFECT

    def __str__(self) -> str:
        several = "regions" if len(self.sizes) > 1 else "region"
        unlike = (
            f" of {':'.join(f'{size:g}' for size in self.sizes)}"
            if len(set(self.sizes)) > 1
            else ""
        )
        base = "" if self.base == PERFECT else f", {self.base}"
        return (
            f"{len(self.sizes)} {several}{unlike}, {self.shape}, {self.probability:g}, "
            f"{self.margin}{base}"
        )


@dataclass(frozen=True, eq=False)
class Planted:
    """A system with planted failures; evaluates points of its space.

    Attributes:
        regions: where it sleeps. decoys: where margins get worse without a failure.
    """

    plan: Plan
    regions: Sequence[Region]
    plays: Plays
    decoys: Sequence[Region] = ()

    def __call__(self, theta: FloatArray) -> Outcomes:
        """The outcomes at points (n, d)."""
        undriven = self.plays(theta, UNDRIVEN)
        fails = undriven.collision & self.within(theta, undriven).any(axis=0)
        driven = self._driven(theta, undriven)
        near = self._near(self.regions, theta, undriven)
        worse = {GRADIENT: near, SILENT: 0.0 * near}.get(
            self.plan.margin, self._near(self.decoys, theta, undriven)
        )
        better = near if self.plan.margin == DECEPTIVE else 0.0 * near
        worsened = replace(
            driven,
            r_risk=np.maximum(driven.r_risk, worse * undriven.r_risk),
            clearance=driven.clearance * (1.0 - worse) + _FARTHER * better,
            max_drac=(driven.max_drac + _WORSE * worse) * (1.0 - better),
        )
        return joined([worsened, undriven]).take(np.arange(len(theta)) + len(theta) * fails)

    def _driven(self, theta: FloatArray, undriven: Outcomes) -> Outcomes:
        """Outcomes of the base at points (n, d)."""
        if self.plan.base not in (PERFECT, CAREFUL):
            return self.plays(theta, self.plan.base)
        perfect = self._perfect(undriven)
        if self.plan.base == PERFECT:
            return perfect
        lost = undriven.collision.copy()
        lost[lost] = ~survivors(theta[lost], self.plays)
        return joined([perfect, undriven]).take(np.arange(len(theta)) + len(theta) * lost)

    @staticmethod
    def _near(regions: Sequence[Region], theta: FloatArray, undriven: Outcomes) -> FloatArray:
        """Nearness (n,) of points (n, d) whose undriven run collides to regions."""
        near = [np.zeros(len(theta)), *(each.nearness(theta, undriven) for each in regions)]
        return np.where(undriven.collision, np.max(near, axis=0), 0.0)

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


def plant(plan: Plan, space: Space, prior: Prior, plays: Plays, pool: Pool, seed: int) -> Planted:
    """A system after a plan, by seed: each region has its share of the probability, measured on the
    pool.

    Raises:
        ValueError: the pool is too small for that probability.
    """
    generator = np.random.default_rng([seed, sorted(SHAPES).index(plan.shape)])
    frame, hits = Frame.of(space, prior, np.random.default_rng(0)), pool.hits
    undriven = pool.undriven.take(hits)
    shares = np.array(plan.sizes) / sum(plan.sizes)
    counts = np.round(plan.probability * shares * len(pool.theta)).astype(int)
    if counts.min() < _FEWEST:
        raise ValueError(f"{counts.min()} draws of the pool in a region: {_FEWEST} are needed")

    def region(middle: int, count: int) -> Region:
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
        usual = scores[scores < FAR]
        reach = max(float(np.median(usual)), level + _BORDER * (1.0 + abs(level)))
        return Region(plan.shape, score, level, reach)

    regions, decoys = (
        [
            region(middle, count)
            for middle, count in zip(
                generator.choice(hits, len(counts), replace=False), counts, strict=True
            )
        ]
        for counts in (counts, counts if plan.margin == DECEPTIVE else counts[:0])
    )
    return Planted(plan, regions, plays, decoys)


_FEWEST = 10
"""Draws of the pool in a region"""
_BORDER = 1e-6
"""Least width of the surroundings that announce a region, relative to its level"""
_FARTHER = 4.0
"""Clearance (m) by which it seems better at the border of a region, where margins deceive"""
