"""Random forests that vote on classes: votes, distances to neighbours as features, path similarity
(RFAP). scikit-learn is imported where trees are grown only."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from threadpoolctl import threadpool_info

from recognition.trfe.forest.trees import Trees
from recognition.trfe.inputs.samples import (
    UNKNOWN,
    Features,
    class_labels,
    deviations,
    drawn_of_each,
    matrix,
)
from schemas.common.array_types import FloatArray, IntArray

TREES = 250


def forest(
    features: ArrayLike,
    labels: ArrayLike,
    trees: int = TREES,
    seed: int = 0,
    background: Features | None = None,
) -> Trees:
    """A forest of `trees` trees fitted on features (n, d) and labels (n,) of at least two classes.

    Args:
        features, labels: samples.
        trees: T.
        seed: of the forest.
        background: other samples (m, d), of none of the classes, for which trees may then vote.

    Raises:
        UsageError: features that are not finite, or labels of fewer than two classes.
    """
    from sklearn.ensemble import RandomForestClassifier  # a second, which voting does not need

    table = matrix(features)
    known = class_labels(labels, len(table), least_classes=2)
    if background is not None:
        table, known = (
            np.concatenate([table, background]),
            np.append(known, np.full(len(background), UNKNOWN)),
        )
    # Threads of scikit-learn (1.9) restore warning filters in any order and may leave none.
    with warnings.catch_warnings():
        grown = RandomForestClassifier(trees, random_state=seed, n_jobs=_threads())
        return Trees.of(grown.fit(table, known))


def _threads() -> int:
    """Threads that numerical libraries may use, such as one in a process of many."""
    return max((library["num_threads"] for library in threadpool_info()), default=1)


def background_of(features: Features, seed: int) -> Features:
    """Samples (2n, d) that are like the given ones (n, d) in each feature but not together.

    In one half each feature is permuted among the samples, in the other each principal component.
    Source: the synthetic second class of Breiman's forests for unlabelled data, see Shi & Horvath,
    "Unsupervised Learning with Random Forest Predictors" (Journal of Computational and Graphical
    Statistics 15, 2006).
    """
    random = np.random.default_rng(seed)
    # With the least number added, features that do not vary become 0 instead of NaN.
    mean, scale = features.mean(axis=0), features.std(axis=0) + np.finfo(np.float32).tiny
    standard = ((features - mean) / scale).astype(np.float64)
    # Half of the background keeps the marginals of features, half those of their principal axes, so
    # that it surrounds classes in both.
    axes = np.linalg.eigh(standard.T @ standard)[1]
    halves = random.permuted(standard, axis=0), random.permuted(standard @ axes, axis=0) @ axes.T
    return (np.concatenate(halves) * scale + mean).astype(np.float32)


_NEAREST = 3
_BLOCK = 1024
"""Samples at a time: enough for one matrix product, few enough for memory."""
_MOST = 400
"""References of a class: more would cost time at each recognition."""


class Neighbours(NamedTuple):
    """Samples of the known classes to measure distances to.

    Trees split at one feature at a time; a sample that lies between classes in many features at
    once looks usual in each. Source of the distance as a measure of novelty: Ramaswamy, Rastogi,
    Shim, "Efficient Algorithms for Mining Outliers from Large Data Sets" (SIGMOD 2000).

    Args:
        references: (r, d), standardised; half precision, which is enough and halves stored models.
        labels: their classes (r,).
        mean, scale: (d,), for standardising.
    """

    references: NDArray[np.float16]
    labels: IntArray
    mean: Features
    scale: Features

    @classmethod
    def fit(cls, features: ArrayLike, labels: ArrayLike, seed: int = 0) -> Self:
        """References drawn among labelled features (n, d).

        Raises:
            UsageError: features that are not finite, labels of no class.
        """
        table = matrix(features)
        truth = class_labels(labels, len(table))
        mean, scale = table.mean(axis=0), deviations(table)
        rows = np.sort(drawn_of_each(truth, _MOST, np.random.default_rng(seed)))
        return cls(_half((table[rows] - mean) / scale), truth[rows], mean, scale)

    def distances(self, features: ArrayLike) -> Features:
        """Logarithm of the mean distance to the three nearest references of each class (n, K).

        A reference is not its own neighbour.
        """
        # Rounded as references are, or a reference would not be at distance 0 from itself.
        half = _half((matrix(features, len(self.mean)) - self.mean) / self.scale)
        standard = half.astype(np.float32)
        references = self.references.astype(np.float32)
        members = [np.flatnonzero(self.labels == label) for label in np.unique(self.labels)]
        return np.concatenate([_distances(part, references, members) for part in _blocks(standard)])

    def extended(self, features: ArrayLike) -> Features:
        """Features (n, d) with their distances beside them: (n, d + K)."""
        return np.concatenate([matrix(features), self.distances(features)], axis=1)


def _half(standard: Features) -> NDArray[np.float16]:
    """Standardised features in half precision.

    A feature that hardly varies in the references can be any number of deviations from them: beyond
    the range it counts as its limit, as infinite distances could not be compared.
    """
    most = np.finfo(np.float16).max
    return np.clip(standard, -most, most).astype(np.float16)


def _blocks(standard: Features) -> list[Features]:
    return [standard[first : first + _BLOCK] for first in range(0, max(len(standard), 1), _BLOCK)]


def _distances(standard: Features, references: Features, members: Sequence[IntArray]) -> Features:
    """Distances of `Neighbours.distances`: |a - b|² as |a|² + |b|² - 2ab, one product for all
    references.

    What is nearest by the product is measured again by differences, so that a reference is at
    distance 0 from itself.

    Args:
        members: rows of the references of each class.
    """
    squares = (references * references).sum(axis=1) - 2.0 * (standard @ references.T)
    return np.stack(
        [_of_class(standard, references, rows, squares[:, rows]) for rows in members], axis=1
    )


def _of_class(
    standard: Features, references: Features, rows: IntArray, squares: Features
) -> Features:
    count = min(_NEAREST + 1, len(rows))
    # One more than needed: a reference that is asked for finds itself.
    near = rows[np.argpartition(squares, count - 1, axis=1)[:, :count]]
    found = np.sort(np.linalg.norm(standard[:, None, :] - references[near], axis=2), axis=1)
    if count == 1:
        return _logarithm(found[:, 0])
    itself = found[:, 0] == 0.0
    return _logarithm(np.where(itself, found[:, 1:].mean(axis=1), found[:, :-1].mean(axis=1)))


def _logarithm(distances: NDArray[np.floating]) -> Features:
    # A sample may repeat a reference, and the logarithm of 0 is no feature.
    return np.log(np.maximum(distances, np.finfo(np.float32).tiny)).astype(np.float32)


class Votes(NamedTuple):
    """Votes of a forest for n samples.

    Args:
        counts: votes for the known classes (n, K).
        distances: to the nearest samples of a class (n,), standardised; None where the forest sees
            features alone.
    """

    counts: IntArray
    distances: FloatArray | None

    def only(self, chosen: NDArray[Any]) -> Votes:
        """The votes on the samples of a mask or index."""
        return Votes(
            self.counts[chosen], None if self.distances is None else self.distances[chosen]
        )


class VotingForest(NamedTuple):
    """A forest that votes.

    Args:
        trees: fitted on features, or on features with distances beside them.
        neighbours: to which distances are measured; None where the trees see features alone.
    """

    trees: Trees
    neighbours: Neighbours | None

    @property
    def classes(self) -> IntArray:
        """Labels of the known classes, ascending."""
        return self.trees.classes[self.trees.classes != UNKNOWN]

    def vote(self, features: ArrayLike) -> Votes:
        """Votes on features (n, d), see `Trees.votes`, and distances to the known classes."""
        seen, classes = self.inputs(features), len(self.classes)
        # The last columns have logarithms of distances, one for each class.
        distances = (
            np.exp(seen[:, -classes:].min(axis=1).astype(np.float64)) if self.neighbours else None
        )
        return Votes(self.trees.votes(seen), distances)

    def inputs(self, features: ArrayLike) -> Features:
        """Return the trees' inputs for features (n, d)."""
        return _inputs(self.neighbours, features)


def _inputs(neighbours: Neighbours | None, features: ArrayLike) -> Features:
    return neighbours.extended(features) if neighbours else matrix(features)


def grow(
    features: Features,
    labels: IntArray,
    *,
    trees: int,
    seed: int = 0,
    background: bool = True,
    neighbours: bool = True,
) -> VotingForest:
    """A forest fitted on features (n, d) and labels (n,) of at least two classes.

    Args:
        features, labels: samples.
        trees: T.
        seed: of everything drawn.
        background: whether trees may vote for none of the classes, having learnt to tell the
            samples from `recognition.trfe.forest.background_of` them.
        neighbours: whether trees see distances to the samples of each class.

    Raises:
        UsageError: features that are not finite, or labels of fewer than two classes.
    """
    near = Neighbours.fit(features, labels, seed) if neighbours else None
    around = _inputs(near, background_of(features, seed)) if background else None
    return VotingForest(forest(_inputs(near, features), labels, trees, seed, around), near)


_ROWS, _TREES = 128, 16
"""Rows of the matrix filled at a time, which stay in the processor's cache while so many trees add
to them; more trees at a time would need more memory for their overlaps."""


def similarity(trees: Trees, features: ArrayLike) -> NDArray[np.float32]:
    """S (n, n) in (0, 1] for features (n, d): symmetric, 1 on its diagonal.

    Raises:
        UsageError: features that are not finite, or not of the dimension of the trees.
    """
    places = trees.leaves(features)
    total = np.zeros((len(places), len(places)), dtype=np.float32)
    for first in range(0, trees.count_of_trees, _TREES):
        paths = []
        for tree in range(first, min(first + _TREES, trees.count_of_trees)):
            # Samples in the same leaf share their path: one product for each leaf is enough.
            reached, leaf = np.unique(places[:, tree], return_inverse=True)
            paths.append((trees.overlap(tree, reached), leaf))
        for start in range(0, len(places), _ROWS):
            rows = slice(start, start + _ROWS)
            part = np.empty_like(total[rows])
            for overlap, leaf in paths:
                # With `clip` take writes into `out` directly; by default it buffers.
                total[rows] += np.take(overlap[leaf[rows]], leaf, axis=1, out=part, mode="clip")
    return total / np.float32(trees.count_of_trees)


def random_trees(features: ArrayLike, trees: int = 250, depth: int = 8, seed: int = 0) -> Trees:
    """Completely random trees grown on features (n, d) without labels: the unsupervised forest for
    `similarity`.

    Source: Geurts, Ernst, Wehenkel, "Extremely Randomized Trees" (Machine Learning 63, 2006), in
    their unsupervised form.
    """
    from sklearn.ensemble import RandomTreesEmbedding

    table = matrix(features, least=2)
    return Trees.of(RandomTreesEmbedding(trees, max_depth=depth, random_state=seed).fit(table))
