"""An evolution strategy with covariance matrix adaptation towards failures, begun anew from another parent when it stands still.

N. Hansen, The CMA evolution strategy: a tutorial, 2016; M. C. Fontaine et al., Covariance matrix adaptation for the rapid
illumination of behavior space, 2020.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from generation.search.problem import Problem
from generation.search.quality.archive import Archive, ribs
from generation.search.quality.frame import Frame
from xodr.array_types import FloatArray

_SIGMA = 0.3
"""First standard deviation of its steps, in whitened coordinates"""


class Emitter:
    """See the module."""

    def __init__(self, problem: Problem, frame: Frame, archive: Archive, batch: int, generator: np.random.Generator) -> None:
        self._frame, self._archive, self._batch = frame, archive, batch
        self._seed = int(generator.integers(2**31))
        self._own: Any = None
        self._rows = np.empty((0, frame.dimension))

    def ask(self, spent: float) -> FloatArray:
        """Points (n, d); none while there are no parents."""
        if self._own is None and len(self._archive):
            start = self._archive.parents.sample_elites(1)["solution"][0]
            self._own = ribs("emitters").EvolutionStrategyEmitter(
                self._archive.parents, x0=start, sigma0=_SIGMA, ranker="obj", selection_rule="mu", batch_size=self._batch,
                seed=self._seed,
            )  # fmt: skip
        self._rows = self._own.ask() if self._own is not None else np.empty((0, self._frame.dimension))
        return self._frame.points(self._rows)

    def tell(self, scores: FloatArray) -> None:
        """Move towards the better half."""
        if len(scores):
            measures = np.zeros((len(scores), self._archive.parents.measure_dim))
            self._own.tell(self._rows, scores, measures, {"status": (scores >= 1.0).astype(int), "value": scores})
