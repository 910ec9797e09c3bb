"""Logistic regression, rejected by the distance to the nearest training samples."""

from __future__ import annotations

import numpy as np

from recognition.trfe.inputs.samples import Features
from schemas.common.array_types import IntArray
from studies.recognition.baselines.open_set.knn import KNN

TITLE = "logistic regression, distance to the fifth neighbour"


class Logistic(KNN):
    """A linear classifier of standardised features, rejected as `KNN` is: the plainest method that
    tells unknown classes."""

    def _learn(self, features: Features, indices: IntArray) -> None:
        from sklearn.linear_model import LogisticRegression

        super()._learn(features, indices)
        self._linear = LogisticRegression(max_iter=1000).fit(self._standardise(features), indices)

    def _classify(self, features: Features) -> IntArray:
        return np.asarray(self._linear.predict(self._standardise(features)), dtype=np.int64)


METHOD = Logistic
