"""Semi-supervised k-means on the axes in which TRFE clusters, given the true K."""

from __future__ import annotations

from schemas.common.array_types import IntArray
from studies.recognition.baselines.clustering.pool import ClusteringMethod, Pool
from studies.recognition.semi_supervised import semi_supervised

TITLE = "semi-supervised k-means on TRFE's axes, given K"


class SemiSupervised(ClusteringMethod):
    """k-means beside the labelled samples of the known classes, given the true K: see
    `studies.recognition.semi_supervised`."""

    given_count = True

    def cluster(self, pool: Pool) -> IntArray:
        """Cluster number of each sample (n,)."""
        return semi_supervised(*pool.directions, pool.labels, pool.classes, self.seed)


METHOD = SemiSupervised
