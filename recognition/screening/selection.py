"""Choosing δ of the vote-based screening: each known class plays the unknown one in turn."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recognition.samples import class_labels, matrix
from recognition.screening.evt_deficit import EvtDeficit
from recognition.voters import grow

DELTAS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2)
FEWEST_CLASSES = 3
"""Without one of two classes, the trees have nothing to choose between."""


def choose_delta(
    features: ArrayLike,
    labels: ArrayLike,
    calibration: ArrayLike,
    calibration_labels: ArrayLike,
    *,
    reading: type[EvtDeficit] = EvtDeficit,
    background: bool = False,
    neighbours: bool = False,
    trees: int = 100,
    deltas: Sequence[float] = DELTAS,
    seed: int = 0,
) -> float:
    """The δ with the greatest balanced accuracy, the mean over the classes left out one by one.

    Balanced accuracy is the mean of two shares: known samples accepted, samples of the class left out rejected. Each time,
    half of the calibration samples calibrate and the other half are judged.

    Args:
        features, labels: samples (n, d) to fit forests on, their classes (n,).
        calibration, calibration_labels: other samples (m, d) of the same classes.
        reading: of which δ is chosen.
        background, neighbours: of the forests, see `recognition.voters.grow`.
        trees: of each forest.
        deltas: candidates; of equally good ones the first is taken.
        seed: of forests, halves and jitter.

    Raises:
        UsageError: fewer than three known classes, or features that are not finite.
    """
    table, held = matrix(features), matrix(calibration)
    known = class_labels(labels, len(table), FEWEST_CLASSES)
    truth = class_labels(calibration_labels, len(held), FEWEST_CLASSES)
    half = np.random.default_rng(seed).permutation(len(held)) % 2 == 0
    gains = []
    for out in np.unique(known):
        grown = grow(
            table[known != out], known[known != out], trees=trees, seed=seed, background=background, neighbours=neighbours
        )
        cast = grown.votes(held)
        calibrating = half & (truth != out)
        judged = ~half | (truth == out)
        score = reading(seed=seed).fit(cast[calibrating], truth[calibrating], trees).score(cast[judged])
        gains.append([_balanced_accuracy(score > 1.0 - delta, truth[judged] == out) for delta in deltas])
    return float(deltas[int(np.mean(gains, axis=0).argmax())])


def _balanced_accuracy(rejected: NDArray[np.bool_], unknown: NDArray[np.bool_]) -> float:
    return float(0.5 * (rejected[unknown].mean() + (~rejected[~unknown]).mean()))
