"""Semi-supervised k-means on the axes in which TRFE clusters, as many as held-out known classes
suggest."""

from __future__ import annotations

from schemas.common.array_types import IntArray
from studies.recognition.baselines.clustering.pool import ClusteringMethod, Pool
from studies.recognition.semi_supervised import semi_supervised

TITLE = "semi-supervised k-means on TRFE's axes, K of held-out classes"


class SemiSupervisedCounted(ClusteringMethod):
    """k-means with labelled samples (`studies.recognition.semi_supervised`); held-out classes give
    their number."""

    def cluster(self, pool: Pool) -> IntArray:
        """Cluster number of each sample (n,)."""
        return semi_supervised(*pool.directions, pool.labels, pool.likely_classes, self.seed)


METHOD = SemiSupervisedCounted
