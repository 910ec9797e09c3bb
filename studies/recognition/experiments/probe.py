"""Representation probe: how much of the classes a linear classifier finds in features, and how much
in the speed alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recognition.trfe.inputs.grids import VELOCITY_STEP, Grid
from schemas.common.array_types import FloatArray, IntArray
from schemas.common.errors import UsageError

_SPEEDS = np.linspace(0.0, 40.0, 21)
"""Speeds (m/s) about which those of egos are coded, as far apart as the code's bells are wide."""


def probe(
    training: NDArray[np.floating], labels: IntArray, testing: NDArray[np.floating], truth: IntArray
) -> float:
    """Accuracy, as the mean over classes, of a logistic regression on standardised features.

    Args:
        training, labels: features (n, dim) and labels (n,) to fit it on. testing, truth: those to
            test it on.
    """
    from sklearn.linear_model import LogisticRegression
    from sklearn.metrics import balanced_accuracy_score
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    classifier = make_pipeline(
        StandardScaler(), LogisticRegression(max_iter=2000, class_weight="balanced")
    )
    return float(balanced_accuracy_score(truth, classifier.fit(training, labels).predict(testing)))


def speed_code(grids: NDArray[np.uint8], grid: Grid) -> FloatArray:
    """Return features (n, 21) of the ego's speed that a linear classifier can use.

    Raises:
        UsageError: the grids have no channel `speed` to read it from.
    """
    if "speed" not in grid.channels:
        raise UsageError("the ego's speed is read from the channel speed of the grids")
    speed = VELOCITY_STEP * grids[:, :, grid.channels.index("speed")].max(axis=(1, 2, 3)).astype(
        np.float64
    )
    return np.exp(-0.5 * ((speed[:, None] - _SPEEDS) / (_SPEEDS[1] - _SPEEDS[0])) ** 2)
