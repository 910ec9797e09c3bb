"""Which points are worth a run where no twin plays them: a forest learns from the runs so far how near points come to a failure.

P. Geurts, D. Ernst, L. Wehenkel, Extremely randomized trees, 2006.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.distance import cdist

from generation.outcomes.outcomes import Outcomes, joined
from generation.search.nearness import nearness
from schemas.extras import optional
from xodr.array_types import FloatArray, IntArray

_TREES = 100
_FEW = 60
"""Runs from which points are ranked"""


class Surrogate:
    """Predictions at points x (n, k) of the unit cube, from what runs gave.

    Raises:
        MissingExtra: scikit-learn is not installed.
    """

    def __init__(self) -> None:
        self._ensemble = optional("sklearn.ensemble")
        self._x, self._outcomes = list[FloatArray](), list[Outcomes]()

    def __len__(self) -> int:
        """Number of runs that it has learnt from."""
        return sum(map(len, self._outcomes))

    def learn(self, x: FloatArray, outcomes: Outcomes) -> None:
        """Take what runs at points (n, k) gave."""
        self._x.append(x)
        self._outcomes.append(outcomes)

    def ranked(self, x: FloatArray) -> IntArray:
        """Indices of points (n, k), those that come nearest to a failure first; in their order while there are few runs."""
        if len(self) < _FEW or not len(x):
            return np.arange(len(x))
        outcomes = joined(self._outcomes)
        scores = np.where(outcomes.collision & outcomes.executed, 1.0, nearness(outcomes))
        model = self._ensemble.ExtraTreesRegressor(_TREES, random_state=0).fit(np.concatenate(self._x), scores)
        return np.argsort(-model.predict(x), kind="stable")

    def alike(self, x: FloatArray) -> Outcomes:
        """What the run most like each of the points (n, k) gave; nothing happens in them while there are no runs."""
        if not len(self):
            return Outcomes.of(len(x))
        return joined(self._outcomes).take(np.argmin(cdist(x, np.concatenate(self._x)), axis=1))
