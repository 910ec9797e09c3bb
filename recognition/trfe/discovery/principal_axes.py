"""The principal axes of the samples in a buffer: the coordinates in which they are clustered."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np

from recognition.trfe.prototypes import Prototypes
from recognition.trfe.samples import Features, unit

_WEIGHTS = 1.0, 0.5
"""Of features before and after fine-tuning, which lays new classes onto known ones."""


class PrincipalAxes(NamedTuple):
    """The principal axes of samples on the unit sphere around the known classes.

    Features are standardised by the prototypes and cut to unit length, each part for itself: how far a sample is from what is
    known says less about its class than the direction in which it is.

    Args:
        prototypes: of the known classes, in each part of the features.
        axes: (d, c), divided by the samples' mean deviation along them.
    """

    prototypes: tuple[Prototypes, ...]
    axes: Features

    @classmethod
    def fit(cls, prototypes: Sequence[Prototypes], parts: Sequence[Features], components: int) -> Self:
        """The first `components` principal axes of samples, or as many as there are.

        Args:
            prototypes, parts: of the known classes and features (n, .) of the samples, for each part of the features.
        """
        width = sum(part.shape[1] for part in parts)
        bare = cls(tuple(prototypes), np.eye(width, dtype=np.float32))
        sphere = bare.project(parts)
        axes = np.linalg.svd(sphere - sphere.mean(axis=0), full_matrices=False)[2][:components].T
        spread = float((sphere @ axes).std(axis=0).mean())
        return bare._replace(axes=(axes / max(spread, np.finfo(np.float32).tiny)).astype(np.float32))

    def project(self, parts: Sequence[Features]) -> Features:
        """Coordinates (n, c) along the axes of samples whose features are in these parts, each (n, .)."""
        each = zip(self.prototypes, parts, _WEIGHTS, strict=False)
        return np.concatenate([weight * unit(one.standardise(part)) for one, part, weight in each], axis=1) @ self.axes
