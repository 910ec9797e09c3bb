"""The archive of parents: points that fail or come near to it, none much like another by what a tester reads."""

from __future__ import annotations

from typing import Any

import numpy as np

from generation.search.quality.frame import Frame
from schemas.extras import optional
from xodr.array_types import FloatArray

_NOVEL = 0.02
"""Distance of measures from which a point is one more parent"""
_BEST, _ENOUGH = 0.9, 1
"""Quantile of all scores from which a point is a parent, and number of failures from which these are the only parents"""


class Archive:
    """A proximity archive of the library ribs.

    J. Lehman and K. O. Stanley, Abandoning objectives: evolution through the search for novelty alone, 2011.

    Args:
        frame: coordinates of its points.
        seed: of what is drawn from it.

    Attributes:
        parents: the archive of ribs, for its emitters.
        failures: how many points that fail it was given.
    """

    def __init__(self, frame: Frame, measures: int, seed: int) -> None:
        self._frame = frame
        self.parents: Any = ribs("archives").ProximityArchive(
            solution_dim=frame.dimension, measure_dim=measures, k_neighbors=1, novelty_threshold=_NOVEL, local_competition=True,
            seed=seed,
        )  # fmt: skip
        self._scores, self.failures = np.empty(0), 0

    def add(self, theta: FloatArray, scores: FloatArray) -> None:
        """Take points (n, d) with scores (n,) as parents: the best so far, or the failures alone once they are enough."""
        failing = scores >= 1.0
        before, self.failures = self.failures, self.failures + int(failing.sum())
        if before < _ENOUGH:
            self._scores = np.concatenate([self._scores, scores])
            failing |= scores >= float(np.quantile(self._scores, _BEST))
            if self.failures >= _ENOUGH:
                self._forget()
                failing = scores >= 1.0
        if failing.any():
            self.parents.add(self._frame.coordinates(theta[failing]), scores[failing], self._frame.measures(theta[failing]))

    def _forget(self) -> None:
        """Keep the failures alone."""
        found = self.parents.data(["solution", "objective", "measures"])
        self.parents.clear()
        kept = found["objective"] >= 1.0
        if kept.any():
            self.parents.add(*(found[name][kept] for name in ("solution", "objective", "measures")))

    def __len__(self) -> int:
        return len(self.parents)


def ribs(module: str) -> Any:
    """A module of ribs.

    Raises:
        MissingExtra: it is not installed.
    """
    return optional(f"ribs.{module}")
