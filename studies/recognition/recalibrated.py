"""TRFE's screening with a threshold that follows a shift of the known classes."""

from __future__ import annotations

import numpy as np

from recognition.trfe.forest.screening import MEAN_JITTER, EvtJoint
from schemas.common.array_types import FloatArray, IntArray

_WINDOW = 200
"""Accepted samples that `recalibrate` looks back on."""
_FEWEST_RECENT = 30
"""Accepted samples without which a shift is not judged."""
_COMPARED = 0.9
"""Quantile of deficits by which a shift is judged: lower ones hardly move where most samples have
all votes."""
_STRETCH = 4.0
"""Greatest factor by which recalibration stretches deficits."""


class Recalibrated(EvtJoint):
    """`EvtJoint` whose distributions of deficits are stretched as the accepted samples ask for.

    Args:
        delta, seed: as in `EvtScreening`.
        window: accepted samples that `recalibrate` looks back on.
    """

    def __init__(self, delta: float = 0.05, seed: int = 0, window: int = _WINDOW) -> None:
        super().__init__(delta, seed)
        self.window = window
        self.stretches: FloatArray = np.zeros(0)
        self.recent: list[FloatArray] = []

    def _calibrate(self, votes: IntArray, columns: IntArray, distances: FloatArray | None) -> None:
        super()._calibrate(votes, columns, distances)
        self.stretches = np.ones(len(self.limits))
        self.recent = [np.zeros(0) for _ in self.limits]

    def _judged(self, votes: IntArray, distances: FloatArray | None) -> FloatArray:
        return super()._judged(votes, distances) / self.stretches

    def recalibrate(self, votes: IntArray, distances: FloatArray | None = None) -> None:
        """Follow a shift of the known classes, seen in votes (n, K) and distances (n,) of samples
        without labels.

        The 90th percentile of the deficits of the latest accepted samples, over what it was at
        calibration, stretches the distribution of deficits, never below what was calibrated. The
        share that screening cuts off is left out of the calibration's percentile too, or it would
        be taken for a shift.
        """
        accepted = self.score(votes, distances) <= self.threshold
        lacking = self._lacking(votes, distances, MEAN_JITTER)
        for group in range(len(self.stretches)):
            self.recent[group] = np.append(self.recent[group], lacking[accepted, group])[
                -self.window :
            ]
            if len(self.recent[group]) >= _FEWEST_RECENT:
                usual = np.quantile(self.group(group), _COMPARED * self.threshold)
                self.stretches[group] = np.clip(
                    np.quantile(self.recent[group], _COMPARED) / usual, 1.0, _STRETCH
                )
