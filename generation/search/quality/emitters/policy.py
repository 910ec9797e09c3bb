"""The policy of MCSG: an LSTM that edits parents, from coarse to fine; what it may not propose costs it, and is never run.

It learns from what the archive takes: 1 for a failure, less the further from it, −1 for a point that is not foreseeable or known.
"""

from __future__ import annotations

import numpy as np

from generation.mcsg.edits import coordinated
from generation.mcsg.learner import Learner
from generation.mcsg.settings import McsgSettings
from generation.mcsg.starts import uniform_rows
from generation.search.problem import Problem
from generation.search.quality.archive import Archive
from generation.search.quality.frame import Frame
from xodr.array_types import FloatArray

_COARSE, _FINE = 4, 8
"""Generations after which its edits are refined, and have Gaussian noise"""


class Emitter:
    """See the module."""

    def __init__(self, problem: Problem, frame: Frame, archive: Archive, batch: int, generator: np.random.Generator) -> None:
        self._frame, self._archive, self._batch, self._generator = frame, archive, batch, generator
        self._real = problem.starts
        self._learner = Learner(problem.space, coordinated(problem.space, problem.real), McsgSettings())
        self._generations = 0

    def ask(self, spent: float) -> FloatArray:
        """Edited parents (n, d), or edited real scenarios while there are none; nuisances are those of the edited ones."""
        if self._generations == _COARSE:
            self._learner.refine()
        proposed = self._learner.propose(self._starts(), noise=self._generations >= _FINE)
        self._generations += 1
        return self._frame.prior.with_nuisances(proposed)

    def tell(self, scores: FloatArray) -> None:
        """Learn from what came of them."""
        self._learner.learn(scores)

    def _starts(self) -> FloatArray:
        if not len(self._archive):
            return uniform_rows(self._real, self._batch, self._generator)
        parents = self._archive.parents.sample_elites(self._batch)["solution"]
        return self._frame.points(np.asarray(parents, np.float64))
