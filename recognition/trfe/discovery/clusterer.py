"""TRFE's clusters of unknown samples: online clustering of as many clusters as the samples likely form."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from sklearn.cluster import KMeans

from recognition.encoder.training import deterministic
from recognition.trfe.config import Config
from recognition.trfe.discovery.clustering import (
    NovelHead,
    PairsOf,
    Projection,
    cluster,
    k_means_head,
    three_way_pairs,
)
from recognition.trfe.discovery.counting import likely_count
from recognition.trfe.discovery.promotion import cohesion
from recognition.trfe.samples import Features
from xodr.array_types import IntArray


class Task(NamedTuple):
    """Samples to cluster.

    Args:
        samples: unknown samples (n, c), along the principal axes.
        similarity: S of them (n, n).
        known, labels: samples of the known classes (m, c), and their classes (m,).
        least_cohesion: of a cluster that can be promoted.
    """

    samples: Features
    similarity: NDArray[np.float32]
    known: Features
    labels: IntArray
    least_cohesion: float


def cluster_online(task: Task, config: Config) -> IntArray:
    """Cluster (n,) of each unknown sample."""
    count = likely_clusters(task, config)
    return trained_clusters(task, config, fixed_pairs(task, config), lambda features, seed: k_means_head(features, count, seed))


def trained_clusters(task: Task, config: Config, pairs: PairsOf, novel: NovelHead) -> IntArray:
    """Cluster (n,) of each unknown sample by the heads that are trained, see `recognition.trfe.discovery.clustering.cluster`."""
    with deterministic(config.seed):
        backbone = Projection(task.samples.shape[1])
    return cluster(backbone, task.samples, task.known, task.labels, pairs, novel, config.clustering, config.seed).assignment


def fixed_pairs(task: Task, config: Config) -> PairsOf:
    """The same pairs in each epoch, by the similarity of the samples."""
    pairs = three_way_pairs(task.similarity, config.clustering)
    return lambda features: pairs


def likely_clusters(task: Task, config: Config) -> int:
    """As many clusters as are likely, and more until most samples are in clusters that are cohesive enough for promotion.

    The samples in a buffer need not be of classes alone: in few clusters, classes would drown in what is of none.
    """
    most = config.clustering.candidates
    for count in range(likely_count(task.samples, most, config.seed), most):
        clusters = KMeans(count, n_init=5, random_state=config.seed).fit_predict(task.samples)
        of_each = [np.flatnonzero(clusters == number) for number in range(count)]
        cohesive = [len(of) for of in of_each if cohesion(task.similarity[np.ix_(of, of)]) >= task.least_cohesion]
        if 2 * sum(cohesive) >= len(task.samples):
            return count
    return most
