"""Samples of features with their classes, prototypes of classes, and principal axes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.distance import cdist

from schemas.common.array_types import FloatArray, IntArray
from schemas.common.errors import UsageError

Features = NDArray[np.float32]

UNKNOWN = 0
"""Label of what belongs to no known class; the same as `recognition.labels.Label.UNKNOWN`."""
BACKGROUND = 100
"""Label of windows in which nothing happens that a class is for; a known class to the model, and
nothing to be found."""
_QUIET = 3
"""Samples of the background that are drawn for each one of a class: it is of many kinds, and most
of what a recording holds."""


def matrix(features: ArrayLike, width: int | None = None, least: int = 0) -> Features:
    """Features (n, d) as contiguous float32.

    Raises:
        UsageError: they are no table of numbers, hold NaN or infinity, have not `width` columns, or
            fewer than `least` rows.
    """
    table = np.ascontiguousarray(features, dtype=np.float32)
    if table.ndim != 2 or not table.shape[1]:
        raise UsageError(
            f"features must be a table (samples, dimensions), not of shape {table.shape}"
        )
    if width is not None and table.shape[1] != width:
        raise UsageError(
            f"features have {table.shape[1]} dimensions, the model was fitted on {width}"
        )
    if len(table) < least:
        raise UsageError(f"{len(table)} samples are too few, at least {least} are needed")
    broken = np.flatnonzero(~np.isfinite(table).all(axis=1))
    if len(broken):
        raise UsageError(
            f"features of sample {broken[0]} are not finite, as those of {len(broken)} of "
            f"{len(table)} samples"
        )
    return table


def class_labels(labels: ArrayLike, samples: int, least_classes: int = 1) -> IntArray:
    """Labels (n,) of `samples` samples, each the positive number of a class.

    Raises:
        UsageError: another number of labels, labels that are no positive whole numbers, or too few
            classes.
    """
    values = np.asarray(labels)
    if values.shape != (samples,):
        raise UsageError(
            f"{samples} samples need as many labels, not labels of shape {values.shape}"
        )
    if not np.issubdtype(values.dtype, np.integer) or (values <= UNKNOWN).any():
        raise UsageError("labels of known classes must be positive whole numbers")
    if len(np.unique(values)) < least_classes:
        raise UsageError(
            f"{len(np.unique(values))} known classes are too few, at least "
            f"{least_classes} are needed"
        )
    return values.astype(np.int64)


def drawn_of_each(labels: IntArray, most: int | None, generator: np.random.Generator) -> IntArray:
    """Draw indices of samples with labels (n,), at most `most` a class; class by class, in the
    order drawn.

    Of the background there may be three times as many.
    """

    def limit(label: int) -> int | None:
        return most if most is None or label != BACKGROUND else _QUIET * most

    drawn = [
        generator.permutation(np.flatnonzero(labels == label))[: limit(label)]
        for label in np.unique(labels)
    ]
    return np.concatenate(drawn) if drawn else np.zeros(0, dtype=np.int64)


def deviations(features: Features) -> Features:
    """Standard deviation (d,) of each feature of (n, d), to divide by: 1 where it does not vary."""
    spread = features.std(axis=0)
    return np.where(spread > 0.0, spread, 1.0).astype(np.float32)


def unit(features: Features) -> Features:
    """Features (n, d) cut to unit length; those that are all 0 stay so."""
    lengths = np.linalg.norm(features, axis=1, keepdims=True)
    return (features / np.maximum(lengths, np.finfo(np.float32).tiny)).astype(np.float32)


_OWN = 0.95
"""Share of a class's own samples that are within its radius."""
_SHRINKAGE = 0.05
"""Of the covariance, so that few samples do not make directions that they hardly vary in count
most."""


@dataclass(frozen=True, eq=False)
class Prototypes:
    """Centres of the known classes in standardised features, and what counts as near them.

    Within the known classes standardised features vary alike in all directions, so that what varies
    there anyway, such as traffic nearby, counts little.

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
            beside: features (m, d) of samples of no known class, by which the features' scales are
                measured too: what never varies in the known classes would count without bounds in
                others.

        Raises:
            UsageError: features that are not finite, labels that are no positive whole numbers.
        """
        table = matrix(features)
        classes, columns = np.unique(class_labels(labels, len(table)), return_inverse=True)
        scales = deviations(
            table if beside is None else np.concatenate([table, matrix(beside, table.shape[1])])
        )
        mean, axes = table.mean(axis=0), cls._axes(table, columns, scales)
        standard = (table - mean) @ axes
        centres = np.stack(
            [standard[columns == column].mean(axis=0) for column in range(len(classes))]
        )
        found = cls(classes, centres, np.ones(len(classes)), mean, axes)
        return replace(
            found, radii=np.maximum(found._radii(standard, columns), np.finfo(np.float32).tiny)
        )

    def standardise(self, features: ArrayLike) -> Features:
        """Features (n, d) with mean 0 and, within the classes, standard deviation 1."""
        return np.asarray(
            (matrix(features, len(self.mean)) - self.mean) @ self.axes, dtype=np.float32
        )

    def ratio(self, features: ArrayLike) -> FloatArray:
        """r(h) = min_c ‖h − μ_c‖/ρ_c (n,); 1 is the margin of the known classes,
        more is beyond it.
        """
        return (self.distances(self.standardise(features), self.centres) / self.radii).min(axis=1)

    def distances(self, standard: Features, others: Features) -> FloatArray:
        """Distances (n, m) between standardised features (n, d) and (m, d)."""
        return cdist(standard, others)

    @staticmethod
    def _axes(features: Features, columns: IntArray, scales: Features) -> Features:
        """Axes (d, d) along which the classes' common covariance, shrunk towards a sphere, is 1.

        Source: the distance of Lee et al., "A Simple Unified Framework for Detecting
        Out-of-Distribution Samples" (NeurIPS 2018).
        """
        scaling = np.diag(1.0 / scales).astype(np.float32).astype(np.float64)
        standard = features @ scaling
        counts = np.bincount(columns)
        means = np.stack([np.bincount(columns, values) / counts for values in standard.T], axis=1)
        within = np.cov(standard - means[columns], rowvar=False, bias=True).reshape(
            2 * [len(scaling)]
        )
        sphere = np.trace(within) / len(within) * np.eye(len(within))
        variances, axes = np.linalg.eigh((1.0 - _SHRINKAGE) * within + _SHRINKAGE * sphere)
        # Directions without variance would be scaled without bounds.
        return (scaling @ axes / np.sqrt(np.maximum(variances, np.finfo(np.float32).eps))).astype(
            np.float32
        )

    def _radii(self, standard: Features, columns: IntArray) -> FloatArray:
        """ρ (K,) from the standardised features (n, d) of samples of the classes `columns` (n,)."""
        own = self.distances(standard, self.centres)
        return np.array(
            [
                np.quantile(own[columns == column, column], _OWN)
                for column in range(len(self.classes))
            ]
        )


_WEIGHTS = 1.0, 0.5
"""Of features before and after fine-tuning, which lays new classes onto known ones."""


class PrincipalAxes(NamedTuple):
    """The principal axes of samples on the unit sphere around the known classes.

    Features are standardised by the prototypes and cut to unit length, each part for itself: how
    far a sample is from what is known says less about its class than the direction in which it is.

    Args:
        prototypes: of the known classes, in each part of the features.
        axes: (d, c), divided by the samples' mean deviation along them.
    """

    prototypes: tuple[Prototypes, ...]
    axes: Features

    @classmethod
    def fit(
        cls, prototypes: Sequence[Prototypes], parts: Sequence[Features], components: int
    ) -> Self:
        """Fit the first `components` principal axes of samples, or all if there are fewer.

        Args:
            prototypes, parts: of the known classes and features (n, .) of the samples, for each
                part of the features.
        """
        width = sum(part.shape[1] for part in parts)
        bare = cls(tuple(prototypes), np.eye(width, dtype=np.float32))
        sphere = bare.project(parts)
        axes = np.linalg.svd(sphere - sphere.mean(axis=0), full_matrices=False)[2][:components].T
        # One divisor for all axes, so that strong directions stay longer than weak ones.
        spread = float((sphere @ axes).std(axis=0).mean())
        return bare._replace(
            axes=(axes / max(spread, np.finfo(np.float32).tiny)).astype(np.float32)
        )

    def project(self, parts: Sequence[Features]) -> Features:
        """Coordinates (n, c) along the axes of samples whose features are in these parts, each (n,
        .)."""
        # One part or two: a single one has the first weight.
        weighted = zip(self.prototypes, parts, _WEIGHTS, strict=False)
        return (
            np.concatenate(
                [weight * unit(one.standardise(part)) for one, part, weight in weighted], axis=1
            )
            @ self.axes
        )
