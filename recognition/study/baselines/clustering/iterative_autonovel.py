"""Iterative clustering by ranking statistics."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recognition.study.baselines.clustering.iterative import IterativeMethod
from recognition.study.strategies import soft_pairs
from recognition.trfe.discovery.clustering import Clustering, Pairs
from recognition.trfe.samples import Features

TITLE = "iterative AutoNovel"

TOP = 5
"""Strongest features that two samples must share."""


class IterativeAutoNovel(IterativeMethod):
    """w_ij = 1 where the five features of greatest magnitude are the same set in both samples, else 0.

    Han et al., Automatically Discovering and Learning New Visual Categories with Ranking Statistics, ICLR 2020.
    """

    def similarity(self, features: Features) -> NDArray[np.float32]:
        """w (n, n) of features (n, d), 0 or 1."""
        strongest = np.sort(np.argsort(-np.abs(features), axis=1, kind="stable")[:, :TOP], axis=1)
        _, same = np.unique(strongest, axis=0, return_inverse=True)
        return (same[:, None] == same[None, :]).astype(np.float32)

    def pairs(self, similarity: NDArray[np.float32], config: Clustering) -> Pairs:
        """Targets of pairs from S (n, n)."""
        return soft_pairs(similarity)


METHOD = IterativeAutoNovel
