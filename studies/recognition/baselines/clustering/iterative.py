"""Clustering by the joint losses of TRFE, with another idea of which samples are alike."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
from numpy.typing import NDArray

from recognition.trfe.discovery.candidates import Clustering
from recognition.trfe.discovery.clustering import (
    Pairs,
    Projection,
    cluster,
    random_head,
)
from recognition.trfe.inputs.samples import Features
from recognition.trfe.training.windows import seeded
from schemas.common.array_types import IntArray
from studies.recognition.baselines.clustering.pool import ClusteringMethod, Pool


class IterativeMethod(ClusteringMethod):
    """Known-class and novel head trained together as in `recognition.trfe.discovery.clustering`.

    Similarities are renewed in every epoch.
    """

    @abstractmethod
    def similarity(self, features: Features) -> NDArray[np.float32]:
        """S (n, n) in [0, 1] of the features (n, d) learnt so far."""

    @abstractmethod
    def pairs(self, similarity: NDArray[np.float32], config: Clustering) -> Pairs:
        """Targets of pairs from S (n, n)."""

    def cluster(self, pool: Pool) -> IntArray:
        """Cluster number of each sample (n,)."""
        unknown, known = pool.standardised()
        config = Clustering()
        with seeded(self.seed):
            return cluster(
                Projection(unknown.shape[1]),
                unknown,
                known,
                pool.labels,
                lambda features: self.pairs(self.similarity(features()), config),
                lambda features, _: random_head(features, config.candidates),
                config,
                self.seed,
            ).assignment
