"""Votes of a random forest: how many of its trees choose each known class.

v_k(h) = Σ_t 1[tree_t(h) = k] over T trees. scikit-learn's `predict_proba` averages the class shares of leaves instead, which
differs from votes as soon as a leaf is impure. Method: Breiman, "Random Forests" (Machine Learning 45, 2001).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from sklearn.ensemble import RandomForestClassifier

from recognition.trfe.samples import UNKNOWN, Features, class_labels, matrix
from xodr.array_types import IntArray

TREES = 250


def forest(
    features: ArrayLike, labels: ArrayLike, trees: int = TREES, seed: int = 0, background: Features | None = None
) -> RandomForestClassifier:
    """A forest of `trees` trees fitted on features (n, d) and labels (n,) of at least two classes.

    Args:
        features, labels: samples.
        trees: T.
        seed: of the forest.
        background: other samples (m, d), of none of the classes, for which trees may then vote.

    Raises:
        UsageError: features that are not finite, or labels of fewer than two classes.
    """
    table = matrix(features)
    known = class_labels(labels, len(table), least_classes=2)
    if background is not None:
        table, known = np.concatenate([table, background]), np.append(known, np.full(len(background), UNKNOWN))
    return RandomForestClassifier(trees, random_state=seed, n_jobs=-1).fit(table, known)


def background_of(features: Features, seed: int) -> Features:
    """Samples (2n, d) that are like the given ones (n, d) in each feature but not together.

    In one half each feature is permuted among the samples, in the other each principal component.
    Source: the synthetic second class of Breiman's forests for unlabelled data, see Shi & Horvath, "Unsupervised Learning with
    Random Forest Predictors" (Journal of Computational and Graphical Statistics 15, 2006).
    """
    random = np.random.default_rng(seed)
    mean, scale = features.mean(axis=0), features.std(axis=0) + np.finfo(np.float32).tiny
    standard = ((features - mean) / scale).astype(np.float64)
    axes = np.linalg.eigh(standard.T @ standard)[1]
    halves = random.permuted(standard, axis=0), random.permuted(standard @ axes, axis=0) @ axes.T
    return (np.concatenate(halves) * scale + mean).astype(np.float32)


def votes(forest: RandomForestClassifier, features: ArrayLike) -> IntArray:
    """Votes (n, K) for features (n, d); the columns are the known classes of the forest, ascending.

    A row adds up to the number of trees, less those that vote for the background.

    Raises:
        UsageError: features that are not finite, or not of the dimension of the forest.
    """
    table = matrix(features, forest.n_features_in_)
    counts = np.zeros((len(table), len(forest.classes_)), dtype=np.int64)
    rows = np.arange(len(table))
    for tree in forest.estimators_:
        counts[rows, tree.tree_.value[tree.tree_.apply(table), 0].argmax(axis=1)] += 1
    return counts[:, forest.classes_ != UNKNOWN]
