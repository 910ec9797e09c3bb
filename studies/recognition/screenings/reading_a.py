"""Reading A of RF-EVT: a generalised Pareto tail of the votes that the true class lacks, for each
class."""

from __future__ import annotations

import numpy as np

from recognition.trfe.forest.screening import EvtScreening
from schemas.common.array_types import BoolArray, FloatArray, IntArray

TITLE = "reading A of plain votes"
PLAIN_VOTES = True


class EvtDeficit(EvtScreening):
    """score = 1 − max_k s_k, with d = T − v_k + U(0, 1), the votes that class k lacks, and a
    distribution for each class."""

    def _lacking(
        self, votes: IntArray, distances: FloatArray | None, jitter: FloatArray | float
    ) -> FloatArray:
        return self.trees - votes + np.reshape(jitter, (-1, 1))

    def _belongs(self, columns: IntArray) -> BoolArray:
        return columns[:, None] == np.arange(len(self.classes))


SCREENING = EvtDeficit
