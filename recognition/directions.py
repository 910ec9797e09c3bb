"""In which directions of the features the samples of a buffer differ: what clustering looks at."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np

from recognition.prototypes import Prototypes
from recognition.samples import Features


class Directions(NamedTuple):
    """The principal directions of samples on the unit sphere around the known classes.

    Features are standardised by the prototypes and cut to unit length: how far a sample is from what is known says less about its
    class than in which direction it is.

    Args:
        prototypes: of the known classes.
        axes: (d, c), divided by the samples' mean deviation along them.
    """

    prototypes: Prototypes
    axes: Features

    @classmethod
    def fit(cls, prototypes: Prototypes, features: Features, components: int) -> Self:
        """The first `components` principal directions of features (n, d), or as many as there are."""
        unit = _unit(prototypes.standardise(features))
        axes = np.linalg.svd(unit - unit.mean(axis=0), full_matrices=False)[2][:components].T
        spread = float((unit @ axes).std(axis=0).mean())
        return cls(prototypes, (axes / max(spread, np.finfo(np.float32).tiny)).astype(np.float32))

    def of(self, features: Features) -> Features:
        """Features (n, d) along the directions (n, c)."""
        return _unit(self.prototypes.standardise(features)) @ self.axes


def _unit(features: Features) -> Features:
    lengths = np.linalg.norm(features, axis=1, keepdims=True)
    return (features / np.maximum(lengths, np.finfo(np.float32).tiny)).astype(np.float32)
