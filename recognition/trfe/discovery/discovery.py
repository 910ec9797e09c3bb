"""A round of discovery: which of the samples that wait in the buffer are of new classes."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from sklearn.cluster import AgglomerativeClustering, KMeans

from recognition.encoder.training import deterministic
from recognition.trfe.config import Config
from recognition.trfe.discovery.buffer import Buffer, Sifted, sift
from recognition.trfe.discovery.clustering import Projection, cluster
from recognition.trfe.discovery.counting import likely_count
from recognition.trfe.discovery.directions import Directions
from recognition.trfe.discovery.promotion import Candidate, cohesion, judge, known_cohesion
from recognition.trfe.forest.rfap import random_trees, similarity
from recognition.trfe.known import Known
from recognition.trfe.prototypes import Prototypes
from recognition.trfe.samples import UNKNOWN, Features, drawn_of_each, matrix
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
        keys: numbers (m,) by which the giver knows the samples.
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


def discover(known: Known, buffer: Buffer, config: Config) -> Discovery:
    """Sift the buffer, cluster what is kept and judge the clusters; the buffer stays as it is.

    Raises:
        UsageError: the buffer is empty, or holds no more samples than a sample must have neighbours.
    """
    if buffer.inputs is None or not len(buffer):
        raise UsageError("the buffer is empty: there is nothing to discover classes in")
    features = matrix(buffer.inputs)
    nothing = np.zeros(len(features), dtype=bool)
    sifted = sift(features, known.prototypes, config.preprocessing) if config.sifted else Sifted(nothing, nothing)
    rows = np.flatnonzero(sifted.kept)
    clusters, labels = np.full(len(features), SET_ASIDE), np.full(len(features), UNKNOWN)
    if len(rows) < config.promotion.least_samples:
        return Discovery(buffer.keys, features, sifted, clusters, [], labels, 0.0)
    directions = Directions.fit(_prototypes(known, config), features[rows], config.components)
    similar, reference = _similarity(features[rows], directions, known, config)
    clusters[rows] = _clusters(directions.of(features[rows]), similar, reference, directions, known, config)
    judged = judge(clusters[rows], features[rows], similar, known.prototypes, reference, config.promotion)
    candidates = [one._replace(members=rows[one.members]) for one in judged]
    first = max(int(known.classes[-1]) + 1, FIRST_DISCOVERED)
    for label, one in enumerate((one for one in candidates if one.promoted), first):
        labels[one.members] = label
    return Discovery(buffer.keys, features, sifted, clusters, candidates, labels, reference)


def _prototypes(known: Known, config: Config) -> list[Prototypes]:
    """Those of the known classes in the features before and in those after fine-tuning; or in all, where they are of one kind."""
    if not config.pretrained:
        return [known.prototypes]
    own = known.fitted.joined(known.calibrating)
    parts = np.split(own.features, [config.pretrained], axis=1)
    return [Prototypes.fit(part, own.labels, config.metric) for part in parts]


def _similarity(features: Features, directions: Directions, known: Known, config: Config) -> tuple[NDArray[np.float32], float]:
    """S of the unknown samples, and the cohesion of the known classes under the same forest."""
    own, labels = known.calibrating
    chosen = drawn_of_each(labels, _REFERENCE, np.random.default_rng(config.seed))
    both = np.concatenate([features, own[chosen]])
    similar = _unsupervised(directions.of(both), config) if config.forest == "unsupervised" else known.voters.similarity(both)
    split = len(features)
    return similar[:split, :split], known_cohesion(similar[split:, split:], labels[chosen])


def _unsupervised(features: Features, config: Config) -> NDArray[np.float32]:
    return similarity(random_trees(features, config.trees, seed=config.seed), features)


def _clusters(
    samples: Features, similar: NDArray[np.float32], reference: float, directions: Directions, known: Known, config: Config
) -> IntArray:
    if config.clusterer == "linkage":
        cut = 1.0 - config.promotion.relative_cohesion * reference
        linkage = AgglomerativeClustering(None, metric="precomputed", linkage="average", distance_threshold=cut)
        return np.asarray(linkage.fit_predict(1.0 - similar))

    def renewed(learnt: Features) -> NDArray[np.float32]:
        return _unsupervised(learnt, config) if config.clustering.refreshed else similar

    anchors, settings = directions.of(known.fitted.features), config.clustering
    if config.counted:
        least = config.promotion.relative_cohesion * reference
        settings = replace(settings, candidates=_count(samples, similar, least, config), start="k-means")
    with deterministic(config.seed):
        backbone = Projection(samples.shape[1])
    return cluster(backbone, samples, anchors, known.fitted.labels, renewed, settings, config.seed).assignment


def _count(samples: Features, similar: NDArray[np.float32], least_cohesion: float, config: Config) -> int:
    """As many clusters as are likely, and more until most samples are in clusters that are cohesive enough for promotion.

    What waits in a buffer need not be of classes alone: in few clusters, classes would drown in what is of none.
    """
    most = config.clustering.candidates
    for count in range(likely_count(samples, most, config.seed), most):
        clusters = KMeans(count, n_init=5, random_state=config.seed).fit_predict(samples)
        of_each = [np.flatnonzero(clusters == number) for number in range(count)]
        cohesive = [len(of) for of in of_each if cohesion(similar[np.ix_(of, of)]) >= least_cohesion]
        if 2 * sum(cohesive) >= len(samples):
            return count
    return most
