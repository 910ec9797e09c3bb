"""TRFE's screening: a generalised Pareto tail for votes and one for distances, judged together by Fisher's combination."""

from __future__ import annotations

import numpy as np
from scipy.special import xlogy

from recognition.trfe.screening.evt import EvtScreening
from schemas.errors import UsageError
from xodr.array_types import BoolArray, FloatArray, IntArray


class EvtJoint(EvtScreening):
    """score = 1 − p, with p = q (1 − ln q), q = s(d) · s(r): Fisher's combined significance of both survivals.

    s(d) is that of d = T − max_k v_k + U(0, 1), the votes that the best class lacks, for all known classes together: with a
    distribution for each class, the class that trees are most torn about would accept nearly everything. s(r) is that of the
    distance r to the nearest known samples, in the same form. Trees split at one feature at a time and see little of what lies
    between the classes; distances weigh all features alike and see little of what matters for a class.
    Source: Fisher, "Statistical Methods for Research Workers" (1932), § 21.1; for the distance Sun et al., "Out-of-Distribution
    Detection with Deep Nearest Neighbors" (ICML 2022).
    """

    def _lacking(self, votes: IntArray, distances: FloatArray | None, jitter: FloatArray | float) -> FloatArray:
        if distances is None:
            raise UsageError("the joint screening looks at distances: it needs trees that see them")
        return np.column_stack([self.trees - votes.max(axis=1, keepdims=True) + np.reshape(jitter, (-1, 1)), distances])

    def _belongs(self, columns: IntArray) -> BoolArray:
        return np.ones((len(columns), 2), dtype=bool)

    def _score(self, votes: IntArray, distances: FloatArray | None) -> FloatArray:
        both = self.similarities(votes, distances).prod(axis=1)
        return 1.0 - both + xlogy(both, both)
