"""Known classes as centres with radii: how far a sample is from all of them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.distance import cdist

from recognition.trfe.samples import Features, class_labels, deviations, matrix
from xodr.array_types import FloatArray, IntArray

_OWN = 0.95
"""Share of a class's own samples that are within its radius."""
_SHRINKAGE = 0.05
"""Of the covariance, so that few samples do not make directions that they hardly vary in count most."""


@dataclass(frozen=True, eq=False)
class Prototypes:
    """Centres of the known classes in standardised features, and what counts as near them.

    Within the known classes standardised features vary alike in all directions, so that what varies there anyway, such as
    traffic nearby, counts little.

    Attributes:
        classes: labels (K,), ascending.
        centres: (K, d), standardised.
        radii: ρ (K,), the 95th percentile of a class's own distances to its centre.
        mean: (d,), axes: (d, d), for standardising.
    """

    classes: IntArray
    centres: Features
    radii: FloatArray
    mean: Features
    axes: Features

    @classmethod
    def fit(cls, features: ArrayLike, labels: ArrayLike, beside: ArrayLike | None = None) -> Self:
        """Prototypes of labelled features (n, d).

        Args:
            features, labels: of samples of the known classes.
            beside: features (m, d) of samples of no known class, by which the features' scales are measured too: what never
                varies in the known classes would count without bounds in others.

        Raises:
            UsageError: features that are not finite, labels that are no positive whole numbers.
        """
        table = matrix(features)
        classes, columns = np.unique(class_labels(labels, len(table)), return_inverse=True)
        scales = deviations(table if beside is None else np.concatenate([table, matrix(beside, table.shape[1])]))
        mean, axes = table.mean(axis=0), cls._axes(table, columns, scales)
        standard = (table - mean) @ axes
        centres = np.stack([standard[columns == column].mean(axis=0) for column in range(len(classes))])
        found = cls(classes, centres, np.ones(len(classes)), mean, axes)
        return replace(found, radii=np.maximum(found._radii(standard, columns), np.finfo(np.float32).tiny))

    def standardise(self, features: ArrayLike) -> Features:
        """Features (n, d) with mean 0 and, within the classes, standard deviation 1."""
        return np.asarray((matrix(features, len(self.mean)) - self.mean) @ self.axes, dtype=np.float32)

    def ratio(self, features: ArrayLike) -> FloatArray:
        """r(h) = min_c ‖h − μ_c‖/ρ_c (n,); 1 is the margin of the known classes, more is beyond it."""
        return (self.distances(self.standardise(features), self.centres) / self.radii).min(axis=1)

    def distances(self, standard: Features, others: Features) -> FloatArray:
        """Distances (n, m) between standardised features (n, d) and (m, d)."""
        return cdist(standard, others)

    @staticmethod
    def _axes(features: Features, columns: IntArray, scales: Features) -> Features:
        """Axes (d, d) along which the classes' common covariance, shrunk towards a sphere, is 1.

        Source: the distance of Lee et al., "A Simple Unified Framework for Detecting Out-of-Distribution Samples" (NeurIPS 2018).
        """
        scaling = np.diag(1.0 / scales).astype(np.float32).astype(np.float64)
        standard = features @ scaling
        counts = np.bincount(columns)
        means = np.stack([np.bincount(columns, values) / counts for values in standard.T], axis=1)
        within = np.cov(standard - means[columns], rowvar=False, bias=True).reshape(2 * [len(scaling)])
        sphere = np.trace(within) / len(within) * np.eye(len(within))
        variances, axes = np.linalg.eigh((1.0 - _SHRINKAGE) * within + _SHRINKAGE * sphere)
        return (scaling @ axes / np.sqrt(np.maximum(variances, np.finfo(np.float32).eps))).astype(np.float32)

    def _radii(self, standard: Features, columns: IntArray) -> FloatArray:
        """ρ (K,) from the standardised features (n, d) of samples of the classes `columns` (n,)."""
        own = self.distances(standard, self.centres)
        return np.array([np.quantile(own[columns == column, column], _OWN) for column in range(len(self.classes))])
