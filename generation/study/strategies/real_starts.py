"""Episodes of MCSG that all start from real scenarios."""

from __future__ import annotations

import numpy as np

from generation.mcsg.settings import McsgSettings
from generation.mcsg.starts import uniform_rows
from generation.outcomes.outcomes import Episodes
from generation.search.problem import Problem
from xodr.array_types import FloatArray


class RealStarts:
    """Real scenarios, or what was found before; no episode is carried on."""

    def __init__(self, problem: Problem, settings: McsgSettings) -> None:
        self._starts = problem.starts

    def add(self, episodes: Episodes) -> None:
        """Episodes change nothing."""

    def draw(self, n: int, spent: float, generator: np.random.Generator) -> FloatArray:
        """Starts (n, d)."""
        return uniform_rows(self._starts, n, generator)
