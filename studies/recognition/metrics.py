"""Measures of recognition: with all classes known, with unknown ones among them, and for clusters
of these.

Labels are class ids from 1; 0 is unknown. Scores of outlyingness are higher for what looks less
like the known classes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from recognition.trfe.forest.known import macro_f1 as macro_f1
from recognition.trfe.inputs.samples import UNKNOWN
from schemas.common.array_types import IntArray

DROPPED = -1
"""Cluster number of a sample that a method put into no cluster."""


class OpenSet(NamedTuple):
    """Open-set figures, each in [0, 1].

    Attributes:
        closed_accuracy: share of the known samples whose best known class is right, nothing being
            rejected.
        accuracy: share of all samples that are right, unknown being one more class: (K+1) accuracy.
        macro_f1: mean F1 over the known classes and unknown.
        auroc: probability that an unknown sample scores higher than a known one.
        oscr: area under the open-set classification rate curve.
        false_rejection: share of the known samples that are rejected.
    """

    closed_accuracy: float
    accuracy: float
    macro_f1: float
    auroc: float
    oscr: float
    false_rejection: float


def open_set(
    truth: ArrayLike, closed: ArrayLike, scores: ArrayLike, predicted: ArrayLike
) -> OpenSet:
    """All open-set figures of one method.

    Args:
        truth: true labels (n,), 0 for unknown; both kinds must be there.
        closed: best known class of each sample (n,), nothing being rejected.
        scores: outlyingness (n,).
        predicted: labels with the method's rejections (n,), 0 for unknown.
    """
    truth, closed, scores, predicted = (
        np.asarray(values) for values in (truth, closed, scores, predicted)
    )
    known = truth != UNKNOWN
    return OpenSet(
        closed_accuracy=accuracy(truth[known], closed[known]),
        accuracy=accuracy(truth, predicted),
        macro_f1=macro_f1(truth, predicted),
        auroc=auroc(truth, scores),
        oscr=oscr(truth, closed, scores),
        false_rejection=float(np.mean(predicted[known] == UNKNOWN)),
    )


def accuracy(truth: ArrayLike, predicted: ArrayLike) -> float:
    """Share of samples whose label is right."""
    return float(np.mean(np.asarray(truth) == np.asarray(predicted)))


def auroc(truth: ArrayLike, scores: ArrayLike) -> float:
    """Area under the ROC curve of unknown against known; ties count half."""
    from sklearn.metrics import roc_auc_score

    return float(roc_auc_score(np.asarray(truth) == UNKNOWN, scores))


def oscr(truth: ArrayLike, closed: ArrayLike, scores: ArrayLike) -> float:
    """Area under the open-set classification rate curve (Dhamija et al., Reducing Network
    Agnostophobia, NeurIPS 2018).

    At a threshold τ, the correct classification rate is the share of known samples that are rightly
    classified with a score ≤ τ, the false positive rate the share of unknown samples with a score ≤
    τ. Samples of equal score enter together.
    """
    truth, closed, scores = (
        np.asarray(truth),
        np.asarray(closed),
        np.asarray(scores, dtype=np.float64),
    )
    thresholds = np.unique(scores)
    right = np.sort(scores[(truth != UNKNOWN) & (truth == closed)])
    unknown = np.sort(scores[truth == UNKNOWN])
    correct = np.searchsorted(right, thresholds, side="right") / np.count_nonzero(truth != UNKNOWN)
    false_positive = np.searchsorted(unknown, thresholds, side="right") / len(unknown)
    return float(np.trapezoid(np.r_[0.0, correct], np.r_[0.0, false_positive]))


class Clustering(NamedTuple):
    """Agreement of clusters with true classes.

    Attributes:
        accuracy: share of the clustered samples whose cluster is matched with their class.
        accuracy_of_all: the same share of all samples: dropped ones count as wrong.
        unmatched: share of the clustered samples that are in clusters for which no class was left.
        dropped: share of all samples that are in no cluster.
        clusters: number of clusters.
        classes: number of true classes.
        matches: (cluster, class) pairs, by cluster.
    """

    accuracy: float
    accuracy_of_all: float
    unmatched: float
    dropped: float
    clusters: int
    classes: int
    matches: tuple[tuple[int, int], ...]


def clustering(truth: ArrayLike, clusters: ArrayLike, among: ArrayLike | None = None) -> Clustering:
    """Hungarian clustering accuracy: clusters are matched one to one with classes so that most
    samples agree.

    Args:
        truth: true labels (n,).
        clusters: cluster numbers (n,), −1 for samples that are in none.
        among: classes that clusters may be matched with, if not all; samples of others count as
            wrong where clustered.
    """
    from scipy.optimize import linear_sum_assignment

    truth, clusters = np.asarray(truth), np.asarray(clusters)
    matched_classes = np.unique(truth if among is None else among)
    kept = clusters != DROPPED
    classes, numbers, counts = _contingency(truth[kept], clusters[kept])
    counts = counts[:, np.isin(classes, matched_classes)]
    classes = classes[np.isin(classes, matched_classes)]
    rows, columns = linear_sum_assignment(counts, maximize=True)
    agreeing, size = int(counts[rows, columns].sum()), int(kept.sum())
    matched = int(np.isin(clusters[kept], numbers[rows]).sum())
    return Clustering(
        accuracy=agreeing / size if size else 0.0,
        accuracy_of_all=agreeing / len(truth) if len(truth) else 0.0,
        unmatched=1.0 - matched / size if size else 0.0,
        dropped=1.0 - size / len(truth) if len(truth) else 0.0,
        clusters=len(numbers),
        classes=len(matched_classes),
        matches=tuple(
            (int(numbers[row]), int(classes[column]))
            for row, column in zip(rows, columns, strict=True)
        ),
    )


def _contingency(truth: IntArray, clusters: IntArray) -> tuple[IntArray, ...]:
    """Classes, cluster numbers, and how many samples each cluster (row) has of
    each class (column).
    """
    classes, column = np.unique(truth, return_inverse=True)
    numbers, row = np.unique(clusters, return_inverse=True)
    counts = np.zeros((len(numbers), len(classes)), dtype=np.int64)
    np.add.at(counts, (row, column), 1)
    return classes, numbers, counts
