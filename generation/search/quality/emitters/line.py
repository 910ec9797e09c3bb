"""Isotropic steps from parents, and some of the way to another parent, in whitened coordinates.

V. Vassiliades and J.-B. Mouret, Discovering the elite hypervolume by leveraging interspecies correlation, 2018.
"""

from __future__ import annotations

import numpy as np

from generation.search.problem import Problem
from generation.search.quality.archive import Archive, ribs
from generation.search.quality.frame import Frame
from xodr.array_types import FloatArray

_ISO, _LINE = 0.5, 0.2
"""Standard deviations of the noise, and of the way along the line as a share of the parents' distance"""


class Emitter:
    """See the module."""

    def __init__(self, problem: Problem, frame: Frame, archive: Archive, batch: int, generator: np.random.Generator) -> None:
        self._frame, self._archive, self._batch, self._generator = frame, archive, batch, generator
        self._own = ribs("emitters").IsoLineEmitter(
            archive.parents, iso_sigma=_ISO, line_sigma=_LINE, x0=np.zeros(frame.dimension), batch_size=batch,
            seed=int(generator.integers(2**31)),
        )  # fmt: skip

    def ask(self, spent: float) -> FloatArray:
        """Points (n, d); draws of the prior while there are no parents."""
        if not len(self._archive):
            return self._frame.prior.sample(self._batch, self._generator)
        return self._frame.points(self._own.ask())

    def tell(self, scores: FloatArray) -> None:
        """Nothing is learnt."""
