"""Known classes as centres with radii: how far a sample is from all of them."""

from __future__ import annotations

from typing import Literal, NamedTuple, Self, get_args

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.distance import cdist

from recognition.trfe.samples import Features, class_labels, deviations, matrix
from schemas.errors import UsageError
from xodr.array_types import FloatArray, IntArray

Metric = Literal["whitened", "euclidean", "cosine", "margin"]
_OWN = 0.95
"""Share of a class's own samples that are within its radius."""
_SHRINKAGE = 0.05
"""Of the covariance, so that few samples do not make directions that they hardly vary in count most."""


class Prototypes(NamedTuple):
    """Centres of the known classes in standardised features, and what counts as near them.

    Args:
        metric: `whitened`, `euclidean` and `cosine` measure the distance to the nearest centre; `margin` how much further the
            second nearest centre is than the nearest, which is small for samples between classes. `whitened` features vary
            within the known classes alike in all directions, so that what varies there anyway, such as traffic nearby, counts
            little; the others' features vary alike over all classes together.
        classes: labels (K,), ascending.
        centres: (K, d), standardised.
        radii: ρ (K,), the 95th percentile of a class's own distances to its centre; for `margin` the 5th of its own margins.
        mean: (d,), axes: (d, d), for standardising.
    """

    metric: Metric
    classes: IntArray
    centres: Features
    radii: FloatArray
    mean: Features
    axes: Features

    @classmethod
    def fit(cls, features: ArrayLike, labels: ArrayLike, metric: Metric = "euclidean") -> Self:
        """Prototypes of labelled features (n, d).

        Raises:
            UsageError: an unknown metric, features that are not finite, too few classes.
        """
        if metric not in get_args(Metric):
            raise UsageError(f"metric {metric!r} is none of {', '.join(get_args(Metric))}")
        table = matrix(features)
        truth = class_labels(labels, len(table), least_classes=2 if metric == "margin" else 1)
        classes, columns = np.unique(truth, return_inverse=True)
        mean = table.mean(axis=0)
        axes = _whitening(table, columns) if metric == "whitened" else _scaling(table)
        standard = (table - mean) @ axes
        centres = np.stack([standard[columns == column].mean(axis=0) for column in range(len(classes))])
        bare = cls(metric, classes, centres, np.ones(len(classes)), mean, axes)
        nearness = bare._nearness(standard)
        quantile = 1.0 - _OWN if metric == "margin" else _OWN
        radii = [np.quantile(nearness[columns == column, column], quantile) for column in range(len(classes))]
        return bare._replace(radii=np.maximum(radii, np.finfo(np.float32).tiny))

    def standardise(self, features: ArrayLike) -> Features:
        """Features (n, d) with mean 0 and standard deviation 1, over the samples fitted on or within their classes."""
        return np.asarray((matrix(features, len(self.mean)) - self.mean) @ self.axes, dtype=np.float32)

    def ratio(self, features: ArrayLike) -> FloatArray:
        """r(h) = min_c ‖h − μ_c‖/ρ_c (n,); 1 is the margin of the known classes, more is beyond it.

        With the metric `margin`, r(h) = ρ_c / margin(h) for the nearest class c.
        """
        nearness = self._nearness(self.standardise(features))
        if self.metric != "margin":
            return (nearness / self.radii).min(axis=1)
        nearest = nearness.argmax(axis=1)
        return self.radii[nearest] / np.maximum(nearness.max(axis=1), np.finfo(np.float32).tiny)

    def _nearness(self, standard: Features) -> FloatArray:
        """Distances (n, K), or margins: how much further than class c the nearest other class is."""
        if self.metric != "margin":
            return cdist(standard, self.centres, "cosine" if self.metric == "cosine" else "euclidean")
        distances = cdist(standard, self.centres)
        first, second = np.partition(distances, 1, axis=1)[:, :2].T[:, :, None]
        return np.where(distances == first, second, first) - distances


def _scaling(features: Features) -> Features:
    return np.diag(1.0 / deviations(features)).astype(np.float32)


def _whitening(features: Features, columns: IntArray) -> Features:
    """Axes (d, d) along which the classes' common covariance, shrunk towards a sphere, is 1.

    Source: the distance of Lee et al., "A Simple Unified Framework for Detecting Out-of-Distribution Samples" (NeurIPS 2018).
    """
    scaling = _scaling(features).astype(np.float64)
    standard = features @ scaling
    counts = np.bincount(columns)
    means = np.stack([np.bincount(columns, values) / counts for values in standard.T], axis=1)
    within = np.cov(standard - means[columns], rowvar=False, bias=True).reshape(2 * [len(scaling)])
    sphere = np.trace(within) / len(within) * np.eye(len(within))
    variances, axes = np.linalg.eigh((1.0 - _SHRINKAGE) * within + _SHRINKAGE * sphere)
    return (scaling @ axes / np.sqrt(np.maximum(variances, np.finfo(np.float32).eps))).astype(np.float32)
