"""Votes of a random forest: how many of its trees choose each known class.

v_k(h) = Σ_t 1[tree_t(h) = k] over T trees. scikit-learn's `predict_proba` averages the class shares of leaves instead, which
differs from votes as soon as a leaf is impure. Method: Breiman, "Random Forests" (Machine Learning 45, 2001).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from sklearn.ensemble import RandomForestClassifier

from recognition.samples import Whole, class_labels, matrix

TREES = 250


def forest(features: ArrayLike, labels: ArrayLike, trees: int = TREES, seed: int = 0) -> RandomForestClassifier:
    """A forest of `trees` trees fitted on features (n, d) and labels (n,) of at least two classes.

    Raises:
        UsageError: features that are not finite, or labels of fewer than two classes.
    """
    table = matrix(features)
    return RandomForestClassifier(trees, random_state=seed, n_jobs=-1).fit(
        table, class_labels(labels, len(table), least_classes=2)
    )


def votes(forest: RandomForestClassifier, features: ArrayLike) -> Whole:
    """Votes (n, K) for features (n, d); the columns are the classes in the order of `forest.classes_`.

    Raises:
        UsageError: features that are not finite, or not of the dimension of the forest.
    """
    table = matrix(features, forest.n_features_in_)
    counts = np.zeros((len(table), len(forest.classes_)), dtype=np.int64)
    rows = np.arange(len(table))
    for tree in forest.estimators_:
        choice = tree.tree_.value[:, 0, :].argmax(axis=1)
        counts[rows, choice[tree.tree_.apply(table)]] += 1
    return counts
