"""Representation probe: how much of the classes a linear classifier finds in features, and how much in the speed alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recognition.grids import Grid
from schemas.errors import UsageError

_SPEEDS = np.linspace(0.0, 40.0, 21)
"""Speeds (m/s) about which those of egos are coded, as far apart as the code's bells are wide."""


def probe(
    training: NDArray[np.floating], labels: NDArray[np.int64], testing: NDArray[np.floating], truth: NDArray[np.int64]
) -> float:
    """Accuracy, as the mean over classes, of a logistic regression on standardised features.

    Args:
        training, labels: features (n, dim) and labels (n,) to fit it on. testing, truth: those to test it on.
    """
    from sklearn.linear_model import LogisticRegression
    from sklearn.metrics import balanced_accuracy_score
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    classifier = make_pipeline(StandardScaler(), LogisticRegression(max_iter=300, class_weight="balanced"))
    return float(balanced_accuracy_score(truth, classifier.fit(training, labels).predict(testing)))


def speed_code(grids: NDArray[np.uint8], grid: Grid) -> NDArray[np.float64]:
    """What is to be known of the classes from the ego's speed: features (n, 21) of it that a linear classifier can use.

    The speed is how far the ego's box moves from the first to the last frame: the grids need the channel `ego`, in the pose
    of the window.

    Raises:
        UsageError: they have not.
    """
    if "ego" not in grid.channels or grid.pose != "window":
        raise UsageError("the ego's speed shows in grids with the channel ego in the window's pose only")
    ego = grids[:, :: grid.frames - 1, grid.channels.index("ego")].astype(np.float64)
    rows, columns = np.indices(grid.cells)
    mass = np.maximum(ego.sum(axis=(2, 3)), 1.0)
    along = (ego * columns).sum(axis=(2, 3)) / mass * grid.cell_length
    across = (ego * rows).sum(axis=(2, 3)) / mass * grid.cell_width
    speed = np.hypot(along[:, 1] - along[:, 0], across[:, 1] - across[:, 0]) / grid.span
    return np.exp(-0.5 * ((speed[:, None] - _SPEEDS) / (_SPEEDS[1] - _SPEEDS[0])) ** 2)
