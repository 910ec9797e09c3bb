"""k-means on the encoder's features."""

from __future__ import annotations

import numpy as np

from recognition.trfe.inputs.samples import Features
from schemas.common.array_types import IntArray
from studies.recognition.baselines.clustering.pool import ClusteringMethod, Pool

TITLE = "k-means on features, given K"


def k_means(features: Features, count: int, seed: int) -> IntArray:
    """Cluster number of each sample (n,): the best of ten starts."""
    from sklearn.cluster import KMeans

    return np.asarray(
        KMeans(count, n_init=10, random_state=seed).fit_predict(features), dtype=np.int64
    )


class KMeansFeatures(ClusteringMethod):
    """k-means of the standardised features, given the true K: what clustering has to beat.

    Lloyd, Least Squares Quantization in PCM, IEEE Transactions on Information Theory 28, 1982.
    """

    given_count = True

    def cluster(self, pool: Pool) -> IntArray:
        """Cluster number of each sample (n,)."""
        return k_means(pool.standardised()[0], pool.classes, self.seed)


METHOD = KMeansFeatures
