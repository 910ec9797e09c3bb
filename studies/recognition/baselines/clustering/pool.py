"""Contract of clustering methods: samples of unknown classes in, cluster numbers out."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from recognition.trfe.config import Config, Steps
from recognition.trfe.forest.known import Labelled, clustering_axes
from recognition.trfe.inputs.samples import Features
from schemas.common.array_types import IntArray
from studies.recognition.semi_supervised import likely_classes


@dataclass(frozen=True, eq=False)
class Pool:
    """Samples to cluster, and the labelled ones beside them.

    Attributes:
        features: of the unknown samples (n, d).
        grids: of the same samples, uint8 (n, frames, channels, rows, columns).
        known, labels: features (m, d) and classes (m,) of the labelled samples.
        classes: true number of classes among the unknown samples; only methods that say so look at
            it.
        config: TRFE's, which says of what the features are.
    """

    features: Features
    grids: NDArray[np.uint8]
    known: Features
    labels: IntArray
    classes: int
    config: Config = field(default_factory=Config)

    @cached_property
    def codes(self) -> Features:
        """Codes (n, 32) of the grids, see `studies.recognition.baselines.clustering.stae`; two
        methods share them."""
        from studies.recognition.baselines.clustering.stae import stae_codes

        return stae_codes(self.grids, seed=0)

    @cached_property
    def directions(self) -> tuple[Features, Features]:
        """The unknown and the labelled samples along the axes in which TRFE clusters, (n, c) and
        (m, c)."""
        axes = clustering_axes(
            Labelled(self.known, self.labels), self.features, self.config, Steps()
        )
        unknown, known = (
            axes.project(self.config.clustering_parts(of)) for of in (self.features, self.known)
        )
        return unknown, known

    @cached_property
    def likely_classes(self) -> int:
        """Number of classes among the unknown samples, estimated on held-out known classes along
        the axes of both together: those of `directions` begin at the known classes, which are
        nowhere along them."""
        parts = (
            np.concatenate(self.config.clustering_parts(of), axis=1)
            for of in (self.features, self.known)
        )
        unknown, known = _standard(*parts)
        both = np.concatenate([unknown, known])
        axes = np.linalg.svd(both - both.mean(axis=0), full_matrices=False)[2][
            : self.config.components
        ].T
        return likely_classes(unknown @ axes, known @ axes, self.labels)

    def standardised(self) -> tuple[Features, Features]:
        """Features of the unknown and of the labelled samples, with mean 0 and deviation 1 over
        both together."""
        return _standard(
            self.config.recognising(self.features), self.config.recognising(self.known)
        )


def _standard(unknown: Features, known: Features) -> tuple[Features, Features]:
    both = np.concatenate([unknown, known])
    standard = ((both - both.mean(axis=0)) / (both.std(axis=0) + 1e-6)).astype(np.float32)
    return standard[: len(unknown)], standard[len(unknown) :]


class ClusteringMethod(ABC):
    """A way to cluster samples of unknown classes.

    Args:
        seed: of everything random in it.

    Attributes:
        given_count: whether it is given the true number of classes.
    """

    given_count: ClassVar[bool] = False

    def __init__(self, seed: int = 0) -> None:
        self.seed = seed

    @abstractmethod
    def cluster(self, pool: Pool) -> IntArray:
        """Cluster number of each sample (n,); −1 for samples that are put into none."""
