"""What an emitter is."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from generation.search.problem import Problem
from generation.search.quality.archive import Archive
from generation.search.quality.frame import Frame
from xodr.array_types import FloatArray


class Emitter(Protocol):
    """Proposes points, and learns from what came of them."""

    def __init__(self, problem: Problem, frame: Frame, archive: Archive, batch: int, generator: np.random.Generator) -> None: ...

    def ask(self, spent: float) -> FloatArray:
        """Points (n, d), wherever they lie; `spent` is the share of the budget that is spent."""
        ...

    def tell(self, scores: FloatArray) -> None:
        """What came of the points asked for last (n,): 1 for a new failure, less the further from it; −1 where not tried."""
        ...
