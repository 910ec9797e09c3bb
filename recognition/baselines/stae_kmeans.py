"""Autoencoder and k-means."""

from __future__ import annotations

from recognition.baselines.kmeans import k_means
from recognition.baselines.pool import ClusteringMethod, Pool
from recognition.samples import Whole


class STAEKMeans(ClusteringMethod):
    """k-means on the codes of an autoencoder of the grids (`recognition.baselines.stae`), given the true K."""

    given_count = True

    def cluster(self, pool: Pool) -> Whole:
        """Cluster number of each sample (n,)."""
        return k_means(pool.codes, pool.classes, self.seed)
