"""Quality-diversity search for foreseeable and preventable failures, none much like another.

Emitters propose points; those that are not foreseeable, or like a failure that is known, are dropped before anything is run.
The rest are played on the twin, by the reference drivers too where the system fails, and runs are spent on what fails there and
can be prevented. Without a twin, runs are spent on the proposals that a model of the runs so far finds nearest to a failure.
Margins (least clearance, greatest DRAC) lead to failures.

J. K. Pugh, L. B. Soros, K. O. Stanley, Quality diversity: a new frontier for evolutionary computation, 2016.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from generation.search.emitters import EMITTERS, Archive, Emitter, Frame
from generation.search.problem import BATCH, History, Problem
from generation.search.screen import PACE, Screen, nearness
from recognition.training.data import seeded
from schemas.common.array_types import FloatArray

METHODS = {
    "quality": {
        "title": "**quality-diversity**",
        "meaning": "an archive of distinct foreseeable and preventable failures, found on the twin",
        "realistic": True,
    }
}


@dataclass(frozen=True)
class QualitySettings:
    """Settings of the search.

    Attributes:
        emitters: names in `generation.search.emitters.EMITTERS`.
        batch: points that each emitter proposes at a time.
        first: points that are drawn from the prior to begin with.
        apart: least distance of two failures in the unit cube, root mean square over the parameters that are no nuisances.
        patience: generations of which the search looks back: it ends when they led to less than one run each.
        generations: after which the search ends in any case; None for no such end.
        twin: whether the twin is used where there is one.
        pace: proposals for each run, without a twin.
    """

    emitters: Sequence[str] = ("line",)
    batch: int = 1024
    first: int = 2048
    apart: float = 0.05
    patience: int = 18
    generations: int | None = None
    twin: bool = True
    pace: float = PACE

    def generations_of(self, proposals: int) -> int:
        """Generations that make no more than so many proposals; one at least."""
        return max((proposals - self.first) // (self.batch * len(self.emitters)), 1)


def quality(problem: Problem, budget: int, seed: int, settings: QualitySettings = QualitySettings()) -> History:
    """Spend the budget, or end where hardly anything is left to run.

    Raises:
        UsageError: the problem has no prior, or ribs is not installed.
    """
    with seeded(seed):
        return _Search(problem, budget, seed, settings).run()


class _Search:
    """A search under way."""

    def __init__(self, problem: Problem, budget: int, seed: int, settings: QualitySettings) -> None:
        self._screen = Screen(problem, budget, settings.apart, settings.twin, settings.pace)
        assert problem.prior is not None
        self._prior, self._settings, generator = problem.prior, settings, np.random.default_rng(seed)
        self._generator = generator
        frame = Frame.of(problem.space, self._prior, generator)
        self._archive = Archive(frame, frame.measures(self._prior.sample(2, generator)).shape[1], seed)
        self._emitters: list[Emitter] = [
            EMITTERS[name](problem, frame, self._archive, settings.batch, generator) for name in settings.emitters
        ]

    def run(self) -> History:
        """Search."""
        screen, runs = self._screen, list[int]()
        drawn = self._prior.sample(self._settings.first, self._generator)  # begin with what traffic does
        self._try(drawn[screen.worth(drawn)])
        while screen.left and len(runs) != self._settings.generations and not self._stagnates(runs):
            runs.append(self._generation())
            if screen.waiting >= min(BATCH, screen.left):
                screen.spend()
        screen.spend()
        return screen.history

    def _stagnates(self, runs: list[int]) -> bool:
        """Whether the last generations led to less than one run each, given the runs of each generation."""
        patience = self._settings.patience
        return len(runs) >= patience and sum(runs[-patience:]) < patience

    def _generation(self) -> int:
        """Have all emitters propose, and try what is worth it, all at once; how many are run, or wait for a run."""
        proposed = [emitter.ask(self._screen.spent) for emitter in self._emitters]
        theta = np.concatenate(proposed)
        scores = np.full(len(theta), -1.0)
        worth = np.flatnonzero(self._screen.worth(theta))
        scores[worth], count = self._try(theta[worth])
        ends = np.cumsum([len(each) for each in proposed])
        for emitter, own in zip(self._emitters, np.split(scores, ends[:-1]), strict=True):
            emitter.tell(own)
        return count

    def _try(self, theta: FloatArray) -> tuple[FloatArray, int]:
        """Scores (n,) of points, and how many of them are run, or wait for a run."""
        if not len(theta):
            return np.empty(0), 0
        found = self._screen.attempt(theta)
        scores = np.where(found.failing, 1.0, np.where(found.tried, nearness(found.outcomes), -1.0))
        self._archive.add(theta[found.tried], scores[found.tried])
        return scores, found.runs
