"""A round of discovery: which of the samples that wait in the buffer are of new classes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from recognition.trfe.config import Config
from recognition.trfe.discovery.buffer import Buffer, Sifted, sift
from recognition.trfe.discovery.clusterer import Task
from recognition.trfe.discovery.principal_axes import PrincipalAxes
from recognition.trfe.discovery.promotion import Candidate, judge, known_cohesion
from recognition.trfe.known import Known, Labelled
from recognition.trfe.samples import UNKNOWN, Features, drawn_of_each, matrix
from recognition.trfe.steps import Steps
from schemas.errors import UsageError
from xodr.array_types import IntArray

FIRST_DISCOVERED = 101
"""Label of the first class that is discovered; the given ones have smaller ones."""
_REFERENCE = 50
"""Samples of each known class from which its cohesion is measured."""
SET_ASIDE = -1
"""Cluster of samples that were not clustered."""


class Discovery(NamedTuple):
    """What is found among the m samples of a buffer.

    Args:
        keys: numbers (m,) by which the caller knows the samples.
        features: of the samples (m, d).
        sifted: what NVP set aside.
        clusters: cluster (m,) of each sample; −1 where it was set aside.
        candidates: each cluster judged; its members are rows of the buffer.
        labels: new class (m,) of each sample of a promoted cluster, else 0.
        reference: cohesion of the known classes, with which that of the clusters is compared.
    """

    keys: IntArray
    features: Features
    sifted: Sifted
    clusters: IntArray
    candidates: list[Candidate]
    labels: IntArray
    reference: float


def discover(known: Known, buffer: Buffer, config: Config, steps: Steps) -> Discovery:
    """Sift the buffer, cluster what is kept and judge the clusters; the buffer stays as it is.

    Raises:
        UsageError: the buffer is empty, or holds no more samples than a sample must have neighbours.
    """
    if buffer.inputs is None or not len(buffer):
        raise UsageError("the buffer is empty: there is nothing to discover classes in")
    features = matrix(buffer.inputs)
    seen = config.recognising(features)
    sifted = sift(seen, known.prototypes, config.preprocessing)
    rows = np.flatnonzero(sifted.kept)
    clusters, labels = np.full(len(features), SET_ASIDE), np.full(len(features), UNKNOWN)
    if len(rows) < config.promotion.least_samples:
        return Discovery(buffer.keys, features, sifted, clusters, [], labels, 0.0)
    axes = clustering_axes(known.fitted.joined(known.calibrating), features[rows], config, steps)
    similar, reference = _similarity(features[rows], axes, known, config, steps)
    known_samples = axes.project(config.clustering_parts(known.fitted.features))
    least = config.promotion.relative_cohesion * reference
    task = Task(axes.project(config.clustering_parts(features[rows])), similar, known_samples, known.fitted.labels, least)
    clusters[rows] = steps.cluster(task, config)
    judged = judge(clusters[rows], seen[rows], similar, known.prototypes, reference, config.promotion)
    candidates = [one._replace(members=rows[one.members]) for one in judged]
    first = max(int(known.classes[-1]) + 1, FIRST_DISCOVERED)
    for label, one in enumerate((one for one in candidates if one.promoted), first):
        labels[one.members] = label
    return Discovery(buffer.keys, features, sifted, clusters, candidates, labels, reference)


def clustering_axes(own: Labelled, unknown: Features, config: Config, steps: Steps) -> PrincipalAxes:
    """The axes along which unknown samples with these features (n, d) are clustered, beside samples of the known classes."""
    parts, beside = config.clustering_parts(own.features), config.clustering_parts(unknown)
    if config.changes:
        around = [steps.prototypes(parts[0], own.labels, beside[0])]
    else:
        around = [steps.prototypes(part, own.labels) for part in parts]
    return PrincipalAxes.fit(around, beside, config.components)


def _similarity(
    features: Features, axes: PrincipalAxes, known: Known, config: Config, steps: Steps
) -> tuple[NDArray[np.float32], float]:
    """S of the unknown samples, and the cohesion of the known classes under the same forest."""
    own, labels = known.calibrating
    chosen = drawn_of_each(labels, _REFERENCE, np.random.default_rng(config.seed))
    both = np.concatenate([features, own[chosen]])
    coordinates = axes.project(config.clustering_parts(both))
    similar = steps.similarity(config.recognising(both), coordinates, known.forest, config)
    split = len(features)
    return similar[:split, :split], known_cohesion(similar[split:, split:], labels[chosen])
