"""What the readings of unknown screening have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recognition.trfe.samples import UNKNOWN, class_labels
from schemas.errors import UsageError
from xodr.array_types import FloatArray, IntArray

State = Mapping[str, NDArray[Any]]


class Screening(ABC):
    """Decides from votes (n, K) of a forest, and perhaps distances (n,), which samples belong to no known class.

    All that an instance holds are numbers and arrays, so that it can be stored without pickle.

    Attributes:
        threshold: a sample whose score is greater is unknown.
        classes: labels of the columns of the votes, ascending; set by `fit`.
        trees: number of trees that vote; set by `fit`.
    """

    def __init__(self, threshold: float) -> None:
        self.threshold = threshold
        self.classes: IntArray = np.zeros(0, dtype=np.int64)
        self.trees = 0

    def fit(self, votes: ArrayLike, labels: ArrayLike, trees: int | None = None, distances: FloatArray | None = None) -> Self:
        """Calibrate on votes (n, K) of samples that the forest was not fitted on, and their true labels (n,).

        Args:
            votes, labels: of the samples.
            trees: that vote; None where all of them vote for known classes.
            distances: of the samples to the known classes (n,), for a screening that looks at them.

        Raises:
            UsageError: the labels are not of as many classes as the votes, or the rows of the votes do not add up.
        """
        table = np.asarray(votes)
        if table.ndim != 2 or not len(table):
            raise UsageError(f"votes must be a table (samples, classes), not of shape {table.shape}")
        totals = table.sum(axis=1)
        if (totals != totals[0]).any() if trees is None else (totals > trees).any():
            raise UsageError("each row of the votes must add up to the number of trees, or to less where some may vote for none")
        truth = class_labels(labels, len(table))
        self.classes = np.unique(truth)
        if len(self.classes) != table.shape[1]:
            raise UsageError(f"{table.shape[1]} classes are voted for, but calibration samples are of {len(self.classes)}")
        self.trees = int(totals[0]) if trees is None else trees
        self._calibrate(table, np.searchsorted(self.classes, truth), distances)
        return self

    def score(self, votes: ArrayLike, distances: FloatArray | None = None) -> FloatArray:
        """How outlying samples with these votes (n, K) and distances (n,) are; higher is more outlying."""
        table = np.asarray(votes)
        if not self.trees:
            raise UsageError("the screening has to be fitted before it can score")
        if table.ndim != 2 or table.shape[1] != len(self.classes):
            raise UsageError(f"votes of shape {table.shape} are not for {len(self.classes)} classes")
        return self._score(table, distances)

    def predict(self, votes: ArrayLike, distances: FloatArray | None = None) -> IntArray:
        """Labels (n,): the class with most votes, or 0 where the score exceeds the threshold."""
        accepted = self.score(votes, distances) <= self.threshold
        return np.where(accepted, self.classes[np.asarray(votes).argmax(axis=1)], UNKNOWN)

    def state(self) -> dict[str, NDArray[Any]]:
        """All that the instance holds, as arrays; `restore` takes it back."""
        return {name: np.asarray(value) for name, value in vars(self).items()}

    def restore(self, state: State) -> Self:
        """Take over what `state` of an instance of the same class gave.

        Raises:
            KeyError: an attribute is missing.
        """
        for name, value in vars(self).items():
            setattr(self, name, state[name] if isinstance(value, np.ndarray) else type(value)(state[name]))
        return self

    @abstractmethod
    def _calibrate(self, votes: IntArray, columns: IntArray, distances: FloatArray | None) -> None:
        """Fit to votes (n, K) and distances (n,), where `columns` (n,) are the columns of the true classes."""

    @abstractmethod
    def _score(self, votes: IntArray, distances: FloatArray | None) -> FloatArray: ...
