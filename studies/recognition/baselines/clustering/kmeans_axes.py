"""k-means on the axes in which TRFE clusters, given the true K."""

from __future__ import annotations

from schemas.common.array_types import IntArray
from studies.recognition.baselines.clustering.kmeans import k_means
from studies.recognition.baselines.clustering.pool import ClusteringMethod, Pool

TITLE = "k-means on TRFE's axes, given K"


class KMeansAxes(ClusteringMethod):
    """k-means with TRFE's start and directions, given the true K: what its heads add to."""

    given_count = True

    def cluster(self, pool: Pool) -> IntArray:
        """Cluster number of each sample (n,)."""
        return k_means(pool.directions[0], pool.classes, self.seed)


METHOD = KMeansAxes
