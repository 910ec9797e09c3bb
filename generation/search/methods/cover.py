"""Coverage search: draws of the density, runs where no run was, and runs that cover the probability
that is expected to fail.

A guided run is chosen by what it is expected to reveal: its own predicted failure, times the
predicted failures among draws of the density around it that are near no known failure. Known
failures are grouped into regions; each has its share of the guided runs, and so has what is near
none, so that no finding starves another one. The search ends before its budget where nothing new
has failed for long. Failures are judged first, on the search's budget:
nothing is learnt from one that no careful driver prevents. Without plays two models predict, each
for half of the guided runs: a forest, in which near misses have a small share, and a Gaussian
process, which also expects failures where no run was. With plays in arrays it is their verdict,
less where no careful driver prevents the failure.

G. L. Nemhauser, L. A. Wolsey, M. L. Fisher, An analysis of approximations for maximizing submodular
set functions, 1978 (the greedy choice of what covers most).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.distance import cdist

from generation.search.methods.judging import aside
from generation.search.methods.models import Forest, Frame, GaussianProcess
from generation.search.outcomes import survivors
from generation.search.problem import BATCH, Calls, History, Plays, SearchProblem
from generation.space.density.prior import Prior
from generation.space.space import KnownRows, distinctive, grouped
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from schemas.common.errors import UsageError

METHODS = {
    "cover": {
        "title": "**coverage**",
        "meaning": (
            "draws of the density, and runs that cover what is expected to fail and ask where "
            "failures begin"
        ),
        "realistic": True,
    },
    "draws": {
        "title": "draws of the density",
        "meaning": "draws of the density alone",
        "realistic": True,
    },
}


@dataclass(frozen=True)
class CoverSettings:
    """Parameters of the search.

    Attributes:
        batch: runs of a round, the share of the budget that they are where that is more, and no
            more than the third number.
        first: runs that explore before the first guided one, without plays.
        explored: share of the runs that are draws.
        spread: share of the runs that go where no run was, without plays.
        elsewhere: least share of the other guided runs that are near no known failure.
        radius: distance in the unit cube, root mean square over the parameters that tell cases
            apart, up to which a failure covers others.
        linked: distance up to which failures are of one region.
        least: distance from all runs that a guided run keeps.
        drawn: draws of the density that are guided runs' candidates in a round.
        stepped: further candidates: steps from known failures.
        round: runs of a round from which on there are more candidates, in proportion.
        traffic: draws that stand for traffic, without plays.
        patience: runs without a failure that is unlike all before, after which the search ends, and
            the share of the budget that they are where that is more.
        step: standard deviation of steps, in whitened coordinates.
        played: draws that stand for traffic, with plays: so many for each run of the
            budget, and no more than the second number.
        unpreventable: weight of a failure that no careful driver prevents, with plays.
    """

    batch: tuple[int, float, int] = 40, 0.02, 1000
    first: int = 60
    explored: float = 0.15
    spread: float = 0.25
    elsewhere: float = 0.25
    radius: float = 0.08
    linked: float = 0.15
    least: float = 0.03
    drawn: int = 1200
    stepped: int = 400
    round: int = 200
    traffic: int = 2000
    patience: tuple[int, float] = 1000, 0.25
    step: float = 0.4
    played: tuple[int, int] = 33, 16_384
    unpreventable: float = 0.2


def draws(problem: SearchProblem, budget: int, seed: int) -> History:
    """Draws of the density.

    Raises:
        UsageError: the problem has no prior.
    """
    prior, calls, generator = (
        _prior_of(problem),
        Calls(problem, budget),
        np.random.default_rng(seed),
    )
    while calls.left:
        calls(prior.sample(min(BATCH, calls.left), generator))
    return calls.history


def cover(
    problem: SearchProblem, budget: int, seed: int, settings: CoverSettings = CoverSettings()
) -> History:
    """Spend the budget.

    Raises:
        UsageError: the problem has no prior.
    """
    return _Search(problem, _prior_of(problem), budget, seed, settings).run()


def _prior_of(problem: SearchProblem) -> Prior:
    if problem.prior is None:
        raise UsageError("this search needs a prior of what is foreseeable")
    return problem.prior


Predict = Callable[[FloatArray], FloatArray]
"""Predicted failure (n,) of points (n, d), from 0 to 1"""


@dataclass(eq=False)
class _Field:
    """Candidates of a round and draws that stand for traffic, with what is chosen so far.

    Attributes:
        unit: candidates (m, k). traffic: draws (t, k). near: which of these each covers (m, t).
        free: candidates (m,) that are apart from what is chosen.
        chosen: indices of candidates.
    """

    unit: FloatArray
    traffic: FloatArray
    near: BoolArray
    least: float
    free: BoolArray
    chosen: list[int] = field(default_factory=list)

    @classmethod
    def of(cls, unit: FloatArray, traffic: FloatArray, settings: CoverSettings) -> _Field:
        """Return the state before the first choice."""
        reach = float(np.sqrt(unit.shape[1]))
        near = cdist(unit, traffic) < settings.radius * reach
        return cls(unit, traffic, near, settings.least * reach, np.ones(len(unit), bool))

    def choose(
        self,
        worth: FloatArray,
        left: FloatArray,
        n: int,
        of: IntArray | None = None,
        shares: IntArray | None = None,
    ) -> None:
        """Choose n candidates, or fewer, each the one that is expected to reveal most beside those
        before it.

        Args:
            worth: predicted failure (m,) of each; none with 0 is chosen.
            left: predicted failure (t,) of traffic that is not covered.
            of: region (m,) of each candidate. shares: most candidates of each region, while others
                are left; None for no limit.
        """
        # Greedy choice of a submodular function, at least 1 - 1/e of the best one (Nemhauser et al.
        # 1978): the gain is the probability mass that a candidate would cover now.
        gain, left = self.near @ left, left.copy()
        free, shares = self.free & (worth > 0.0), None if shares is None else shares.copy()
        for _ in range(n):
            within = free if shares is None or of is None else free & (shares[of] > 0)
            within = within if within.any() else free
            if not within.any():
                break
            value = worth * (np.maximum(gain, 0.0) + _ALONE)
            best = int(np.argmax(np.where(within, value, -1.0)))
            self.chosen.append(best)
            if shares is not None and of is not None:
                shares[of[best]] -= 1
            apart_ = np.square(self.unit - self.unit[best]).sum(axis=1) >= self.least**2
            free, self.free = free & apart_, self.free & apart_
            # A run that is sure to fail covers its surroundings, an uncertain one a part of them.
            covered = np.flatnonzero(self.near[best] & (left > 0.0))
            taken = left[covered] * min(worth[best], _SURE)
            gain -= self.near[:, covered] @ taken
            left[covered] -= taken


class _Search:
    """A search under way."""

    def __init__(
        self, problem: SearchProblem, prior: Prior, budget: int, seed: int, settings: CoverSettings
    ) -> None:
        self._calls, self._prior, self._space, self._settings = (
            Calls(problem, budget),
            prior,
            problem.space,
            settings,
        )
        self._generator = np.random.default_rng(seed)
        self._frame, self._told = (
            Frame.of(problem.space, prior, self._generator),
            distinctive(problem.space),
        )
        # Distances of the settings are root mean squares over parameters: times √k they are
        # Euclidean ones.
        self._reach = float(np.sqrt(self._told.sum()))
        least, share, most = settings.batch
        self._batch = min(max(least, round(share * budget)), most)
        least, share = settings.patience
        self._patience, self._since = max(least, round(share * budget)), 0
        self._guidance, self._room = problem.guidance, problem.room
        self._judges = problem.judges
        none = np.empty((0, len(problem.space.parameters)))
        self._failures = none if problem.found is None else problem.found
        self._ran, self._failed = KnownRows(), KnownRows()
        self._failed.add(self._unit(self._failures))
        self._regions = self._grouped()
        self._plays = problem.plays
        # Plays need no models, whose library takes seconds to load.
        self._models = None if self._plays else (Forest(), GaussianProcess(_HELD))
        share, most = settings.played
        # Plays cost little, so traffic is stood for by more draws; the greatest number bounds the
        # matrix of distances in `_Field`.
        played = max(settings.drawn, min(share * budget, most))
        played = int(min(played, max(problem.room(_LOOKED), _FEWEST_PLAYED)))
        self._traffic = prior.sample(
            settings.traffic if self._plays is None else played, self._generator
        )
        self._chance: FloatArray | None = None
        self._emitters: list[Predict] = []
        if self._models is not None:
            forest, process = self._models
            # The forest splits by single values, so it reads the unit cube; the process has round
            # kernels, so it reads whitened coordinates.
            self._emitters = [
                lambda theta: forest.failing(self._unit(theta)),
                lambda theta: process.failing(self._frame.coordinates(theta)),
            ]
        if self._plays is not None:
            verdicts = partial(self._verdicts, self._plays)
            chance = verdicts(self._traffic)
            # Verdicts do not change: draws of traffic that pass have nothing to reveal, ever.
            self._traffic, self._chance, self._emitters = (
                self._traffic[chance > 0.0],
                chance[chance > 0.0],
                [verdicts],
            )
        # Distances of traffic from known failures, as failures come.
        self._standing = self._unit(self._traffic)
        self._off = self._failed.distances(self._standing)

    def run(self) -> History:
        """Search."""
        # Models learn from runs, so some have to come first; plays need none.
        if self._plays is None:
            self._spend(self._prior.sample(self._settings.first, self._generator))
            self._guidance.drawn += len(self._calls.history.theta)
        while self._calls.left and not self._saturated:
            runs = min(self._batch, self._calls.left)
            # Draws of the density fill up what the guided runs leave: early on the models predict
            # nothing.
            guided = self._guided(runs - round(self._settings.explored * runs))
            explored = self._prior.sample(runs - len(guided), self._generator)
            self._spend(np.concatenate([explored, guided]))
            self._guidance.guided += len(guided)
            self._guidance.drawn += len(explored)
        self._guidance.saturated = self._calls.left > 0
        return self._calls.history

    @property
    def _saturated(self) -> bool:
        """Whether failures are known, and nothing new has failed for long."""
        return len(self._failures) > 0 and self._since >= self._patience

    def _spend(self, theta: FloatArray) -> None:
        """Run points (n, d), and judge those that fail: failures that nothing prevents are set
        aside."""
        found = self._calls(theta)
        failing = found.outcomes.collision & found.outcomes.executed
        prevented = self._calls.prevented(found)
        unit = self._unit(found.theta)
        self._ran.add(unit)
        new = unit[prevented]
        unlike = self._failed.distances(new) >= self._settings.radius
        self._since = 0 if unlike.any() else self._since + len(unit)
        if len(new):
            self._failures = np.concatenate([self._failures, found.theta[prevented]])
            self._failed.add(new)
            fresh = KnownRows()
            fresh.add(new)
            self._off = np.minimum(self._off, fresh.distances(self._standing))
            self._regions = self._grouped()
        if self._models is not None:
            forest, process = self._models
            outcomes = aside(found.outcomes, failing & ~prevented)
            forest.learn(unit, outcomes)
            process.learn(self._frame.coordinates(found.theta), outcomes)

    def _grouped(self) -> IntArray:
        """Region of each known failure (m,), from 0."""
        unit = self._unit(self._failures)
        # Groups take memory by the square of their rows: of many failures even ones are grouped,
        # and the others belong to the nearest one.
        some = np.linspace(0, len(unit) - 1, min(len(unit), _GROUPED)).astype(int)
        labels = np.unique(grouped(unit[some], self._settings.linked), return_inverse=True)[1]
        if len(some) < len(unit):
            labels = labels[KDTree(unit[some]).query(unit)[1]]
        return np.asarray(labels, np.int64)

    def _guided(self, n: int) -> FloatArray:
        """Points (n, d), or fewer: each part of them is chosen among what those before it have
        left."""
        theta = self._candidates(n)
        # Before any run: what is not foreseeable can be no edge case, whatever comes of it.
        theta = theta[self._prior.foreseeable(theta)]
        unit = self._unit(theta)
        keep = self._ran.distances(unit, self._settings.least) >= self._settings.least
        theta, unit = theta[keep], unit[keep]
        ground = _Field.of(unit, self._standing, self._settings)
        if self._models is not None:
            spread = self._settings.spread / (1.0 - self._settings.explored)
            self._spread(ground, theta, round(spread * n), self._models[1])
        of, known = self._region_of(unit), len(self._shares(0)) - 1
        # Draws near a known failure are covered already and count nothing.
        left = self._off >= self._settings.radius
        # An equal part of what is left: runs that one emitter has no candidates for are the next
        # one's.
        for more, emitter in zip(range(len(self._emitters), 0, -1), self._emitters, strict=True):
            worth = emitter(theta)
            worth = np.where((of < known) & (worth < _HOPE), 0.0, worth)
            chance = emitter(self._traffic) if self._chance is None else self._chance
            part = (n - len(ground.chosen)) // more
            ground.choose(worth, np.where(left, chance, 0.0), part, of, self._shares(part))
        return theta[ground.chosen]

    def _spread(self, ground: _Field, theta: FloatArray, n: int, process: GaussianProcess) -> None:
        """Choose candidates that together cover most traffic around which nothing was run: half of
        them by draws alone, half where challenges are predicted, by the power of their rank."""
        known = len(self._traffic)
        rows = self._frame.coordinates(np.concatenate([self._traffic, theta]))
        challenge = process.predicted(rows)[0]
        rank = np.searchsorted(np.sort(challenge[:known]), challenge, "right") / known
        radius = self._settings.radius
        free = self._ran.distances(ground.traffic, radius) >= radius
        for part, power in ((n // 2, 0.0), (n - n // 2, _POWER)):
            weight = np.maximum(rank, 1e-3) ** power
            ground.choose(weight[known:], np.where(free, weight[:known], 0.0), part)

    def _shares(self, n: int) -> IntArray:
        """Runs of each region, and of what is near none (last), of n: as many each, the small
        regions first."""
        sizes = np.bincount(self._regions, minlength=0)
        elsewhere = max(int(np.ceil(n / (len(sizes) + 1))), round(self._settings.elsewhere * n))
        found = np.full(len(sizes) + 1, (n - elsewhere) // max(len(sizes), 1), np.int64)
        found[np.argsort(sizes, kind="stable")[: (n - elsewhere) % max(len(sizes), 1)]] += 1
        found[-1] = elsewhere
        return found

    def _region_of(self, unit: FloatArray) -> IntArray:
        """Region (n,) of the known failures near points (n, k); the number of regions where there
        are none."""
        found = np.full(len(unit), self._regions.max(initial=-1) + 1)
        if len(self._failures) and len(unit):
            far, nearest = map(np.asarray, KDTree(self._unit(self._failures)).query(unit))
            near = far < self._settings.linked * self._reach
            found[near] = self._regions[nearest[near]]
        return found

    def _candidates(self, n: int) -> FloatArray:
        """Candidates (m, d) of n runs: draws of the density, and steps from failures that are known
        or that plays have, as many from each region."""
        times = max(n / self._settings.round, 1.0)
        if self._plays is not None:
            room = self._room(_LOOKED) / (self._settings.drawn + self._settings.stepped)
            times = min(times, max(room, 0.1))
        drawn = self._prior.sample(round(times * self._settings.drawn), self._generator)
        parents, sizes = self._failures, np.asarray(np.bincount(self._regions))
        chances = np.take(1.0 / np.maximum(sizes, 1), self._regions)
        if self._chance is not None:
            parents = np.concatenate([parents, self._traffic])
            chances = np.ones(len(parents))
        if not len(parents):
            return drawn
        rows = self._generator.choice(
            len(parents), round(times * self._settings.stepped), p=chances / chances.sum()
        )
        start = self._frame.coordinates(parents[rows])
        steps = self._frame.points(
            start + self._generator.normal(0.0, self._settings.step, start.shape)
        )
        return np.concatenate([drawn, steps])

    def _verdicts(self, plays: Plays, theta: FloatArray) -> FloatArray:
        """Failures (n,) of plays at points (n, d): 1 where a careful driver prevents them, less
        where none does."""
        outcomes = plays(theta)
        failing = outcomes.collision & outcomes.executed
        worth = np.where(failing, self._settings.unpreventable, 0.0)
        # Only failures are played with careful drivers: these are few of the draws.
        worth[failing] += (1.0 - self._settings.unpreventable) * survivors(
            theta[failing], plays, self._judges
        )
        return worth

    def _unit(self, theta: FloatArray) -> FloatArray:
        return self._space.unit(theta)[:, self._told]


_GROUPED = 2000
"""Failures that are grouped into regions at most"""
_HELD = 600
"""Runs that the Gaussian process holds: a round's cost does not grow with the runs"""
_LOOKED, _FEWEST_PLAYED = 0.3, 250
"""Share of the time that is left in which draws of traffic, or candidates of a round, are played,
and the fewest of the first"""
_ALONE = 1e-9
"""Counts for a candidate whose surroundings are covered: the likeliest failure is chosen where
nothing is left to cover"""
_SURE = 0.9
"""Share of its surroundings that a guided run is taken to cover at most"""
_POWER = 4.0
"""Power of the rank of predicted challenges"""
_HOPE = 0.1
"""Predicted failure near known failures below which nothing is run"""
