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

    Features are standardised by the prototypes and cut to unit length, those of before fine-tuning and those of after it each for
    itself: how far a sample is from what is known says less about its class than the direction in which it is.

    Args:
        prototypes: of the known classes, in each of those parts of the features.
        axes: (d, c), divided by the samples' mean deviation along them.
    """

    prototypes: tuple[Prototypes, ...]
    axes: Features

    @classmethod
    def fit(cls, prototypes: Sequence[Prototypes], features: Features, components: int) -> Self:
        """The first `components` principal axes of features (n, d), or as many as there are."""
        bare = cls(tuple(prototypes), np.eye(features.shape[1], dtype=np.float32))
        sphere = bare.project(features)
        axes = np.linalg.svd(sphere - sphere.mean(axis=0), full_matrices=False)[2][:components].T
        spread = float((sphere @ axes).std(axis=0).mean())
        return bare._replace(axes=(axes / max(spread, np.finfo(np.float32).tiny)).astype(np.float32))

    def project(self, features: Features) -> Features:
        """Coordinates (n, c) of features (n, d) along the axes."""
        ends = np.cumsum([len(part.mean) for part in self.prototypes])[:-1]
        parts = zip(self.prototypes, np.split(features, ends, axis=1), _WEIGHTS, strict=False)
        return np.concatenate([weight * unit(one.standardise(part)) for one, part, weight in parts], axis=1) @ self.axes
