"""Coverage search: explore all that is foreseeable, and refine each finding apart from the others.

Half of the runs are one draw from each of many cells of equal probability, whatever was found so far. The rest goes to emitters
that take turns: one for each group of failures that are near each other, and one for near misses. An emitter proposes steps from
its own runs and keeps those that are foreseeable and unlike all runs; a forest grown on the runs ranks them. An emitter whose
last runs did not fail rests, so that no finding starves the others; its runs go to exploration. Until something fails, three
quarters explore.

M. C. Fontaine and S. Nikolaidis, Covariance matrix adaptation MAP-annealing, 2023 (emitters that are kept apart).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from generation.density.prior import Prior
from generation.search.emitters import Frame
from generation.search.problem import Calls, History, Problem
from generation.search.screen import Surrogate
from generation.search.space import apart, distinctive, diverse
from schemas.errors import UsageError
from xodr.array_types import FloatArray, IntArray

METHODS = {
    "cover": {
        "title": "**coverage**",
        "meaning": "half of the runs explore by cells of equal probability, the rest refines each finding apart",
        "realistic": True,
    }
}


@dataclass(frozen=True)
class CoverSettings:
    """Parameters of the search.

    Attributes:
        batch: runs of a round.
        first: runs that explore before the first emitter proposes.
        share: share of the runs that explores once something fails.
        blind: share of the runs that explores until something fails.
        linked: distance in the unit cube, root mean square over the parameters that tell cases apart, up to which failures
            are of one group.
        least: distance from all runs that a proposal keeps.
        step: standard deviation of steps, in whitened coordinates.
        proposals: number of proposals of an emitter for a run.
        patience: runs of a group after which it rests if fewer than a fifth of them failed.
    """

    batch: int = 40
    first: int = 60
    share: float = 0.5
    blind: float = 0.75
    linked: float = 0.15
    least: float = 0.05
    step: float = 0.4
    proposals: int = 24
    patience: int = 10


def cover(problem: Problem, budget: int, seed: int, settings: CoverSettings = CoverSettings()) -> History:
    """Spend the budget.

    Raises:
        UsageError: the problem has no prior.
    """
    if problem.prior is None:
        raise UsageError("this search needs a prior of what is foreseeable")
    return _Search(problem, problem.prior, budget, seed, settings).run()


def stratified(prior: Prior, frame: Frame, n: int, generator: np.random.Generator) -> FloatArray:
    """One draw from each of n cells of equal probability, or up to twice as many (m, d), in a drawn order.

    The cells halve draws of the prior at the median of the coordinate in which they spread most.
    """
    depth = max(int(np.ceil(np.log2(max(n, 1)))), 0)
    drawn = prior.sample(_PER_CELL << depth, generator)
    rows, cells = frame.coordinates(drawn), [np.arange(len(drawn))]
    for _ in range(depth):
        cells = [half for cell in cells for half in _halves(rows, cell)]
    chosen = np.array([generator.choice(cell) for cell in cells])
    return drawn[generator.permutation(chosen)]


_PER_CELL = 4
"""Draws of the prior for each cell"""


def _halves(rows: FloatArray, cell: IntArray) -> tuple[IntArray, IntArray]:
    widest = int(np.argmax(rows[cell].std(axis=0)))
    order = cell[np.argsort(rows[cell, widest], kind="stable")]
    return order[: len(order) // 2], order[len(order) // 2 :]


class _Search:
    """A search under way."""

    def __init__(self, problem: Problem, prior: Prior, budget: int, seed: int, settings: CoverSettings) -> None:
        self._calls, self._prior, self._space, self._settings = Calls(problem, budget), prior, problem.space, settings
        self._generator = np.random.default_rng(seed)
        self._frame = Frame.of(problem.space, prior, self._generator)
        self._told, self._surrogate = distinctive(problem.space), Surrogate()
        self._design = stratified(prior, self._frame, budget, self._generator)
        self._theta = np.empty((0, len(problem.space.parameters)))
        self._failing, self._origin = np.empty(0, bool), np.empty(0, np.int64)

    def run(self) -> History:
        """Search."""
        self._spend(self._explored(self._settings.first))
        while self._calls.left:
            most = min(self._settings.batch, self._calls.left)
            share = self._settings.share if self._failing.any() else self._settings.blind
            guided = self._guided(most - round(share * most))
            self._spend(np.concatenate([self._explored(most - len(guided)), guided]), len(guided))
        return self._calls.history

    def _spend(self, theta: FloatArray, guided: int = 0) -> None:
        """Run points (n, d), of which the last ones were proposed by emitters."""
        found = self._calls(theta)
        self._theta = np.concatenate([self._theta, found.theta])
        failing = found.outcomes.collision & found.outcomes.executed
        self._failing = np.concatenate([self._failing, failing])
        origin = np.zeros(len(failing), np.int64)
        origin[len(origin) - guided :] = 1
        self._origin = np.concatenate([self._origin, origin])
        self._surrogate.learn(self._unit(found.theta), found.outcomes)

    def _explored(self, n: int) -> FloatArray:
        """The next points of the design (n, d)."""
        if len(self._design) < n:
            self._design = stratified(self._prior, self._frame, max(n, len(self._theta)), self._generator)
        chosen, self._design = self._design[:n], self._design[n:]
        return chosen

    def _guided(self, n: int) -> FloatArray:
        """Points of the emitters in turn (m, d), n or fewer."""
        if n <= 0:
            return np.empty((0, self._theta.shape[1]))
        groups = [group for group in self._groups() if not self._rests(group)]
        sources = [*groups, self._near_misses()]
        quotas = [n // len(sources) + (each < n % len(sources)) for each in range(len(sources))]
        chosen = np.empty((0, self._theta.shape[1]))
        for source, quota in zip(sources, quotas, strict=True):
            if quota and len(source):
                chosen = np.concatenate([chosen, self._proposed(source, quota, chosen)])
        return chosen

    def _groups(self) -> list[IntArray]:
        """Indices of the failures of each group: single linkage; those with the fewest failures first."""
        rows = np.flatnonzero(self._failing)
        labels = grouped(self._unit(self._theta[rows]), self._settings.linked)
        return sorted((rows[labels == label] for label in np.unique(labels)), key=len)

    def _rests(self, group: IntArray) -> bool:
        """Whether the last guided runs near a group hardly ever failed."""
        guided = np.flatnonzero(self._origin == 1)
        if not len(guided):
            return False
        near = ~apart(self._unit(self._theta[guided]), self._unit(self._theta[group]), self._settings.linked)
        last = self._failing[guided[near]][-self._settings.patience :]
        return len(last) == self._settings.patience and float(last.mean()) < _YIELD

    def _near_misses(self) -> IntArray:
        """Indices of the runs without a failure that the forest finds nearest to one."""
        rows = np.flatnonzero(~self._failing)
        return rows[self._surrogate.ranked(self._unit(self._theta[rows]))][:_PARENTS]

    def _proposed(self, parents: IntArray, quota: int, chosen: FloatArray) -> FloatArray:
        """Steps from parents (quota, d), or fewer: foreseeable, unlike all runs and points chosen before, most promising."""
        n = self._settings.proposals * quota
        start = self._frame.coordinates(self._theta[self._generator.choice(parents, n)])
        theta = self._frame.points(start + self._generator.normal(0.0, self._settings.step, start.shape))
        theta = theta[self._prior.foreseeable(theta)]
        known = self._unit(np.concatenate([self._theta, chosen]))
        theta = theta[apart(self._unit(theta), known, self._settings.least)]
        theta = theta[self._surrogate.ranked(self._unit(theta))]
        return theta[diverse(self._unit(theta), self._settings.least, quota)]

    def _unit(self, theta: FloatArray) -> FloatArray:
        return self._space.unit(theta)[:, self._told]


_YIELD = 0.2
"""Share of failures below which a group rests"""
_PARENTS = 10
"""Near misses that steps begin at"""


def grouped(unit: FloatArray, linked: float) -> IntArray:
    """Labels (n,) of rows (n, d) of the unit cube: groups by single linkage at a root-mean-square distance."""
    from scipy.cluster.hierarchy import fcluster, linkage

    if len(unit) < 2:
        return np.zeros(len(unit), np.int64)
    return np.asarray(fcluster(linkage(unit, "single"), linked * np.sqrt(unit.shape[1]), "distance"), np.int64)
