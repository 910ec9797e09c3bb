"""Distances to the nearest samples of each known class: what trees need to see that a sample is far from all of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recognition.trfe.samples import Features, class_labels, deviations, drawn_of_each, matrix
from xodr.array_types import IntArray

_NEAREST = 3
_BLOCK = 1024
"""Samples at a time: enough for one matrix product, few enough for memory."""
_MOST = 400
"""References of a class: more would cost time at each recognition."""


class Neighbours(NamedTuple):
    """Samples of the known classes to measure distances to.

    Trees split at one feature at a time; a sample that lies between classes in many features at once looks usual in each.
    Source of the distance as a measure of novelty: Ramaswamy, Rastogi, Shim, "Efficient Algorithms for Mining Outliers from Large
    Data Sets" (SIGMOD 2000).

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
        return cls(((table[rows] - mean) / scale).astype(np.float16), truth[rows], mean, scale)

    def distances(self, features: ArrayLike) -> Features:
        """Logarithm of the mean distance to the three nearest references of each class (n, K).

        A reference is not its own neighbour.
        """
        standard = ((matrix(features, len(self.mean)) - self.mean) / self.scale).astype(np.float16).astype(np.float32)
        references = self.references.astype(np.float32)
        members = [np.flatnonzero(self.labels == label) for label in np.unique(self.labels)]
        return np.concatenate([_distances(part, references, members) for part in _blocks(standard)])

    def extended(self, features: ArrayLike) -> Features:
        """Features (n, d) with their distances beside them: (n, d + K)."""
        return np.concatenate([matrix(features), self.distances(features)], axis=1)


def _blocks(standard: Features) -> list[Features]:
    return [standard[first : first + _BLOCK] for first in range(0, max(len(standard), 1), _BLOCK)]


def _distances(standard: Features, references: Features, members: Sequence[IntArray]) -> Features:
    """As of `Neighbours.distances`: |a - b|² as |a|² + |b|² - 2ab, one product for all references.

    What is nearest by the product is measured again by differences, so that a reference is at distance 0 from itself.

    Args:
        members: rows of the references of each class.
    """
    squares = (references * references).sum(axis=1) - 2.0 * (standard @ references.T)
    return np.stack([_of_class(standard, references, rows, squares[:, rows]) for rows in members], axis=1)


def _of_class(standard: Features, references: Features, rows: IntArray, squares: Features) -> Features:
    count = min(_NEAREST + 1, len(rows))
    near = rows[np.argpartition(squares, count - 1, axis=1)[:, :count]]
    found = np.sort(np.linalg.norm(standard[:, None, :] - references[near], axis=2), axis=1)
    if count == 1:
        return _logarithm(found[:, 0])
    itself = found[:, 0] == 0.0
    return _logarithm(np.where(itself, found[:, 1:].mean(axis=1), found[:, :-1].mean(axis=1)))


def _logarithm(distances: NDArray[np.floating]) -> Features:
    return np.log(np.maximum(distances, np.finfo(np.float32).tiny)).astype(np.float32)
