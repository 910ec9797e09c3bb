"""The forest of a model with all that its trees look at: features, and distances to the known classes."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.ensemble import RandomForestClassifier

from recognition.trfe.forest import rfap, votes
from recognition.trfe.forest.neighbours import Neighbours
from recognition.trfe.samples import UNKNOWN, Features, matrix
from xodr.array_types import FloatArray, IntArray


class Cast(NamedTuple):
    """What a forest says of n samples.

    Args:
        votes: for the known classes (n, K).
        distances: to the nearest samples of a class (n,), standardised; None where the forest sees features alone.
    """

    votes: IntArray
    distances: FloatArray | None

    def only(self, chosen: NDArray[Any]) -> Cast:
        """What it says of the samples of a mask or index."""
        return Cast(self.votes[chosen], None if self.distances is None else self.distances[chosen])


class Voters(NamedTuple):
    """A forest that votes.

    Args:
        forest: fitted on features, or on features with distances beside them.
        neighbours: to which distances are measured; None where the forest sees features alone.
    """

    forest: RandomForestClassifier
    neighbours: Neighbours | None

    @property
    def classes(self) -> IntArray:
        """Labels of the known classes, ascending."""
        classes = np.asarray(self.forest.classes_)
        return classes[classes != UNKNOWN]

    def cast(self, features: ArrayLike) -> Cast:
        """Votes for the known classes, see `recognition.trfe.forest.votes.votes`, and distances to them."""
        seen, classes = self._seen(features), len(self.classes)
        distances = np.exp(seen[:, -classes:].min(axis=1).astype(np.float64)) if self.neighbours else None
        return Cast(votes.votes(self.forest, seen), distances)

    def similarity(self, features: ArrayLike) -> NDArray[np.float32]:
        """S (n, n) of samples, see `recognition.trfe.forest.rfap`."""
        return rfap.similarity(self.forest, self._seen(features))

    def _seen(self, features: ArrayLike) -> Features:
        return self.neighbours.extended(features) if self.neighbours else matrix(features)


def grow(
    features: Features, labels: IntArray, *, trees: int, seed: int = 0, background: bool = False, neighbours: bool = False
) -> Voters:
    """Voters fitted on features (n, d) and labels (n,) of at least two classes.

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
    bare = Voters(RandomForestClassifier(), near)
    around = bare._seen(votes.background_of(features, seed)) if background else None
    return bare._replace(forest=votes.forest(bare._seen(features), labels, trees, seed, around))
