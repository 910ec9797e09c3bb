"""Votes alone, with the known classes taken together: a generalised Pareto tail of the votes that
the best class lacks."""

from __future__ import annotations

import numpy as np

from recognition.trfe.forest.screening import EvtScreening
from schemas.common.array_types import BoolArray, FloatArray, IntArray

TITLE = "TRFE, votes alone"
PLAIN_VOTES = False


class EvtPooled(EvtScreening):
    """score = 1 − s, with d = T − max_k v_k + U(0, 1) and one distribution for
    all known classes.
    """

    def _lacking(
        self, votes: IntArray, distances: FloatArray | None, jitter: FloatArray | float
    ) -> FloatArray:
        return self.trees - votes.max(axis=1, keepdims=True) + np.reshape(jitter, (-1, 1))

    def _belongs(self, columns: IntArray) -> BoolArray:
        return np.ones((len(columns), 1), dtype=bool)


SCREENING = EvtPooled
