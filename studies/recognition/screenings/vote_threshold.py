"""The plain threshold on the greatest number of votes: what an elaborate screening has to beat."""

from __future__ import annotations

import numpy as np

from recognition.trfe.forest.screening import Screening
from schemas.common.array_types import FloatArray, IntArray

TITLE = "plain vote threshold"
PLAIN_VOTES = True


class VoteThreshold(Screening):
    """score = 1 − max_k v_k / T; unknown where it exceeds the (1 − `rejection`) quantile of the
    calibration samples' scores.

    Reference: Hendrycks & Gimpel, "A Baseline for Detecting Misclassified and Out-of-Distribution
    Examples" (ICLR 2017), with shares of votes in place of softmax.

    Args:
        rejection: share of the calibration samples that is rejected at most.
        seed: has no effect, nothing is drawn.
    """

    def __init__(self, rejection: float = 0.05, seed: int = 0) -> None:
        super().__init__(threshold=1.0)
        self.rejection = rejection

    def _calibrate(self, votes: IntArray, columns: IntArray, distances: FloatArray | None) -> None:
        self.threshold = float(
            np.quantile(self._score(votes), 1.0 - self.rejection, method="higher")
        )

    def _score(self, votes: IntArray, distances: FloatArray | None = None) -> FloatArray:
        return 1.0 - votes.max(axis=1) / self.trees


SCREENING = VoteThreshold
