"""Open-set methods that judge the votes of a random forest."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from recognition.baselines.method import OpenSetMethod
from recognition.samples import Features, Floats, Whole
from recognition.screening import Screening
from recognition.votes import TREES, forest, votes


class VotingMethod(OpenSetMethod):
    """A forest of the training samples and a screening of its votes, which is calibrated on the validation samples.

    Args:
        seed: of the forest and the screening.
        trees: number of trees.
    """

    def __init__(self, seed: int = 0, trees: int = TREES) -> None:
        super().__init__(seed)
        self.trees = trees

    @abstractmethod
    def _screening(self) -> Screening:
        """The screening, not calibrated yet."""

    def _learn(self, features: Features, indices: Whole) -> None:
        self._forest = forest(features, self.classes[indices], self.trees, self.seed)

    def _calibrate(self, features: Features, labels: Whole) -> None:
        self.screening = self._screening().fit(votes(self._forest, features), labels)

    def _classify(self, features: Features) -> Whole:
        return votes(self._forest, features).argmax(axis=1)

    def score(self, features: Features) -> Floats:
        """Outlyingness of each sample (n,); higher is less like the known classes."""
        return np.asarray(self.screening.score(votes(self._forest, features)))
