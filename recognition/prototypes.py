"""Known classes as centres with radii: how far a sample is from all of them."""

from __future__ import annotations

from typing import Literal, NamedTuple, Self, get_args

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.distance import cdist

from recognition.samples import Features, Floats, Whole, class_labels, matrix
from schemas.errors import UsageError

Metric = Literal["euclidean", "cosine", "margin"]
_OWN = 0.95
"""Share of a class's own samples that are within its radius."""


class Prototypes(NamedTuple):
    """Centres of the known classes in standardised features, and what counts as near them.

    Args:
        metric: `euclidean` and `cosine` measure the distance to the nearest centre; `margin` how much further the second
            nearest centre is than the nearest, which is small for samples between classes.
        classes: labels (K,), ascending.
        centres: (K, d), standardised.
        radii: ρ (K,), the 95th percentile of a class's own distances to its centre; for `margin` the 5th of its own margins.
        mean, scale: (d,), for standardising.
    """

    metric: Metric
    classes: Whole
    centres: Features
    radii: Floats
    mean: Features
    scale: Features

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
        mean, spread = table.mean(axis=0), table.std(axis=0)
        scale = np.where(spread > 0.0, spread, 1.0).astype(np.float32)
        standard = (table - mean) / scale
        centres = np.stack([standard[columns == column].mean(axis=0) for column in range(len(classes))])
        bare = cls(metric, classes, centres, np.ones(len(classes)), mean, scale)
        nearness = bare._nearness(standard)
        quantile = 1.0 - _OWN if metric == "margin" else _OWN
        radii = [np.quantile(nearness[columns == column, column], quantile) for column in range(len(classes))]
        return bare._replace(radii=np.maximum(radii, np.finfo(np.float32).tiny))

    def standardise(self, features: ArrayLike) -> Features:
        """Features (n, d) with mean 0 and standard deviation 1 over the samples fitted on."""
        return (matrix(features, len(self.mean)) - self.mean) / self.scale

    def ratio(self, features: ArrayLike) -> Floats:
        """r(h) = min_c ‖h − μ_c‖/ρ_c (n,); 1 is the margin of the known classes, more is beyond it.

        With the metric `margin`, r(h) = ρ_c / margin(h) for the nearest class c.
        """
        nearness = self._nearness(self.standardise(features))
        if self.metric != "margin":
            return (nearness / self.radii).min(axis=1)
        nearest = nearness.argmax(axis=1)
        return self.radii[nearest] / np.maximum(nearness.max(axis=1), np.finfo(np.float32).tiny)

    def _nearness(self, standard: Features) -> Floats:
        """Distances (n, K), or margins: how much further than class c the nearest other class is."""
        if self.metric != "margin":
            return cdist(standard, self.centres, self.metric)
        distances = cdist(standard, self.centres)
        first, second = np.partition(distances, 1, axis=1)[:, :2].T[:, :, None]
        return np.where(distances == first, second, first) - distances
