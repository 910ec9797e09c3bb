"""A Gaussian mixture on the axes in which TRFE clusters, as many as held-out
known classes suggest.
"""

from __future__ import annotations

from schemas.common.array_types import IntArray
from studies.recognition.baselines.clustering.gaussian_mixture import mixture
from studies.recognition.baselines.clustering.pool import ClusteringMethod, Pool

TITLE = "Gaussian mixture on TRFE's axes, K of held-out classes"


class MixtureCounted(ClusteringMethod):
    """A Gaussian mixture with full covariances of as many components as held-out known classes
    suggest."""

    def cluster(self, pool: Pool) -> IntArray:
        """Cluster number of each sample (n,)."""
        return mixture(pool.directions[0], pool.likely_classes, self.seed)


METHOD = MixtureCounted
