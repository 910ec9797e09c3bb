"""RFAP: similarity of samples as the overlap of their paths through the trees of a forest.

P_b(h) are the nodes from the root to the leaf of h in tree b. S_ij = (1/B) Σ_b lcp_b / (|P_b(i)| + |P_b(j)| − lcp_b) with
lcp_b(i, j) = |P_b(i) ∩ P_b(j)| = (Z_b Z_bᵀ)_ij, where Z_b is the tree's decision path.
Source: Balasubramanian et al., "Traffic Scenario Clustering by Iterative Optimisation of Self-Supervised Networks Using a Random
Forest Activation Pattern Similarity" (IV 2021).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.ensemble import RandomForestClassifier, RandomTreesEmbedding
from sklearn.tree import BaseDecisionTree

from recognition.trfe.samples import Features, matrix
from xodr.array_types import IntArray

_ROWS, _TREES = 128, 16
"""Rows of the matrix filled at a time, which stay in the processor's cache while so many trees add to them; more trees at a
time would need more memory for their overlaps."""


def similarity(forest: RandomForestClassifier | RandomTreesEmbedding, features: ArrayLike) -> NDArray[np.float32]:
    """S (n, n) in (0, 1] for features (n, d): symmetric, 1 on its diagonal.

    Raises:
        UsageError: features that are not finite, or not of the dimension of the forest.
    """
    table = matrix(features, forest.n_features_in_)
    total = np.zeros((len(table), len(table)), dtype=np.float32)
    trees = forest.estimators_
    for chunk in (trees[start : start + _TREES] for start in range(0, len(trees), _TREES)):
        paths = [_overlap(tree, table) for tree in chunk]
        for start in range(0, len(table), _ROWS):
            rows = slice(start, start + _ROWS)
            part = np.empty_like(total[rows])
            for overlap, leaf in paths:
                total[rows] += np.take(overlap[leaf[rows]], leaf, axis=1, out=part, mode="clip")
    return total / np.float32(len(trees))


def _overlap(tree: BaseDecisionTree, table: Features) -> tuple[NDArray[np.float32], IntArray]:
    """Overlap (L, L) of the paths to the L leaves that are reached, and the leaf (n,) of each sample.

    Samples in the same leaf share their path, so one sample of each leaf is enough for the product Z_b Z_bᵀ.
    """
    _, first, leaf = np.unique(tree.tree_.apply(table), return_index=True, return_inverse=True)
    path = tree.tree_.decision_path(table[first]).astype(np.float32)
    common = (path @ path.T).toarray()
    length = common.diagonal()
    return common / (length[:, None] + length[None, :] - common), leaf


def random_trees(features: ArrayLike, trees: int = 250, depth: int = 8, seed: int = 0) -> RandomTreesEmbedding:
    """Completely random trees grown on features (n, d) without labels: the unsupervised forest for `similarity`.

    Source: Geurts, Ernst, Wehenkel, "Extremely Randomized Trees" (Machine Learning 63, 2006), in their unsupervised form.
    """
    return RandomTreesEmbedding(trees, max_depth=depth, random_state=seed).fit(matrix(features, least=2))
