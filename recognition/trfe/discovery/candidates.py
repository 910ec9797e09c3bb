"""Candidates for new classes: the buffer of unknown samples, and what promotes a cluster."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recognition.trfe.inputs.samples import Prototypes, class_labels, matrix
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from schemas.common.errors import UsageError

_NORMAL = 1.4826
"""Standard deviation of a normal distribution over its median absolute deviation."""


@dataclass(frozen=True)
class Preprocessing:
    """Settings for sifting the buffer. By default nothing is set aside, as that loses more samples
    of new classes than it spares the clustering (docs/recognition-results.md).

    Args:
        capacity: W, samples that the buffer holds.
        neighbours: k of the mean distance to the nearest neighbours.
        spread: outliers are beyond median + spread · 1.4826 · MAD of that distance; None has no
            outliers. The source has 3.
        margin: a sample with r(h) up to it is near a known class. The source has 1, where a
            twentieth of the class's own samples are beyond.
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
    """Results of NVP for the samples of a buffer.

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


def sift(
    features: ArrayLike, prototypes: Prototypes, config: Preprocessing = Preprocessing()
) -> Sifted:
    """Tell outliers and samples near known classes among the features (m, d) of a buffer.

    Raises:
        UsageError: no more samples than neighbours, or features that are not finite.
    """
    standard = prototypes.standardise(features)
    if len(standard) <= config.neighbours:
        raise UsageError(
            f"{len(standard)} buffered samples have no {config.neighbours} neighbours each"
        )
    outlying = np.zeros(len(standard), dtype=bool)
    if config.spread is not None:
        isolation = _isolation(prototypes.distances(standard, standard), config.neighbours)
        # Median and median deviation: the outliers that are sought would
        # inflate mean and deviation.
        median = np.median(isolation)
        outlying = isolation > median + config.spread * _NORMAL * np.median(
            np.abs(isolation - median)
        )
    return Sifted(outlying, prototypes.ratio(features) <= config.margin)


def _isolation(distances: FloatArray, neighbours: int) -> FloatArray:
    """a(h) (m,): mean distance to the nearest neighbours, not counting the sample itself, from all
    distances (m, m)."""
    np.fill_diagonal(distances, np.inf)
    return np.partition(distances, neighbours - 1, axis=1)[:, :neighbours].mean(axis=1)


@dataclass(frozen=True)
class Promotion:
    """Requirements on a cluster for promotion.

    Args:
        least_samples: samples in it.
        relative_cohesion: its mean intra-cluster similarity, as a share of the median of the known
            classes' own. Clusters of one class that was held back reach 0.5 to 0.8, for the known
            ones lie close together where new ones spread.
        margin: r of its centre, which has to be greater; see
            `recognition.trfe.discovery.candidates.Preprocessing`.
        absolute_cohesion: the published limit of that similarity itself, which is only reported:
            real forests don't reach it.
    """

    least_samples: int = 20
    relative_cohesion: float = 0.5
    margin: float = 0.75
    absolute_cohesion: float = 0.85


@dataclass(frozen=True)
class Clustering:
    """Settings for training the heads of `recognition.trfe.discovery.clustering`.

    Args:
        candidates: Q_max, most new classes that one round can find.
        positive, negative: quantiles of S from which on, and up to which, pairs count as alike and
            as different.
        epochs, batch, rate: of Adam.
        consistency: λ.
        ramp: E_r, epochs until ω reaches λ.
        threads: that share the arithmetic; a small backbone is faster on one, and sums depend on
            their number.
    """

    candidates: int = 10
    positive: float = 0.85
    negative: float = 0.5
    epochs: int = 150
    batch: int = 128
    rate: float = 1e-3
    consistency: float = 10.0
    ramp: int = 75
    threads: int = 1


class Candidate(NamedTuple):
    """One cluster and what speaks for and against it.

    Args:
        cluster: its number.
        members: rows (m,) of its samples.
        cohesion: mean similarity of its pairs of different samples; 0 for a single sample.
        ratio: r of its centre, distance to the nearest known centre over that class's radius.
        promoted: whether it becomes a class.
        absolutely_cohesive: whether it would also reach the published limit.
        reason: why it is not promoted, empty where it is.
    """

    cluster: int
    members: IntArray
    cohesion: float
    ratio: float
    promoted: bool
    absolutely_cohesive: bool
    reason: str


def cohesion(similarity: NDArray[np.float32]) -> float:
    """Mean similarity (m, m) of different samples; 0 for fewer than two."""
    count = len(similarity)
    return (
        float((similarity.sum(dtype=np.float64) - np.trace(similarity)) / (count * (count - 1)))
        if count > 1
        else 0.0
    )


def known_cohesion(similarity: NDArray[np.float32], labels: ArrayLike) -> float:
    """Median over the known classes of their own cohesion, from the similarity (n, n) of labelled
    samples."""
    truth = class_labels(labels, len(similarity))
    return float(
        np.median(
            [
                cohesion(similarity[np.ix_(of, of)])
                for of in (truth == label for label in np.unique(truth))
            ]
        )
    )


def judge(
    clusters: ArrayLike,
    features: ArrayLike,
    similarity: NDArray[np.float32],
    prototypes: Prototypes,
    reference: float,
    config: Promotion = Promotion(),
) -> list[Candidate]:
    """Judge each cluster, in the order of their numbers.

    Args:
        clusters: number of each sample's cluster (n,).
        features: of the samples (n, d).
        similarity: of the samples (n, n).
        prototypes: known classes.
        reference: `known_cohesion`.
        config: limits.

    Raises:
        UsageError: the arrays are not of the same samples.
    """
    table, numbers = matrix(features), np.asarray(clusters)
    if numbers.shape != (len(table),) or similarity.shape != (len(table), len(table)):
        raise UsageError(
            f"clusters {numbers.shape} and similarity {similarity.shape} are not of "
            f"{len(table)} samples"
        )
    judgements = []
    for number in np.unique(numbers):
        members = np.flatnonzero(numbers == number)
        close = cohesion(similarity[np.ix_(members, members)])
        # The centre, not the members: single samples of a new class may lie near a known one.
        ratio = float(prototypes.ratio(table[members].mean(axis=0, keepdims=True))[0])
        reason = _objection(len(members), close, ratio, reference, config)
        judgements.append(
            Candidate(
                int(number),
                members,
                close,
                ratio,
                not reason,
                close >= config.absolute_cohesion,
                reason,
            )
        )
    return judgements


def _objection(size: int, close: float, ratio: float, reference: float, config: Promotion) -> str:
    if size < config.least_samples:
        return f"{size} samples, fewer than {config.least_samples}"
    if close < config.relative_cohesion * reference:
        return (
            f"cohesion {close:.3f} below {config.relative_cohesion:g} of the known classes' "
            f"{reference:.3f}"
        )
    if ratio <= config.margin:
        return f"within the margin of a known class, r = {ratio:.2f}"
    return ""
