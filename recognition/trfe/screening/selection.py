"""Choosing δ of the screening: each known class plays the unknown one in turn."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from recognition.trfe.forest.voting import VotingForest
from recognition.trfe.forest.voting import grow as grow_forest
from recognition.trfe.samples import UNKNOWN, class_labels, drawn_of_each, matrix
from recognition.trfe.screening.base import Screening
from recognition.trfe.screening.evt_joint import EvtJoint

DELTAS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2)
FEWEST_CLASSES = 3
"""Without one of two classes, the trees have nothing to choose between."""
_MOST = 60
"""Samples of each class that forests are fitted on here: there is one forest for each class."""


def choose_delta(
    features: ArrayLike,
    labels: ArrayLike,
    calibration: ArrayLike,
    calibration_labels: ArrayLike,
    *,
    grow: Callable[..., VotingForest] = grow_forest,
    screening: Callable[[float, int], Screening] = EvtJoint,
    trees: int = 100,
    deltas: Sequence[float] = DELTAS,
    seed: int = 0,
) -> float:
    """The δ with the greatest macro-F1 over the known classes and unknown, the mean over the classes left out one by one.

    Macro-F1 is what open-set recognition is judged by; with balanced accuracy in its place δ grows too large for many classes,
    where a sample rejected by mistake costs more than one accepted by mistake. Each time, half of the calibration samples
    calibrate and the other half are judged; classes of which that half has no sample calibrate with all they have.

    Args:
        features, labels: samples (n, d) to fit forests on, their classes (n,).
        calibration, calibration_labels: other samples (m, d) of the same classes.
        grow, screening: forest and screening, see `recognition.trfe.steps.Steps`; a sample is unknown where the score exceeds
            1 − δ.
        trees: of each forest.
        deltas: candidates; of equally good ones the first is taken.
        seed: of forests, halves and jitter.

    Raises:
        UsageError: fewer than three known classes, or features that are not finite.
    """
    table, held = matrix(features), matrix(calibration)
    known = class_labels(labels, len(table), FEWEST_CLASSES)
    truth = class_labels(calibration_labels, len(held), FEWEST_CLASSES)
    random = np.random.default_rng(seed)
    half = random.permutation(len(held)) % 2 == 0
    half |= ~np.isin(truth, truth[half])
    rows = np.sort(drawn_of_each(known, _MOST, random))
    gains = []
    for out in np.unique(known):
        kept = rows[known[rows] != out]
        forest = grow(table[kept], known[kept], trees=trees, seed=seed)
        votes, left_out = forest.vote(held), truth == out
        calibrating, judged = half & ~left_out, ~half | left_out
        usual, tried = votes.only(calibrating), votes.only(judged)
        fitted = screening(deltas[0], seed).fit(usual.counts, truth[calibrating], trees, usual.distances)
        score, best = fitted.score(*tried), forest.classes[tried.counts.argmax(axis=1)]
        expected = np.where(left_out, UNKNOWN, truth)[judged]
        gains.append([macro_f1(expected, np.where(score > 1.0 - delta, UNKNOWN, best)) for delta in deltas])
    return float(deltas[int(np.mean(gains, axis=0).argmax())])


def macro_f1(truth: ArrayLike, predicted: ArrayLike) -> float:
    """Mean F1 over all labels that occur in `truth`, unknown among them."""
    from sklearn.metrics import f1_score

    return float(f1_score(truth, predicted, labels=np.unique(truth), average="macro", zero_division=0.0))
