"""Settings of TRFE, and its steps with the default of each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from recognition.trfe.discovery.candidates import Clustering, Preprocessing, Promotion, cohesion
from recognition.trfe.forest import TREES, VotingForest, grow, random_trees, similarity
from recognition.trfe.forest.screening import EvtJoint, Screening
from recognition.trfe.inputs.samples import Features, Prototypes
from schemas.common.array_types import IntArray

if TYPE_CHECKING:
    from recognition.trfe.discovery.clustering import NovelHead, PairsOf


@dataclass(frozen=True)
class Config:
    """Settings of TRFE.

    Args:
        trees: T of the forest.
        delta: δ of the screening; None chooses it by leaving one known class out, where there are
            three, and is 0.05 otherwise.
        changes: how many of the features, the first ones, are of `recognition.trfe.inputs.tokens`.
            Where there are any, samples are clustered by them alone.
        recognise_by_changes: whether samples are recognised by them too, beside the others.
        pretrained: how many of the others, again the first ones, are of the encoder before
            fine-tuning. Without changes samples are clustered by these more than by those after it,
            which lays new classes onto known ones.
        components: principal axes of the buffered samples in which they are clustered.
        preprocessing, clustering, promotion: of these steps.
        seed: of everything that is drawn.
    """

    trees: int = TREES
    delta: float | None = None
    changes: int = 0
    recognise_by_changes: bool = True
    pretrained: int = 0
    components: int = 8
    preprocessing: Preprocessing = field(default_factory=Preprocessing)
    clustering: Clustering = field(default_factory=Clustering)
    promotion: Promotion = field(default_factory=Promotion)
    seed: int = 0

    def recognising(self, features: Features) -> Features:
        """Return the features (n, d) for recognition."""
        return features if self.recognise_by_changes else features[:, self.changes :]

    def clustering_parts(self, features: Features) -> list[Features]:
        """Return the features (n, d) for clustering, in parts that are standardised separately."""
        if self.changes:
            return [features[:, : self.changes]]
        return np.split(features, [self.pretrained], axis=1) if self.pretrained else [features]


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
    from recognition.trfe.discovery.clustering import k_means_head

    count = likely_clusters(task, config)
    return trained_clusters(
        task,
        config,
        fixed_pairs(task, config),
        lambda features, seed: k_means_head(features, count, seed),
    )


def trained_clusters(task: Task, config: Config, pairs: PairsOf, novel: NovelHead) -> IntArray:
    """Cluster (n,) of each unknown sample by the heads that are trained, see
    `recognition.trfe.discovery.clustering.cluster`."""
    # Torch, which recognising does not need.
    from recognition.trfe.discovery.clustering import Projection, cluster
    from recognition.trfe.encoder.training import deterministic

    with deterministic(config.seed):
        backbone = Projection(task.samples.shape[1])
    return cluster(
        backbone,
        task.samples,
        task.known,
        task.labels,
        pairs,
        novel,
        config.clustering,
        config.seed,
    ).assignment


def fixed_pairs(task: Task, config: Config) -> PairsOf:
    """The same pairs in each epoch, by the similarity of the samples."""
    from recognition.trfe.discovery.clustering import three_way_pairs

    pairs = three_way_pairs(task.similarity, config.clustering)
    return lambda features: pairs


def likely_clusters(task: Task, config: Config) -> int:
    """Return the most likely number of clusters, raised until most samples are in clusters cohesive
    enough for promotion.

    The samples in a buffer need not be of classes alone: in few clusters, classes would drown in
    what is of none.
    """
    from sklearn.cluster import KMeans

    from recognition.trfe.discovery.clustering import likely_count  # a missing torch comes first

    most = config.clustering.candidates
    for count in range(likely_count(task.samples, most, config.seed), most):
        clusters = KMeans(count, n_init=5, random_state=config.seed).fit_predict(task.samples)
        of_each = [np.flatnonzero(clusters == number) for number in range(count)]
        cohesive = [
            len(of)
            for of in of_each
            if cohesion(task.similarity[np.ix_(of, of)]) >= task.least_cohesion
        ]
        if 2 * sum(cohesive) >= len(task.samples):
            return count
    return most


class Grow(Protocol):
    """Fits a forest on features (n, d) and labels (n,), see `recognition.trfe.forest.grow`."""

    def __call__(
        self, features: Features, labels: IntArray, *, trees: int, seed: int
    ) -> VotingForest: ...


def unsupervised_similarity(
    features: Features, coordinates: Features, forest: VotingForest, config: Config
) -> NDArray[np.float32]:
    """S (n, n) of samples under completely random trees, grown without labels on their coordinates
    (n, c).

    Args:
        features, coordinates: of the samples, and these along the principal axes.
        forest: of the known classes.
        config: number of trees and seed.
    """
    return similarity(random_trees(coordinates, config.trees, seed=config.seed), coordinates)


@dataclass(frozen=True)
class Steps:
    """Functions that do the steps.

    Attributes:
        grow: fits the forest on labelled samples.
        screening: the screening with a δ and a seed, not calibrated yet.
        prototypes: centres of labelled samples, see `Prototypes.fit`.
        similarity: S of samples, see `unsupervised_similarity`.
        cluster: numbers of the clusters of samples.
    """

    grow: Grow = grow
    screening: Callable[[float, int], Screening] = EvtJoint
    prototypes: Callable[..., Prototypes] = Prototypes.fit
    similarity: Callable[[Features, Features, VotingForest, Config], NDArray[np.float32]] = (
        unsupervised_similarity
    )
    cluster: Callable[[Task, Config], IntArray] = cluster_online
