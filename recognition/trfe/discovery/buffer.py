"""New-value preprocessing (NVP): samples of no known class wait in a buffer until there are enough to find new classes among."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recognition.trfe.prototypes import Prototypes
from schemas.errors import UsageError
from xodr.array_types import BoolArray, FloatArray, IntArray

_NORMAL = 1.4826
"""Standard deviation of a normal distribution over its median absolute deviation."""


@dataclass(frozen=True)
class Preprocessing:
    """How the buffer is sifted: by default nothing is set aside, as that loses more samples of new classes than it spares the
    clustering (docs/recognition-results.md).

    Args:
        capacity: W, samples that the buffer holds.
        neighbours: k of the mean distance to the nearest neighbours.
        spread: outliers are beyond median + spread · 1.4826 · MAD of that distance; None has no outliers. The source has 3.
        margin: a sample with r(h) up to it is near a known class. The source has 1, where a twentieth of the class's own samples
            are beyond.
    """

    capacity: int = 500
    neighbours: int = 10
    spread: float | None = None
    margin: float = 0.0


class Buffer:
    """First in, first out: of more than `capacity` samples the oldest are dropped.

    Attributes:
        inputs: the samples (m, …), oldest first.
        keys: numbers (m,) by which the caller knows them.
        dropped: how many were dropped since the start.
    """

    def __init__(self, capacity: int) -> None:
        if capacity < 1:
            raise UsageError(f"a buffer of {capacity} samples can't hold any")
        self.capacity = capacity
        self.inputs: NDArray[Any] | None = None
        self.keys: IntArray = np.zeros(0, dtype=np.int64)
        self.dropped = 0

    def __len__(self) -> int:
        return len(self.keys)

    @property
    def full(self) -> bool:
        """Whether the next sample would drop the oldest."""
        return len(self) >= self.capacity

    def add(self, inputs: ArrayLike, keys: ArrayLike) -> None:
        """Append samples (n, …) with their keys (n,)."""
        new = np.asarray(inputs)
        together = new if self.inputs is None else np.concatenate([self.inputs, new])
        numbers = np.concatenate([self.keys, np.asarray(keys, dtype=np.int64)])
        self.dropped += max(len(numbers) - self.capacity, 0)
        self.inputs, self.keys = together[-self.capacity :], numbers[-self.capacity :]

    def remove(self, mask: BoolArray) -> None:
        """Forget the samples where `mask` (m,) is true."""
        if self.inputs is not None:
            self.inputs, self.keys = self.inputs[~mask], self.keys[~mask]


class Sifted(NamedTuple):
    """What NVP finds out about the samples of a buffer.

    Args:
        outlying: (m,) far from its neighbours in the buffer.
        near_known: (m,) within the margin of a known class.
    """

    outlying: BoolArray
    near_known: BoolArray

    @property
    def kept(self) -> BoolArray:
        """(m,) neither: to be clustered."""
        return ~(self.outlying | self.near_known)


def sift(features: ArrayLike, prototypes: Prototypes, config: Preprocessing = Preprocessing()) -> Sifted:
    """Tell outliers and samples near known classes among the features (m, d) of a buffer.

    Raises:
        UsageError: no more samples than neighbours, or features that are not finite.
    """
    standard = prototypes.standardise(features)
    if len(standard) <= config.neighbours:
        raise UsageError(f"{len(standard)} buffered samples have no {config.neighbours} neighbours each")
    outlying = np.zeros(len(standard), dtype=bool)
    if config.spread is not None:
        isolation = _isolation(prototypes.distances(standard, standard), config.neighbours)
        median = np.median(isolation)
        outlying = isolation > median + config.spread * _NORMAL * np.median(np.abs(isolation - median))
    return Sifted(outlying, prototypes.ratio(features) <= config.margin)


def _isolation(distances: FloatArray, neighbours: int) -> FloatArray:
    """a(h) (m,): mean distance to the nearest neighbours, not counting the sample itself, from all distances (m, m)."""
    np.fill_diagonal(distances, np.inf)
    return np.partition(distances, neighbours - 1, axis=1)[:, :neighbours].mean(axis=1)
