"""Promotion: which clusters of unknown samples are new classes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recognition.trfe.prototypes import Prototypes
from recognition.trfe.samples import class_labels, matrix
from schemas.errors import UsageError
from xodr.array_types import IntArray


@dataclass(frozen=True)
class Promotion:
    """What a cluster must be like.

    Args:
        least_samples: samples in it.
        relative_cohesion: its mean intra-cluster similarity, as a share of the median of the known classes' own. Clusters of one
            class that was held back reach 0.5 to 0.8, for the known ones lie close together where new ones spread.
        margin: r of its centre, which has to be greater; see `recognition.trfe.discovery.buffer.Preprocessing`.
        absolute_cohesion: the published limit of that similarity itself, which is only reported: real forests don't reach it.
    """

    least_samples: int = 20
    relative_cohesion: float = 0.5
    margin: float = 0.75
    absolute_cohesion: float = 0.85


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
    return float((similarity.sum(dtype=np.float64) - np.trace(similarity)) / (count * (count - 1))) if count > 1 else 0.0


def known_cohesion(similarity: NDArray[np.float32], labels: ArrayLike) -> float:
    """Median over the known classes of their own cohesion, from the similarity (n, n) of labelled samples."""
    truth = class_labels(labels, len(similarity))
    return float(np.median([cohesion(similarity[np.ix_(of, of)]) for of in (truth == label for label in np.unique(truth))]))


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
        raise UsageError(f"clusters {numbers.shape} and similarity {similarity.shape} are not of {len(table)} samples")
    found = []
    for number in np.unique(numbers):
        members = np.flatnonzero(numbers == number)
        close = cohesion(similarity[np.ix_(members, members)])
        ratio = float(prototypes.ratio(table[members].mean(axis=0, keepdims=True))[0])
        reason = _objection(len(members), close, ratio, reference, config)
        found.append(Candidate(int(number), members, close, ratio, not reason, close >= config.absolute_cohesion, reason))
    return found


def _objection(size: int, close: float, ratio: float, reference: float, config: Promotion) -> str:
    if size < config.least_samples:
        return f"{size} samples, fewer than {config.least_samples}"
    if close < config.relative_cohesion * reference:
        return f"cohesion {close:.3f} below {config.relative_cohesion:g} of the known classes' {reference:.3f}"
    if ratio <= config.margin:
        return f"within the margin of a known class, r = {ratio:.2f}"
    return ""
