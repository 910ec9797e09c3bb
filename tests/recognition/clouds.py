"""Made-up features: one Gaussian cloud for each class."""

from __future__ import annotations

import numpy as np

from recognition.trfe.inputs.samples import Features
from schemas.common.array_types import IntArray


def clouds(
    labels: list[int], each: int, seed: int, apart: float = 5.0, width: int = 16
) -> tuple[Features, IntArray]:
    """`each` samples of every label, in `width` dimensions, around a centre that
    the label alone decides, shuffled.
    """
    generator = np.random.default_rng(seed)
    truth = generator.permutation(np.repeat(labels, each))
    centres = {
        label: apart * np.random.default_rng(label).standard_normal(width) / 2.0 for label in labels
    }
    noise = generator.standard_normal((len(truth), width))
    return (np.array([centres[label] for label in truth.tolist()]) + noise).astype(
        np.float32
    ), truth.astype(np.int64)
