"""Which points are worth a run where no twin plays them: a forest learns from the runs so far how near points come to a failure.

P. Geurts, D. Ernst, L. Wehenkel, Extremely randomized trees, 2006.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.distance import cdist

from generation.outcomes.outcomes import Outcomes, joined
from generation.search.nearness import nearness
from schemas.extras import optional
from xodr.array_types import FloatArray, IntArray

_TREES = 100
FEW = 60
"""Runs from which points are ranked"""
ROUND = 20
"""Runs after which the forest is grown anew"""
_NEAR = 0.1
"""What the nearest miss counts, of a failure: it leads to the first failures, and says little once there are some"""


class Surrogate:
    """Predictions at points x (n, k) of the unit cube, from what runs gave.

    Raises:
        MissingExtra: scikit-learn is not installed.
    """

    def __init__(self) -> None:
        self._ensemble = optional("sklearn.ensemble")
        self._x, self._outcomes = list[FloatArray](), list[Outcomes]()
        self._forest: Any = None
        self._grown = 0

    def __len__(self) -> int:
        """Number of runs that it has learnt from."""
        return sum(map(len, self._outcomes))

    def learn(self, x: FloatArray, outcomes: Outcomes) -> None:
        """Take what runs at points (n, k) gave."""
        self._x.append(x)
        self._outcomes.append(outcomes)

    def ranked(self, x: FloatArray) -> IntArray:
        """Indices of points (n, k), those that come nearest to a failure first; in their order while there are few runs."""
        if len(self) < FEW or not len(x):
            return np.arange(len(x))
        if self._forest is None or len(self) >= self._grown + ROUND:
            self._grow()
        return np.argsort(-self._forest.predict(differences(x)), kind="stable")

    def _grow(self) -> None:
        outcomes = joined(self._outcomes)
        scores = np.where(outcomes.collision & outcomes.executed, 1.0, _NEAR * nearness(outcomes))
        forest = self._ensemble.ExtraTreesRegressor(_TREES, random_state=0)
        self._forest, self._grown = forest.fit(differences(np.concatenate(self._x)), scores), len(self)

    def alike(self, x: FloatArray) -> Outcomes:
        """What the run most like each of the points (n, k) gave; nothing happens in them while there are no runs."""
        if not len(self):
            return Outcomes.of(len(x))
        return joined(self._outcomes).take(np.argmin(cdist(x, np.concatenate(self._x)), axis=1))


def differences(x: FloatArray) -> FloatArray:
    """Coordinates (n, k) and the differences of each two: a tree splits by one value, a failure depends on relative speeds."""
    one, other = np.triu_indices(x.shape[1], 1)
    return np.hstack([x, x[:, one] - x[:, other]])
