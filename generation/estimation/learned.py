"""Where a system fails, learnt from its runs: what says where to look where no twin plays the scenario.

P. Geurts, D. Ernst, L. Wehenkel, Extremely randomized trees, 2006.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from generation.density.prior import Prior
from generation.search.surrogate import differences
from schemas.extras import optional
from xodr.array_types import BoolArray, FloatArray

_TREES = 100


class Learned:
    """A forest of the parameters that are no nuisances and their differences; of logarithms where the box is positive, so that
    differences are ratios of speeds and headways.

    Args:
        prior: of the columns.
        theta: runs (n, d). failing: which of them failed (n,), one at least, and not all.

    Raises:
        MissingExtra: scikit-learn is not installed.
    """

    def __init__(self, prior: Prior, theta: FloatArray, failing: BoolArray) -> None:
        self._columns = prior.columns(prior.searched)
        self._positive = prior.low[self._columns] > 0.0
        forest: Any = optional("sklearn.ensemble").ExtraTreesClassifier(_TREES, random_state=0)
        self._forest = forest.fit(self._features(theta), failing)

    def _features(self, theta: FloatArray) -> FloatArray:
        rows = theta[:, self._columns]
        rows[:, self._positive] = np.log(rows[:, self._positive])
        return differences(rows)

    def failing(self, theta: FloatArray) -> FloatArray:
        """The share (n,) of the trees, weighed by how sure they are, that take points (n, d) for failures."""
        found: FloatArray = self._forest.predict_proba(self._features(theta))[:, 1]
        return found
