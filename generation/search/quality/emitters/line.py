"""Isotropic steps from parents, and some of the way to another parent, in whitened coordinates.

A parent that many steps began at is drawn less often than a new one, as what is near it is known by then.

V. Vassiliades and J.-B. Mouret, Discovering the elite hypervolume by leveraging interspecies correlation, 2018; A. Cully and
Y. Demiris, Quality and diversity optimization: a unifying modular framework, 2018 (selection of parents by curiosity).
"""

from __future__ import annotations

from collections import Counter

import numpy as np

from generation.search.problem import Problem
from generation.search.quality.archive import Archive
from generation.search.quality.frame import Frame
from xodr.array_types import FloatArray, IntArray

_ISO, _LINE = 0.5, 0.2
"""Standard deviations of the noise, and of the way along the line as a share of the parents' distance"""
_STEPS = 4.0
"""Steps after which a parent is drawn half as often as a new one"""


class Emitter:
    """See the module."""

    def __init__(self, problem: Problem, frame: Frame, archive: Archive, batch: int, generator: np.random.Generator) -> None:
        self._frame, self._archive, self._batch, self._generator = frame, archive, batch, generator
        self._steps = Counter[bytes]()

    def ask(self, spent: float) -> FloatArray:
        """Points (n, d); until something fails half are draws of the prior, as near misses may lead nowhere."""
        steps = self._batch if self._archive.failures else self._batch // 2 if len(self._archive) else 0
        drawn = self._frame.prior.sample(self._batch - steps, self._generator)
        return np.concatenate([drawn, self._stepped(steps)]) if steps else drawn

    def _stepped(self, n: int) -> FloatArray:
        parents = np.asarray(self._archive.parents.data("solution"), np.float64)
        start, other = parents[self._drawn(parents, n)], parents[self._generator.integers(len(parents), size=n)]
        along = self._generator.normal(0.0, _LINE, (n, 1))
        return self._frame.points(start + self._generator.normal(0.0, _ISO, start.shape) + along * (other - start))

    def _drawn(self, parents: FloatArray, n: int) -> IntArray:
        """Indices (n,) of the parents (m, k) at which the steps begin."""
        names = [each.tobytes() for each in parents]
        weights = 1.0 / (1.0 + np.array([self._steps[name] for name in names]) / _STEPS)
        drawn = self._generator.choice(len(parents), n, p=weights / weights.sum())
        self._steps.update(names[index] for index in drawn)
        return drawn

    def tell(self, scores: FloatArray) -> None:
        """Nothing is learnt."""
