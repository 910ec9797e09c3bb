"""k-means beside labelled samples of known classes, and the number of new classes that suits
held-out known ones best."""

from __future__ import annotations

import numpy as np

from recognition.trfe.inputs.samples import Features
from schemas.common.array_types import FloatArray, IntArray

_STARTS, _STEPS = 5, 30
_MOST = 10
"""New classes that one round can hold, as many as TRFE has candidates for"""


def semi_supervised(
    unknown: Features, known: Features, labels: IntArray, count: int, seed: int = 0
) -> IntArray:
    """Cluster (n,) of each unknown sample: 0 to K - 1 for the known classes, ascending, then the
    new ones.

    Labelled samples stay with their class; centres of the new clusters are drawn as in k-means++,
    the best of five starts. Source: Vaze, Han, Vedaldi, Zisserman, "Generalized Category Discovery"
    (CVPR 2022).

    Args:
        unknown, known: features (n, d) and (m, d). labels: classes of the known ones (m,).
        count: new clusters beside the known classes.
    """
    classes, column = np.unique(labels, return_inverse=True)
    sums = np.stack([known[column == number].sum(axis=0) for number in range(len(classes))]).astype(
        np.float64
    )
    sizes, random = np.bincount(column).astype(np.float64), np.random.default_rng(seed)
    tries = [
        _clustered(unknown.astype(np.float64), sums, sizes, count, random) for _ in range(_STARTS)
    ]
    return min(tries, key=lambda one: one[1])[0]


def _clustered(
    unknown: FloatArray,
    sums: FloatArray,
    sizes: FloatArray,
    count: int,
    random: np.random.Generator,
) -> tuple[IntArray, float]:
    """Clusters from one start, and their inertia."""
    centres = sums / sizes[:, None]
    for _ in range(count):
        nearest = _squares(unknown, centres).min(axis=1)
        total = nearest.sum()
        drawn = random.choice(len(unknown), p=nearest / total if total else None)
        centres = np.concatenate([centres, unknown[drawn : drawn + 1]])
    found = np.zeros(len(unknown), np.int64)
    for _ in range(_STEPS):
        before, found = found, _squares(unknown, centres).argmin(axis=1)
        weight = np.bincount(found, minlength=len(centres)).astype(np.float64)
        total = np.zeros_like(centres)
        np.add.at(total, found, unknown)
        weight[: len(sizes)] += sizes
        total[: len(sizes)] += sums
        filled = weight > 0
        centres[filled] = total[filled] / weight[filled, None]
        if np.array_equal(before, found):
            break
    return found, float(_squares(unknown, centres).min(axis=1).sum())


def _squares(samples: FloatArray, centres: FloatArray) -> FloatArray:
    return np.maximum(
        (samples**2).sum(1)[:, None] - 2.0 * samples @ centres.T + (centres**2).sum(1), 0.0
    )


def likely_classes(unknown: Features, known: Features, labels: IntArray, seed: int = 0) -> int:
    """Return the likely number of classes among the unknown samples.

    Half of the known classes lose their labels and join the unknown samples; with the count of
    clusters that suits best, these classes are found again and clusters lie apart: the greatest sum
    of accuracy on the held-out classes and mean silhouette, over both halves. Source: Han, Vedaldi,
    Zisserman, "Learning to Discover Novel Visual Categories via Deep Transfer Clustering" (ICCV
    2019).

    Args:
        unknown, known: features (n, d) and (m, d). labels: classes of the known ones (m,), two or
            more.
    """
    classes = np.unique(labels)
    scores = np.zeros(_MOST)
    for held in (np.isin(labels, classes[0::2]), np.isin(labels, classes[1::2])):
        scores += [
            _score(unknown, known[held], labels[held], known[~held], labels[~held], count, seed)
            for count in range(1, _MOST + 1)
        ]
    return int(scores.argmax()) + 1


def _score(
    unknown: Features,
    held: Features,
    truth: IntArray,
    known: Features,
    labels: IntArray,
    count: int,
    seed: int,
) -> float:
    from sklearn.metrics import silhouette_score

    from studies.recognition.metrics import clustering

    both = np.concatenate([unknown, held])
    found = semi_supervised(both, known, labels, count + len(np.unique(truth)), seed)
    clusters = np.append(found, np.unique(labels, return_inverse=True)[1])
    apart = float(silhouette_score(np.concatenate([both, known]), clusters))
    return clustering(truth, found[len(unknown) :]).accuracy + apart
