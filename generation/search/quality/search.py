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
from generation.search.problem import BATCH, History, Problem
from generation.search.quality.archive import Archive
from generation.search.quality.emitter import Emitter
from generation.search.quality.frame import Frame
from generation.search.screen import Screen
from recognition.training.seeding import seeded
from xodr.array_types import FloatArray

EMITTERS, ALONE = ("line",), ("line", "policy")
"""Those that are used unless others are named: with a twin, and without one"""
_FAR, _HARD = 5.0, 8.0
"""Clearance (m) at which its margin counts 1/e, and DRAC (m/s²) at which nothing is left of its own"""


@dataclass(frozen=True)
class QualitySettings:
    """How it searches.

    Attributes:
        emitters: names of the modules in `generation.search.quality.emitters`. alone: those without a twin.
        batch: points that each emitter proposes at a time on the twin; without one, all of them together propose `BATCH`.
        first: points that are drawn from the prior to begin with, on the twin.
        apart: least distance of two failures in the unit cube, root mean square over the parameters that are no nuisances.
        patience: generations on the twin of which the search looks back: it ends when they found less than one new failure each.
        generations: after which the search ends in any case; None for no such end.
        twin: whether the twin is used where there is one.
    """

    emitters: Sequence[str] = EMITTERS
    alone: Sequence[str] = ALONE
    batch: int = 1024
    first: int = 2048
    apart: float = 0.05
    patience: int = 18
    generations: int | None = None
    twin: bool = True

    def generations_of(self, proposals: int, twin: bool = True) -> int:
        """Generations, on the twin or without one, that make no more than so many proposals; one at least."""
        return max((proposals - self.first) // (self.batch * len(self.emitters)) if twin else proposals // BATCH, 1)


def search(problem: Problem, budget: int, seed: int, settings: QualitySettings = QualitySettings()) -> History:
    """Spend the budget, or end where hardly anything new is found on the twin.

    Raises:
        UsageError: the problem has no prior, or ribs is not installed.
    """
    with seeded(seed):
        return _Search(problem, budget, seed, settings).run()


class _Search:
    """A search under way."""

    def __init__(self, problem: Problem, budget: int, seed: int, settings: QualitySettings) -> None:
        self._screen = Screen(problem, budget, settings.apart, settings.twin)
        assert problem.prior is not None
        self._prior, self._settings, generator = problem.prior, settings, np.random.default_rng(seed)
        self._generator = generator
        frame = Frame.of(problem.space, self._prior, generator)
        self._archive = Archive(frame, frame.measures(self._prior.sample(2, generator)).shape[1], seed)
        names = settings.emitters if self._screen.twin is not None else settings.alone
        batch = settings.batch if self._screen.twin is not None else -(-BATCH // len(names))
        self._emitters: list[Emitter] = [
            import_module(f"generation.search.quality.emitters.{name}").Emitter(problem, frame, self._archive, batch, generator)
            for name in names
        ]

    def run(self) -> History:
        """Search."""
        screen, new = self._screen, list[int]()
        if screen.twin is not None:  # begin with what traffic does
            drawn = self._prior.sample(self._settings.first, self._generator)
            self._try(drawn[screen.worth(drawn)])
        while screen.left and len(new) != self._settings.generations and not (screen.twin and self._stagnates(new)):
            new.append(self._generation())
            if screen.waiting >= min(BATCH, screen.left):
                screen.spend()
        screen.spend()
        return screen.history

    def _stagnates(self, new: list[int]) -> bool:
        """Whether the last generations found less than one new failure each, given how many each generation found."""
        patience = self._settings.patience
        return len(new) >= patience and sum(new[-patience:]) < patience

    def _generation(self) -> int:
        """Have all emitters propose, and try what is worth it, all at once; how many failures are new."""
        proposed = [emitter.ask(self._screen.spent) for emitter in self._emitters]
        theta = np.concatenate(proposed)
        scores = np.full(len(theta), -1.0)
        worth = np.flatnonzero(self._screen.worth(theta))
        if self._screen.twin is None:
            worth = worth[: self._screen.left]
        scores[worth], count = self._try(theta[worth])
        ends = np.cumsum([len(each) for each in proposed])
        for emitter, own in zip(self._emitters, np.split(scores, ends[:-1]), strict=True):
            emitter.tell(own)
        return count

    def _try(self, theta: FloatArray) -> tuple[FloatArray, int]:
        """Scores (n,) of points, and how many of them are new failures."""
        if not len(theta):
            return np.empty(0), 0
        tried = self._screen.attempt(theta)
        scores = np.where(tried.failing, 1.0, _nearness(tried.outcomes))
        self._archive.add(theta, scores)
        return scores, tried.new


def _nearness(outcomes: Outcomes) -> FloatArray:
    """How near to a failure (n,), 0 to below 1, by both margins; a collision that nobody prevents is as good as a near one."""
    near = 0.5 * np.exp(-np.minimum(outcomes.clearance, 1e3) / _FAR) + 0.5 * np.minimum(outcomes.max_drac / _HARD, 1.0)
    return np.where(outcomes.executed, 0.9 * near, 0.0)
