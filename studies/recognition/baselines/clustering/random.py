"""Clusters by chance, the row that every other has to beat."""

from __future__ import annotations

import numpy as np

from schemas.common.array_types import IntArray
from studies.recognition.baselines.clustering.pool import ClusteringMethod, Pool

TITLE = "random"


class ChanceClusters(ClusteringMethod):
    """One of K clusters drawn for each sample, given the true K."""

    given_count = True

    def cluster(self, pool: Pool) -> IntArray:
        """Cluster number of each sample (n,)."""
        return np.random.default_rng(self.seed).integers(pool.classes, size=len(pool.features))


METHOD = ChanceClusters
