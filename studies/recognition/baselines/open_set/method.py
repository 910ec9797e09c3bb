"""Contract of open-set methods: fitted on features of known classes, they classify, score, and
reject by one rule."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Self

import numpy as np

from recognition.trfe.inputs.samples import UNKNOWN, Features
from schemas.common.array_types import FloatArray, IntArray

FALSE_REJECTION = 0.05
"""Share of known validation samples that the common rejection rule gives up."""


class OpenSetMethod(ABC):
    """An open-set classifier on frozen features.

    Args:
        seed: of everything random in it.

    Attributes:
        threshold: score above which a sample is unknown; set by `fit` so that 5 % of the known
            validation samples are.
    """

    threshold: float

    def __init__(self, seed: int = 0) -> None:
        self.seed = seed

    def fit(
        self,
        features: Features,
        labels: IntArray,
        validation: Features,
        validation_labels: IntArray,
    ) -> Self:
        """Learn the known classes.

        Args:
            features, labels: training samples (n, d), their class ids (n,), all known.
            validation, validation_labels: other samples (m, d) of the same classes, to calibrate
                scores and set the threshold.
        """
        self.classes = np.unique(labels)
        self._learn(features, np.searchsorted(self.classes, labels).astype(np.int64))
        self._calibrate(validation, validation_labels)
        self.threshold = float(np.quantile(self.score(validation), 1.0 - FALSE_REJECTION))
        return self

    @abstractmethod
    def _learn(self, features: Features, indices: IntArray) -> None:
        """Learn from samples whose classes are given as indices into `classes`."""

    def _calibrate(self, features: Features, labels: IntArray) -> None:  # noqa: B027
        """Adapt the score to validation samples, where a method does."""

    @abstractmethod
    def _classify(self, features: Features) -> IntArray:
        """Index of the best known class of each sample (n,)."""

    @abstractmethod
    def score(self, features: Features) -> FloatArray:
        """Outlyingness of each sample (n,); higher is less like the known classes."""

    def classify(self, features: Features) -> IntArray:
        """Id of the best known class of each sample (n,); nothing is rejected."""
        labels: IntArray = self.classes[self._classify(features)]
        return labels

    def predict(self, features: Features) -> IntArray:
        """Class ids (n,), 0 for samples whose score is above the threshold."""
        return np.where(self.score(features) > self.threshold, UNKNOWN, self.classify(features))
