"""Spatio-temporal autoencoder: grids of a window to a short code and back, without labels."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from recognition.trfe.inputs.samples import Features
from recognition.trfe.training.windows import seeded

Size = tuple[int, int, int]
_STRIDES: tuple[Size, ...] = ((1, 2, 2), (2, 2, 2), (2, 2, 2))
"""Of the convolutions, over (frames, rows, columns)."""
_CHANNELS = (8, 16, 32)
CODE = 32
"""Size of the code."""
_STEPS, _BATCH, _RATE = 400, 32, 2e-3


class Autoencoder(nn.Module):
    """Three 3-D convolutions and a linear layer to the code, and the same backwards.

    Args:
        channels, size: of windows (n, channels, frames, rows, columns).
    """

    def __init__(self, channels: int, size: Size) -> None:
        super().__init__()
        down: list[nn.Module] = []
        up: list[nn.Module] = []
        for after, stride in zip(_CHANNELS, _STRIDES, strict=True):
            smaller = _each(lambda edge, step: (edge - 1) // step + 1, size, stride)
            lost = _each(
                lambda edge, step: (edge - 1) % step, size, stride
            )  # which going backwards has to add again
            down += [nn.Conv3d(channels, after, 3, stride, 1), nn.ReLU()]
            up = [nn.ConvTranspose3d(after, channels, 3, stride, 1, lost), nn.ReLU(), *up]
            channels, size = after, smaller
        flat = channels * math.prod(size)
        self.encoder = nn.Sequential(*down, nn.Flatten(), nn.Linear(flat, CODE))
        self.decoder = nn.Sequential(
            nn.Linear(CODE, flat), nn.ReLU(), nn.Unflatten(1, (channels, *size)), *up[:-1]
        )

    def forward(self, windows: Tensor) -> Tensor:
        """Logits of the cells of the reconstruction."""
        out: Tensor = self.decoder(self.encoder(windows))
        return out


def _each(function: Callable[[int, int], int], size: Size, stride: Size) -> Size:
    return function(size[0], stride[0]), function(size[1], stride[1]), function(size[2], stride[2])


def stae_codes(grids: NDArray[np.uint8], seed: int) -> Features:
    """Codes (n, 32) of windows, from an autoencoder trained on the same windows by cell-wise cross
    entropy.

    Rows and columns are halved first, by means of 2 × 2 cells.

    Args:
        grids: uint8 (n, frames, channels, rows, columns), 0 to 255.
        seed: of weights and batches.

    Source: convolutional 3-D autoencoder after Zhao et al., Spatio-Temporal AutoEncoder for Video
    Anomaly Detection, ACM Multimedia 2017, as a feature extractor for clustering of traffic
    scenarios.
    """
    cells = torch.from_numpy(np.moveaxis(grids, 2, 1).astype(np.float32) / 255.0)
    windows = functional.avg_pool3d(cells, (1, 2, 2), ceil_mode=True)
    with seeded(seed):
        channels, frames, rows, columns = windows.shape[1:]
        model = Autoencoder(channels, (frames, rows, columns))
        optimiser = torch.optim.Adam(model.parameters(), lr=_RATE)
        for _ in range(math.ceil(_STEPS / math.ceil(len(windows) / _BATCH))):
            for batch in torch.randperm(len(windows)).split(_BATCH):
                optimiser.zero_grad()
                functional.binary_cross_entropy_with_logits(
                    model(windows[batch]), windows[batch]
                ).backward()
                optimiser.step()
    with torch.no_grad():
        return torch.cat([model.encoder(some) for some in windows.split(_BATCH)]).numpy()
