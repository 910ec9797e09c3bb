"""Distance to the nearest training samples."""

from __future__ import annotations

import numpy as np

from recognition.trfe.inputs.samples import Features, deviations, unit
from schemas.common.array_types import FloatArray, IntArray
from studies.recognition.baselines.open_set.method import OpenSetMethod

TITLE = "nearest neighbours"

_NEAREST = 5


class KNN(OpenSetMethod):
    """The majority of the nearest training samples, rejected by the distance to the last of them.

    Features are standardised and cut to unit length.

    Sun et al., Out-of-Distribution Detection with Deep Nearest Neighbors, ICML 2022.
    """

    def _learn(self, features: Features, indices: IntArray) -> None:
        from sklearn.neighbors import KNeighborsClassifier

        self._mean, self._deviation = features.mean(axis=0), deviations(features)
        self._model = KNeighborsClassifier(_NEAREST, algorithm="brute").fit(
            self._unit(features), indices
        )

    def _classify(self, features: Features) -> IntArray:
        return np.asarray(self._model.predict(self._unit(features)), dtype=np.int64)

    def score(self, features: Features) -> FloatArray:
        """Distance of each sample to its fifth nearest training sample (n,)."""
        return np.asarray(self._model.kneighbors(self._unit(features))[0][:, -1], dtype=np.float64)

    def _standardise(self, features: Features) -> Features:
        return (features - self._mean) / self._deviation

    def _unit(self, features: Features) -> Features:
        return unit(self._standardise(features))


METHOD = KNN
