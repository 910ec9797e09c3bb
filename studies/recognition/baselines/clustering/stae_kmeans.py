"""Autoencoder and k-means."""

from __future__ import annotations

from schemas.common.array_types import IntArray
from studies.recognition.baselines.clustering.kmeans import k_means
from studies.recognition.baselines.clustering.pool import ClusteringMethod, Pool

TITLE = "STAE + k-means, given K"


class STAEKMeans(ClusteringMethod):
    """k-means on the codes of an autoencoder of the grids
    (`studies.recognition.baselines.clustering.stae`), given the true K."""

    given_count = True

    def cluster(self, pool: Pool) -> IntArray:
        """Cluster number of each sample (n,)."""
        return k_means(pool.codes, pool.classes, self.seed)


METHOD = STAEKMeans
