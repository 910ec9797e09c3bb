"""A forest that votes for the known classes, with all that its trees look at: features, and distances to the classes."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.ensemble import RandomForestClassifier

from recognition.trfe.forest import votes
from recognition.trfe.forest.neighbours import Neighbours
from recognition.trfe.samples import UNKNOWN, Features, matrix
from xodr.array_types import FloatArray, IntArray


class Votes(NamedTuple):
    """What a forest finds in n samples.

    Args:
        counts: votes for the known classes (n, K).
        distances: to the nearest samples of a class (n,), standardised; None where the forest sees features alone.
    """

    counts: IntArray
    distances: FloatArray | None

    def only(self, chosen: NDArray[Any]) -> Votes:
        """The votes on the samples of a mask or index."""
        return Votes(self.counts[chosen], None if self.distances is None else self.distances[chosen])


class VotingForest(NamedTuple):
    """A forest that votes.

    Args:
        trees: fitted on features, or on features with distances beside them.
        neighbours: to which distances are measured; None where the trees see features alone.
        stored: content of the file that the trees were read from; None for trees that no file has yet.
    """

    trees: RandomForestClassifier
    neighbours: Neighbours | None
    stored: bytes | None = None

    @property
    def classes(self) -> IntArray:
        """Labels of the known classes, ascending."""
        classes = np.asarray(self.trees.classes_)
        return classes[classes != UNKNOWN]

    def vote(self, features: ArrayLike) -> Votes:
        """Votes on features (n, d), see `recognition.trfe.forest.votes.votes`, and distances to the known classes."""
        seen, classes = self.inputs(features), len(self.classes)
        distances = np.exp(seen[:, -classes:].min(axis=1).astype(np.float64)) if self.neighbours else None
        return Votes(votes.votes(self.trees, seen), distances)

    def inputs(self, features: ArrayLike) -> Features:
        """What the trees see of features (n, d)."""
        return self.neighbours.extended(features) if self.neighbours else matrix(features)


def grow(
    features: Features, labels: IntArray, *, trees: int, seed: int = 0, background: bool = True, neighbours: bool = True
) -> VotingForest:
    """A forest fitted on features (n, d) and labels (n,) of at least two classes.

    Args:
        features, labels: samples.
        trees: T.
        seed: of everything drawn.
        background: whether trees may vote for none of the classes, having learnt to tell the samples from
            `recognition.trfe.forest.votes.background_of` them.
        neighbours: whether trees see distances to the samples of each class.

    Raises:
        UsageError: features that are not finite, or labels of fewer than two classes.
    """
    near = Neighbours.fit(features, labels, seed) if neighbours else None
    bare = VotingForest(RandomForestClassifier(), near)
    around = bare.inputs(votes.background_of(features, seed)) if background else None
    return bare._replace(trees=votes.forest(bare.inputs(features), labels, trees, seed, around))
