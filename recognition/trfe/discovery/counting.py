"""How many clusters samples likely form."""

from __future__ import annotations

import numpy as np
from sklearn.cluster import KMeans

from recognition.trfe.samples import Features
from xodr.array_types import IntArray

_STRONG = 0.8
"""Prediction strength from which on clusters are taken to be real, as in the source."""
_DIVISIONS = 16
"""How often samples are divided in halves."""


def likely_count(features: Features, most: int, seed: int) -> int:
    """The greatest number of clusters, up to `most`, whose prediction strength is at least 0.8.

    Features (n, d) are divided in halves, k-means clusters each, and the strength is the share of pairs of samples of one cluster
    of a half that the centres of the other half put together too, in the cluster where it is smallest; the mean over
    several divisions. One cluster is as strong as can be.

    Source: Tibshirani & Walther, "Cluster Validation by Prediction Strength" (Journal of Computational and Graphical Statistics
    14, 2005).
    """
    random = np.random.default_rng(seed)
    halves = [np.array_split(random.permutation(len(features)), 2) for _ in range(_DIVISIONS)]
    different = len(np.unique(features, axis=0))
    for count in range(min(most, different // 4), 1, -1):
        strengths = [_strength(features[one], features[other], count, seed) for one, other in halves]
        if np.mean(strengths) >= _STRONG:
            return count
    return 1


def _strength(learnt: Features, judged: Features, count: int, seed: int) -> float:
    """Prediction strength of clusters of one half for another."""
    foretold = KMeans(count, n_init=3, random_state=seed).fit(learnt).predict(judged)
    clusters = KMeans(count, n_init=3, random_state=seed).fit_predict(judged)
    return min(_together(foretold[clusters == one]) for one in range(count))


def _together(foretold: IntArray) -> float:
    """Share of pairs with the same value."""
    pairs = len(foretold) * (len(foretold) - 1)
    return float((np.bincount(foretold) * (np.bincount(foretold) - 1)).sum() / pairs) if pairs else 0.0
