"""k-means on the axes in which TRFE clusters, as many as held-out known classes suggest."""

from __future__ import annotations

from schemas.common.array_types import IntArray
from studies.recognition.baselines.clustering.kmeans import k_means
from studies.recognition.baselines.clustering.pool import ClusteringMethod, Pool

TITLE = "k-means on TRFE's axes, K of held-out classes"


class KMeansAxesCounted(ClusteringMethod):
    """k-means with TRFE's start and directions, as many as held-out known classes suggest: what its
    heads add to."""

    def cluster(self, pool: Pool) -> IntArray:
        """Cluster number of each sample (n,)."""
        return k_means(pool.directions[0], pool.likely_classes, self.seed)


METHOD = KMeansAxesCounted
