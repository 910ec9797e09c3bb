"""Iterative clustering by Euclidean distance."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import pdist, squareform

from recognition.trfe.discovery.candidates import Clustering
from recognition.trfe.discovery.clustering import Pairs, three_way_pairs
from recognition.trfe.inputs.samples import Features
from studies.recognition.baselines.clustering.iterative import IterativeMethod

TITLE = "iterative Euclidean"


class IterativeEuclidean(IterativeMethod):
    """S_ij = exp(−‖h_i − h_j‖² / median of the squared distances), in three-way targets as TRFE's.

    Balasubramanian et al., Traffic Scenario Clustering by Iterative Optimisation of Self-Supervised
    Networks Using a Random Forest Activation Pattern Similarity, IV 2021, where Euclidean distance
    is what their similarity is compared with.
    """

    def similarity(self, features: Features) -> NDArray[np.float32]:
        """S (n, n) of features (n, d)."""
        squared = pdist(features, "sqeuclidean")
        scale = float(np.median(squared)) or 1.0
        return squareform(np.exp(-squared / scale)).astype(np.float32) + np.eye(
            len(features), dtype=np.float32
        )

    def pairs(self, similarity: NDArray[np.float32], config: Clustering) -> Pairs:
        """Targets of pairs from S (n, n)."""
        return three_way_pairs(similarity, config)


METHOD = IterativeEuclidean
