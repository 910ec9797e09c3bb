"""Guessing, the row that every other has to beat."""

from __future__ import annotations

import numpy as np

from recognition.trfe.inputs.samples import Features
from schemas.common.array_types import FloatArray, IntArray
from studies.recognition.baselines.open_set.method import OpenSetMethod

TITLE = "random"


class Chance(OpenSetMethod):
    """A known class drawn by its share of the training samples; a score drawn uniformly from [0,
    1)."""

    def _learn(self, features: Features, indices: IntArray) -> None:
        self._shares = np.bincount(indices) / len(indices)

    def _classify(self, features: Features) -> IntArray:
        return np.random.default_rng([self.seed, 0]).choice(
            len(self._shares), size=len(features), p=self._shares
        )

    def score(self, features: Features) -> FloatArray:
        """Random outlyingness of each sample (n,), the same at every call."""
        return np.random.default_rng([self.seed, 1]).random(len(features))


METHOD = Chance
