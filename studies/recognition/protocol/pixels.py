"""Features without an encoder: principal components of coarse grids, the cheap row that an encoder
has to beat."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recognition.trfe.inputs.samples import Features

PRESET = "pca"
"""Name of these features among the presets of the encoder."""
_BLOCK = 2
"""Cells along each axis that are averaged."""
_COMPONENTS, _FITTED = 128, 4000
"""Components, and windows that they are fitted on, at most."""
_WINDOWS = 8
"""Windows for each component, at least. Of fewer, components follow the training windows: these
then lie further from each other than test windows do, and distances learnt on them mislead."""
_BATCH = 1000


def pixel_features(training: NDArray[np.uint8], grids: NDArray[np.uint8], seed: int) -> Features:
    """Scores (n, components) of grids on the principal components of training grids.

    Args:
        training: uint8 (m, frames, channels, rows, columns); of many, some are drawn.
        grids: uint8 (n, …), of the same shape.
        seed: of what is drawn.
    """
    from sklearn.decomposition import PCA

    chosen = np.random.default_rng(seed).permutation(len(training))[:_FITTED]
    sample = _coarse(training[np.sort(chosen)])
    most = min(_COMPONENTS, max(len(sample) // _WINDOWS, 1), sample.shape[1])
    model = PCA(most, svd_solver="randomized", random_state=seed).fit(sample)
    parts = [
        model.transform(_coarse(grids[start : start + _BATCH]))
        for start in range(0, len(grids), _BATCH)
    ]
    return np.concatenate(parts).astype(np.float32)


def _coarse(grids: NDArray[np.uint8]) -> Features:
    """Means (n, pixels) over blocks of cells; what is left over at the far edges is dropped."""
    rows, columns = (edge // _BLOCK * _BLOCK for edge in grids.shape[3:])
    blocks = grids[..., :rows, :columns].reshape(
        *grids.shape[:3], rows // _BLOCK, _BLOCK, columns // _BLOCK, _BLOCK
    )
    return blocks.mean(axis=(4, 6), dtype=np.float32).reshape(len(grids), -1) / 255.0
