"""Autoencoder and average linkage."""

from __future__ import annotations

import numpy as np

from schemas.common.array_types import IntArray
from studies.recognition.baselines.clustering.pool import ClusteringMethod, Pool

TITLE = "STAE + average linkage, given K"


class STAELinkage(ClusteringMethod):
    """Average linkage on the codes of an autoencoder of the grids (`stae`), given the true K."""

    given_count = True

    def cluster(self, pool: Pool) -> IntArray:
        """Cluster number of each sample (n,)."""
        from sklearn.cluster import AgglomerativeClustering

        found = AgglomerativeClustering(pool.classes, linkage="average").fit_predict(pool.codes)
        return np.asarray(found, dtype=np.int64)


METHOD = STAELinkage
