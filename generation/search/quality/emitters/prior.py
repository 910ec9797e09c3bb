"""Draws from the prior: what traffic does, whatever was found so far."""

from __future__ import annotations

import numpy as np

from generation.search.problem import Problem
from generation.search.quality.archive import Archive
from generation.search.quality.frame import Frame
from xodr.array_types import FloatArray


class Emitter:
    """See the module."""

    def __init__(self, problem: Problem, frame: Frame, archive: Archive, batch: int, generator: np.random.Generator) -> None:
        self._prior, self._batch, self._generator = frame.prior, batch, generator

    def ask(self, spent: float) -> FloatArray:
        """Draws (n, d)."""
        return self._prior.sample(self._batch, self._generator)

    def tell(self, scores: FloatArray) -> None:
        """Nothing is learnt."""
