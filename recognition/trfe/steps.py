"""The steps of TRFE that can be replaced: the method's own by default, others where a study compares them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from recognition.trfe.config import Config
from recognition.trfe.discovery.clusterer import Task, cluster_online
from recognition.trfe.forest.rfap import random_trees, similarity
from recognition.trfe.forest.voting import VotingForest, grow
from recognition.trfe.prototypes import Prototypes
from recognition.trfe.samples import Features
from recognition.trfe.screening import EvtJoint, Screening
from xodr.array_types import IntArray


class Grow(Protocol):
    """Fits a forest on features (n, d) and labels (n,), see `recognition.trfe.forest.voting.grow`."""

    def __call__(self, features: Features, labels: IntArray, *, trees: int, seed: int) -> VotingForest: ...


def unsupervised_similarity(
    features: Features, coordinates: Features, forest: VotingForest, config: Config
) -> NDArray[np.float32]:
    """S (n, n) of samples under completely random trees, grown without labels on their coordinates (n, c).

    Args:
        features, coordinates: of the samples, and these along the principal axes.
        forest: of the known classes.
        config: number of trees and seed.
    """
    return similarity(random_trees(coordinates, config.trees, seed=config.seed), coordinates)


@dataclass(frozen=True)
class Steps:
    """Functions that do the steps.

    Attributes:
        grow: fits the forest on labelled samples.
        screening: the screening with a δ and a seed, not calibrated yet.
        prototypes: centres of labelled samples, see `Prototypes.fit`.
        similarity: S of samples, see `unsupervised_similarity`.
        cluster: numbers of the clusters of samples.
    """

    grow: Grow = grow
    screening: Callable[[float, int], Screening] = EvtJoint
    prototypes: Callable[..., Prototypes] = Prototypes.fit
    similarity: Callable[[Features, Features, VotingForest, Config], NDArray[np.float32]] = unsupervised_similarity
    cluster: Callable[[Task, Config], IntArray] = cluster_online
