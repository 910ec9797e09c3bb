"""Quality-diversity search for foreseeable and preventable failures, none much like another.

Emitters propose points; those that are not foreseeable, or like a failure that is known, are dropped before anything is run.
The rest are played on the twin, by the reference drivers too where the system fails, and runs are spent on what fails there and
can be prevented. Without a twin, runs are spent on the proposals themselves. Margins (least clearance, greatest DRAC) lead to
failures.

J. K. Pugh, L. B. Soros, K. O. Stanley, Quality diversity: a new frontier for evolutionary computation, 2016.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module

import numpy as np

from generation.outcomes.outcomes import Outcomes
from generation.outcomes.references import survivors
from generation.search.diversity import apart, diverse
from generation.search.problem import BATCH, Calls, History, Problem
from generation.search.quality.archive import Archive
from generation.search.quality.emitter import Emitter
from generation.search.quality.frame import Frame
from recognition.training.seeding import seeded
from schemas.errors import UsageError
from xodr.array_types import BoolArray, FloatArray

EMITTERS = ("prior", "line")
"""Those that are used unless others are named"""
_FAR, _HARD = 5.0, 8.0
"""Clearance (m) at which its margin counts 1/e, and DRAC (m/s²) at which nothing is left of its own"""


@dataclass(frozen=True)
class QualitySettings:
    """How it searches.

    Attributes:
        emitters: names of the modules in `generation.search.quality.emitters`.
        batch: points that each emitter proposes at a time on the twin; without one, all of them together propose `BATCH`.
        first: points that are drawn from the prior to begin with, on the twin.
        apart: least distance of two failures in the unit cube, root mean square over the parameters that are no nuisances.
        patience: generations on the twin without a new failure after which the search ends.
        twin: whether the twin is used where there is one.
    """

    emitters: Sequence[str] = EMITTERS
    batch: int = 1024
    first: int = 8192
    apart: float = 0.05
    patience: int = 6
    twin: bool = True


def search(problem: Problem, budget: int, seed: int, settings: QualitySettings = QualitySettings()) -> History:
    """Spend the budget, or end where nothing new is found on the twin.

    Raises:
        UsageError: the problem has no prior, or ribs is not installed.
    """
    with seeded(seed):
        return _Search(problem, budget, seed, settings).run()


class _Search:
    """A search under way."""

    def __init__(self, problem: Problem, budget: int, seed: int, settings: QualitySettings) -> None:
        if problem.prior is None:
            raise UsageError("quality-diversity search needs a prior of what is foreseeable")
        self._prior, self._problem, self._settings, self._budget = problem.prior, problem, settings, budget
        self._calls, self._generator = Calls(problem, budget), np.random.default_rng(seed)
        self._twin = problem.twin if settings.twin else None
        self._frame = Frame.of(problem.space, self._prior, self._generator)
        self._archive = Archive(self._frame, self._frame.measures(self._prior.sample(2, self._generator)).shape[1], seed)
        batch = settings.batch if self._twin is not None else -(-BATCH // len(settings.emitters))
        self._emitters: list[Emitter] = [
            import_module(f"generation.search.quality.emitters.{name}").Emitter(
                problem, self._frame, self._archive, batch, self._generator
            )
            for name in settings.emitters
        ]
        self._known = np.empty((0, self._frame.dimension))
        if problem.found is not None:
            self._known = self._unit(problem.found)
        self._waiting: list[FloatArray] = []

    def run(self) -> History:
        """Search."""
        stale = 0
        if self._twin is not None:  # begin with what traffic does
            self._try(self._prior.sample(self._settings.first, self._generator))
        while self._calls.left and stale < self._settings.patience:
            new = self._generation()
            stale = 0 if new or self._twin is None else stale + 1
            if sum(map(len, self._waiting)) >= BATCH:
                self._spend()
        self._spend()
        return self._calls.history

    def _generation(self) -> int:
        """Have all emitters propose, and try what is worth it, all at once; how many failures are new."""
        spent = 1.0 - self._calls.left / self._budget
        proposed = [emitter.ask(spent) for emitter in self._emitters]
        theta = np.concatenate(proposed)
        scores = np.full(len(theta), -1.0)
        worth = np.flatnonzero(self._novel(theta))
        worth = worth[self._prior.foreseeable(theta[worth])]
        if self._twin is None:
            worth = worth[: self._calls.left]
        scores[worth], new = self._try(theta[worth])
        ends = np.cumsum([len(each) for each in proposed])
        for emitter, own in zip(self._emitters, np.split(scores, ends[:-1]), strict=True):
            emitter.tell(own)
        return new

    def _try(self, theta: FloatArray) -> tuple[FloatArray, int]:
        """Scores (n,) of points, and how many of them are new failures; these wait for a run, where they had none."""
        if not len(theta):
            return np.empty(0), 0
        if self._twin is None:
            outcomes = self._calls(theta).outcomes
            failing = outcomes.collision & outcomes.executed
        else:
            outcomes = self._twin(theta)
            failing = outcomes.collision & outcomes.executed
            failing[failing] = survivors(theta[failing], self._driven)
        scores = np.where(failing, 1.0, _nearness(outcomes))
        self._archive.add(theta, scores)
        fresh = np.flatnonzero(failing)
        fresh = fresh[self._novel(theta[fresh])]
        fresh = fresh[diverse(self._unit(theta[fresh]), self._settings.apart)]
        self._known = np.concatenate([self._known, self._unit(theta[fresh])])
        if self._twin is not None and len(fresh):
            self._waiting.append(theta[fresh])
        return scores, len(fresh)

    def _driven(self, theta: FloatArray, sut: str) -> Outcomes:
        assert self._twin is not None
        return self._twin(theta, sut)

    def _spend(self) -> None:
        """Run what waits, as far as the budget goes."""
        if self._waiting and self._calls.left:
            self._calls(np.concatenate(self._waiting))
        self._waiting = []

    def _unit(self, theta: FloatArray) -> FloatArray:
        return self._problem.space.unit(theta)[:, self._frame.varied]

    def _novel(self, theta: FloatArray) -> BoolArray:
        """Points (n,) unlike all failures that are known."""
        return apart(self._unit(theta), self._known, self._settings.apart)


def _nearness(outcomes: Outcomes) -> FloatArray:
    """How near to a failure (n,), 0 to below 1, by both margins; a collision that nobody prevents is as good as a near one."""
    near = 0.5 * np.exp(-np.minimum(outcomes.clearance, 1e3) / _FAR) + 0.5 * np.minimum(outcomes.max_drac / _HARD, 1.0)
    return np.where(outcomes.executed, 0.9 * near, 0.0)
