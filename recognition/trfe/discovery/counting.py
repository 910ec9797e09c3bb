"""How many clusters samples likely form."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from sklearn.cluster import KMeans

from recognition.trfe.samples import Features
from xodr.array_types import FloatArray, IntArray

_STABLE = 0.65
"""Prediction strength from which on clusters are taken to be real. The source has 0.8 to 0.9, which one class of two kinds in a
hundred samples seldom reaches."""
_DIVISIONS = 16
"""How often samples are divided in halves."""


def likely_count(features: Features, most: int, seed: int) -> int:
    """The number of clusters, up to `most`, at which the inertia of k-means bends most, among those that are stable.

    Stable are numbers whose prediction strength is at least 0.65: features (n, d) are divided in halves, k-means clusters each,
    and the strength is the share of pairs of samples of one cluster of a half that the centres of the other half put together
    too, in the cluster where it is smallest; the mean over several divisions. Parts of a class can be as stable as classes are,
    but further clusters gain little by then: the bend is the second difference of the inertia's logarithm, and counts by the
    strength. One cluster is taken where no greater number is stable.

    Source: Tibshirani & Walther, "Cluster Validation by Prediction Strength" (Journal of Computational and Graphical Statistics
    14, 2005); the bend after Thorndike, "Who Belongs in the Family?" (Psychometrika 18, 1953).
    """
    random = np.random.default_rng(seed)
    halves = [np.array_split(random.permutation(len(features)), 2) for _ in range(_DIVISIONS)]
    bends = _bends(features, max(min(most, len(np.unique(features, axis=0)) // 4) - 1, 0), seed)
    found, best = 1, -np.inf
    for index in np.argsort(-bends, kind="stable").tolist():
        count, bend = index + 2, bends[index]
        if max(bend, _STABLE * bend) > best:  # strengths are from 0.65 to 1: no other can win
            strength = _stable_strength(features, halves, count, seed)
            if strength is not None and strength * bend > best:
                found, best = count, strength * bend
    return found


def _stable_strength(features: Features, halves: Sequence[Sequence[IntArray]], count: int, seed: int) -> float | None:
    """The mean strength of a number of clusters over divisions; None as soon as it can't become that of a stable one."""
    strengths: list[float] = []
    for one, other in halves:
        strengths.append(_strength(features[one], features[other], count, seed))
        if sum(strengths) + len(halves) - len(strengths) < _STABLE * len(halves):
            return None
    mean = float(np.mean(strengths))
    return mean if mean >= _STABLE else None


def _bends(features: Features, counts: int, seed: int) -> FloatArray:
    """How much the inertia of k-means bends at each of so many numbers of clusters, from two on."""
    if not counts:
        return np.zeros(0)
    inertia = [KMeans(count, n_init=5, random_state=seed).fit(features).inertia_ for count in range(1, counts + 3)]
    return np.diff(np.log(inertia), 2)


def _strength(learnt: Features, judged: Features, count: int, seed: int) -> float:
    """Prediction strength of clusters of one half for another."""
    foretold = KMeans(count, n_init=3, random_state=seed).fit(learnt).predict(judged)
    clusters = KMeans(count, n_init=3, random_state=seed).fit_predict(judged)
    return min(_together(foretold[clusters == one]) for one in range(count))


def _together(foretold: IntArray) -> float:
    """Share of pairs with the same value."""
    pairs = len(foretold) * (len(foretold) - 1)
    return float((np.bincount(foretold) * (np.bincount(foretold) - 1)).sum() / pairs) if pairs else 0.0
