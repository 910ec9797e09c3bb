"""A Gaussian mixture on the axes in which TRFE clusters, given the true K."""

from __future__ import annotations

import numpy as np

from recognition.trfe.inputs.samples import Features
from schemas.common.array_types import IntArray
from studies.recognition.baselines.clustering.pool import ClusteringMethod, Pool

TITLE = "Gaussian mixture on TRFE's axes, given K"


def mixture(features: Features, count: int, seed: int) -> IntArray:
    """Component of each sample (n,) with the greatest share in it."""
    from sklearn.mixture import GaussianMixture

    model = GaussianMixture(count, n_init=5, reg_covar=1e-4, random_state=seed)
    return np.asarray(model.fit_predict(features.astype(np.float64)), dtype=np.int64)


class Mixture(ClusteringMethod):
    """Components of a Gaussian mixture with full covariances, given the true K; the best of five
    starts."""

    given_count = True

    def cluster(self, pool: Pool) -> IntArray:
        """Cluster number of each sample (n,)."""
        return mixture(pool.directions[0], pool.classes, self.seed)


METHOD = Mixture
