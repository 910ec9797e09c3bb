"""Samples as every step of TRFE takes them: rows of finite features, whole numbers as class labels."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schemas.errors import UsageError
from xodr.array_types import IntArray

Features = NDArray[np.float32]

UNKNOWN = 0
"""Label of what belongs to no known class; the same as `recognition.labels.Label.UNKNOWN`."""
BACKGROUND = 100
"""Label of windows in which nothing happens that a class is for; a known class to the model, and nothing to be found."""
_QUIET = 3
"""Samples of the background that are drawn for each one of a class: it is of many kinds, and most of what a recording holds."""


def matrix(features: ArrayLike, width: int | None = None, least: int = 0) -> Features:
    """Features (n, d) as contiguous float32.

    Raises:
        UsageError: they are no table of numbers, hold NaN or infinity, have not `width` columns, or fewer than `least` rows.
    """
    table = np.ascontiguousarray(features, dtype=np.float32)
    if table.ndim != 2 or not table.shape[1]:
        raise UsageError(f"features must be a table (samples, dimensions), not of shape {table.shape}")
    if width is not None and table.shape[1] != width:
        raise UsageError(f"features have {table.shape[1]} dimensions, the model was fitted on {width}")
    if len(table) < least:
        raise UsageError(f"{len(table)} samples are too few, at least {least} are needed")
    broken = np.flatnonzero(~np.isfinite(table).all(axis=1))
    if len(broken):
        raise UsageError(f"features of sample {broken[0]} are not finite, as those of {len(broken)} of {len(table)} samples")
    return table


def class_labels(labels: ArrayLike, samples: int, least_classes: int = 1) -> IntArray:
    """Labels (n,) of `samples` samples, each the positive number of a class.

    Raises:
        UsageError: another number of labels, labels that are no positive whole numbers, or too few classes.
    """
    values = np.asarray(labels)
    if values.shape != (samples,):
        raise UsageError(f"{samples} samples need as many labels, not labels of shape {values.shape}")
    if not np.issubdtype(values.dtype, np.integer) or (values <= UNKNOWN).any():
        raise UsageError("labels of known classes must be positive whole numbers")
    if len(np.unique(values)) < least_classes:
        raise UsageError(f"{len(np.unique(values))} known classes are too few, at least {least_classes} are needed")
    return values.astype(np.int64)


def drawn_of_each(labels: IntArray, most: int | None, generator: np.random.Generator) -> IntArray:
    """Numbers of at most so many samples of each class among labels (n,), drawn; class by class, in the order drawn.

    Of the background there may be three times as many.
    """

    def limit(label: int) -> int | None:
        return most if most is None or label != BACKGROUND else _QUIET * most

    drawn = [generator.permutation(np.flatnonzero(labels == label))[: limit(label)] for label in np.unique(labels)]
    return np.concatenate(drawn) if drawn else np.zeros(0, dtype=np.int64)


def deviations(features: Features) -> Features:
    """Standard deviation (d,) of each feature of (n, d), to divide by: 1 where it does not vary."""
    spread = features.std(axis=0)
    return np.where(spread > 0.0, spread, 1.0).astype(np.float32)


def unit(features: Features) -> Features:
    """Features (n, d) cut to unit length; those that are all 0 stay so."""
    lengths = np.linalg.norm(features, axis=1, keepdims=True)
    return (features / np.maximum(lengths, np.finfo(np.float32).tiny)).astype(np.float32)
