"""Reading A with the known classes taken together: a generalised Pareto tail of the votes that the best class lacks."""

from __future__ import annotations

import numpy as np

from recognition.trfe.screening.evt_deficit import EvtDeficit
from xodr.array_types import BoolArray, FloatArray, IntArray


class EvtPooled(EvtDeficit):
    """score = 1 − s, with s(d) as in `EvtDeficit` but one distribution for all known classes, d = T − max_k v_k + U(0, 1).

    With a distribution for each class, the class that trees are most torn about accepts nearly everything: max_k s_k is its own.
    """

    def _lacking(self, votes: IntArray, distances: FloatArray | None, jitter: FloatArray | float) -> FloatArray:
        return super()._lacking(votes.max(axis=1, keepdims=True), distances, jitter)

    def _belongs(self, columns: IntArray) -> BoolArray:
        return np.ones((len(columns), 1), dtype=bool)
