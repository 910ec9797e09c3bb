"""Reading B of the vote-based screening (CEVT): a Weibull distribution of the winning class's
votes."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from recognition.trfe.forest.screening import Screening
from schemas.common.array_types import FloatArray, IntArray

TITLE = "CEVT (reading B)"
PLAIN_VOTES = True

_STEEPEST = 1e4
"""Greatest shape: a class whose votes hardly vary is fitted by a step."""


class WeibullVotes(Screening):
    """score = 1 − F_k(m) with m = max_k v_k + jitter, k its class and F_k(m) = 1 −
    exp(−(m/λ_k)^c_k); unknown where F_k(m) < δ.

    F_k is the Weibull distribution of greatest likelihood for the calibration samples of class k.
    Votes are whole numbers and often all T; calibration adds U(0, 1) to them, scoring the mean of
    it, 0.5. Reference: Balasubramanian et al., "Open-set Recognition based on the Combination of
    Deep Learning and Ensemble Method for Detecting Unknown Traffic Scenarios" (IV 2021).

    Args:
        delta: samples below this quantile of the winning class's votes are unknown.
        seed: of the jitter.
    """

    def __init__(self, delta: float = 0.05, seed: int = 0) -> None:
        super().__init__(threshold=1.0 - delta)
        self.seed = seed
        self.shapes: FloatArray = np.zeros(0)
        self.scales: FloatArray = np.zeros(0)

    def _calibrate(self, votes: IntArray, columns: IntArray, distances: FloatArray | None) -> None:
        most = votes.max(axis=1) + np.random.default_rng(self.seed).random(len(votes))
        fits = [weibull(most[columns == column]) for column in range(len(self.classes))]
        self.shapes, self.scales = np.array(fits).T

    def _score(self, votes: IntArray, distances: FloatArray | None) -> FloatArray:
        column = votes.argmax(axis=1)
        ratio = (votes.max(axis=1) + 0.5) / self.scales[column]
        with np.errstate(
            over="ignore"
        ):  # where votes hardly vary the power is beyond floats, and the score 0
            return np.exp(-(ratio ** self.shapes[column]))


def weibull(values: FloatArray) -> tuple[float, float]:
    """Shape c and scale λ of the two-parameter Weibull distribution of greatest likelihood for
    positive values.

    c solves Σ x^c ln x / Σ x^c − 1/c = mean ln x, and λ = (mean x^c)^(1/c).
    """
    greatest = values.max()
    logs = np.log(values / greatest)

    def slope(shape: float) -> float:
        weights = np.exp(shape * logs)
        return float((weights * logs).sum() / weights.sum() - 1.0 / shape - logs.mean())

    shape = _STEEPEST if slope(_STEEPEST) <= 0.0 else float(brentq(slope, 1e-3, _STEEPEST))
    return shape, float(greatest * np.exp(shape * logs).mean() ** (1.0 / shape))


SCREENING = WeibullVotes
