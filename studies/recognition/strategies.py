"""Other ways to do the steps of TRFE, which ablations put in the place of the method's own
(`recognition.trfe.config.Steps`)."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.spatial.distance import cdist
from sklearn.cluster import AgglomerativeClustering, KMeans
from sklearn.linear_model import LogisticRegression
from sklearn.neighbors import NearestNeighbors

from recognition.trfe.config import Config, Task, fixed_pairs, likely_clusters, trained_clusters
from recognition.trfe.discovery.clustering import Pairs, k_means_head, random_head, three_way_pairs
from recognition.trfe.forest import Votes, VotingForest, grow, random_trees, similarity
from recognition.trfe.inputs.samples import Features, Prototypes, deviations, unit
from recognition.trfe.trfe import TRFE
from schemas.common.array_types import FloatArray, IntArray
from schemas.common.errors import UsageError

grow_plain = partial(grow, background=False, neighbours=False)
"""A forest whose trees see features alone and always vote for a class."""


class LinearVotes(NamedTuple):
    """Logistic regression that votes: probabilities in place of trees, and the distance to the
    fifth nearest training sample.

    Args:
        linear: fitted on standardised features. nearest: training samples, standardised and cut to
            unit length.
        mean, scale: for standardising. labels: of the classes, ascending. trees: votes that there
            are.
    """

    linear: LogisticRegression
    nearest: NearestNeighbors
    mean: Features
    scale: Features
    classes: IntArray
    trees: int

    def vote(self, features: Features) -> Votes:
        """Votes on features (n, d), and distances."""
        standard = (features - self.mean) / self.scale
        counts = np.floor(self.linear.predict_proba(standard) * self.trees).astype(np.int64)
        return Votes(counts, self.nearest.kneighbors(unit(standard))[0][:, -1])


def grow_linear(features: Features, labels: IntArray, *, trees: int, seed: int = 0) -> LinearVotes:
    """Logistic regression of features (n, d) and labels (n,) in the place of a forest."""
    mean, scale = features.mean(axis=0), deviations(features)
    standard = (features - mean) / scale
    linear = LogisticRegression(max_iter=1000, class_weight="balanced").fit(standard, labels)
    nearest = NearestNeighbors(n_neighbors=5, algorithm="brute").fit(unit(standard))
    return LinearVotes(linear, nearest, mean, scale, np.asarray(linear.classes_), trees)


class Unscreened(TRFE):
    """TRFE without screening: what is beyond the margin of every known class is unknown."""

    def _score(self, features: Features, votes: Votes) -> tuple[FloatArray, float]:
        return self.known.prototypes.ratio(features), 1.0


def supervised_similarity(
    features: Features, coordinates: Features, forest: VotingForest, config: Config
) -> NDArray[np.float32]:
    """S (n, n) of samples under the forest of the known classes."""
    return similarity(forest.trees, forest.inputs(features))


# clustering ---------------------------------------------------------------------------------


def soft_pairs(similar: NDArray[np.float32]) -> Pairs:
    """Targets that are S (n, n) itself; all pairs count."""
    return Pairs(torch.from_numpy(similar), torch.ones(similar.shape))


def average_linkage(task: Task, config: Config) -> IntArray:
    """Average linkage on 1 − S, cut where clusters would be less cohesive than is promoted."""
    cut = 1.0 - task.least_cohesion
    linkage = AgglomerativeClustering(
        None, metric="precomputed", linkage="average", distance_threshold=cut
    )
    return np.asarray(linkage.fit_predict(1.0 - task.similarity))


def soft_targets(task: Task, config: Config) -> IntArray:
    """TRFE's clustering with `soft_pairs`."""
    count, pairs = likely_clusters(task, config), soft_pairs(task.similarity)
    return trained_clusters(
        task, config, lambda _: pairs, lambda features, seed: k_means_head(features, count, seed)
    )


def refreshed_forest(task: Task, config: Config) -> IntArray:
    """TRFE's clustering with S computed anew in each epoch, from the features learnt so far."""

    def pairs(features: Features) -> Pairs:
        trees = random_trees(features, config.trees, seed=config.seed)
        return three_way_pairs(similarity(trees, features), config.clustering)

    count = likely_clusters(task, config)
    return trained_clusters(
        task,
        config,
        lambda features: pairs(features()),
        lambda features, seed: k_means_head(features, count, seed),
    )


def all_candidates(task: Task, config: Config) -> IntArray:
    """TRFE's clustering with all candidates offered; those that are not needed die out."""
    most = config.clustering.candidates
    return trained_clusters(
        task, config, fixed_pairs(task, config), lambda features, _: random_head(features, most)
    )


def k_means(task: Task, config: Config) -> IntArray:
    """k-means along TRFE's axes with TRFE's number of clusters: where its heads begin."""
    count = likely_clusters(task, config)
    return np.asarray(
        KMeans(count, n_init=5, random_state=config.seed).fit_predict(task.samples), dtype=np.int64
    )


def given_count(count: int, task: Task, config: Config) -> IntArray:
    """TRFE's clustering, given the number of clusters."""
    return trained_clusters(
        task,
        config,
        fixed_pairs(task, config),
        lambda features, seed: k_means_head(features, count, seed),
    )


# distances to the known classes -------------------------------------------------------------


class EuclideanPrototypes(Prototypes):
    """Prototypes in features that vary alike over all classes together."""

    @staticmethod
    def _axes(features: Features, columns: IntArray, scales: Features) -> Features:
        return np.diag(1.0 / scales).astype(np.float32)


class CosinePrototypes(EuclideanPrototypes):
    """The same with the cosine distance."""

    def distances(self, standard: Features, others: Features) -> FloatArray:
        """Distances (n, m) between standardised features (n, d) and (m, d)."""
        return cdist(standard, others, "cosine")


class MarginPrototypes(EuclideanPrototypes):
    """r(h) = ρ_c / margin(h) for the nearest class c: the second nearest centre is further than the
    nearest by the margin.

    ρ is the 5th percentile of a class's own margins. Margins are small for samples between classes.
    """

    def ratio(self, features: Features) -> FloatArray:  # type: ignore[override]
        """r(h) (n,); 1 is the margin of the known classes, more is beyond it."""
        margins = self._margins(self.standardise(features))
        return self.radii[margins.argmax(axis=1)] / np.maximum(
            margins.max(axis=1), np.finfo(np.float32).tiny
        )

    def _radii(self, standard: Features, columns: IntArray) -> FloatArray:
        if len(self.classes) < 2:
            raise UsageError("1 known classes are too few, at least 2 are needed")
        margins = self._margins(standard)
        return np.array(
            [
                np.quantile(margins[columns == column, column], 1.0 - 0.95)
                for column in range(len(self.classes))
            ]
        )

    def _margins(self, standard: Features) -> FloatArray:
        """Return the margin of the nearest other class over class c (n, K)."""
        distances = self.distances(standard, self.centres)
        first, second = np.partition(distances, 1, axis=1)[:, :2].T[:, :, None]
        return np.where(distances == first, second, first) - distances
