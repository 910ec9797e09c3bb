"""Iterative clustering by ranking statistics."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recognition.trfe.discovery.candidates import Clustering
from recognition.trfe.discovery.clustering import Pairs, three_way_pairs
from recognition.trfe.inputs.samples import Features
from studies.recognition.baselines.clustering.iterative import IterativeMethod

TITLE = "iterative AutoNovel"

TOP = 5
"""Strongest features by which two samples are compared."""


class IterativeAutoNovel(IterativeMethod):
    """S_ij: how many of the five features of greatest magnitude both samples share, in three-way
    targets as TRFE's.

    As published, pairs are alike where all five are the same; among 192 features that are hardly
    any, and all samples end apart. Han et al., Automatically Discovering and Learning New Visual
    Categories with Ranking Statistics, ICLR 2020.
    """

    def similarity(self, features: Features) -> NDArray[np.float32]:
        """S (n, n) of features (n, d), the share of the five."""
        strongest = np.argsort(-np.abs(features), axis=1, kind="stable")[:, :TOP]
        among = np.zeros(features.shape, np.float32)
        np.put_along_axis(among, strongest, 1.0, axis=1)
        return (among @ among.T / TOP).astype(np.float32)

    def pairs(self, similarity: NDArray[np.float32], config: Clustering) -> Pairs:
        """Targets of pairs from S (n, n)."""
        return three_way_pairs(similarity, config)


METHOD = IterativeAutoNovel
