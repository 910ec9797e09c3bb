"""Clustering by the joint losses of TRFE, with another idea of which samples are alike."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from recognition.study.baselines.pool import ClusteringMethod, Pool
from recognition.trfe.samples import Features
from xodr.array_types import IntArray


class IterativeMethod(ClusteringMethod):
    """Known-class and novel head trained together as in `recognition.trfe.discovery.clustering`.

    Similarities are renewed in every epoch.

    Attributes:
        targets: how similarities become targets of pairs, see `recognition.trfe.discovery.clustering.Clustering`.
    """

    targets: ClassVar[Literal["three-way", "soft"]]

    @abstractmethod
    def similarity(self, features: Features) -> NDArray[np.float32]:
        """S (n, n) in [0, 1] of the features (n, d) learnt so far."""

    def cluster(self, pool: Pool) -> IntArray:
        """Cluster number of each sample (n,)."""
        from recognition.training.seeding import seeded
        from recognition.trfe.discovery.clustering import Clustering, Projection, cluster

        unknown, known = pool.standardised()
        config = Clustering(targets=self.targets, refreshed=True)
        with seeded(self.seed):
            backbone = Projection(unknown.shape[1])
            found = cluster(backbone, unknown, known, pool.labels, self.similarity, config, self.seed)
        return found.assignment
