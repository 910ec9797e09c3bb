"""An encoder of occupancy grids: space-time patches of a window to one feature vector."""

from __future__ import annotations

import math

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from recognition.encoder.augmentation import augmented
from recognition.encoder.blocks import Block
from recognition.encoder.config import Architecture
from recognition.encoder.model import Encoder
from recognition.grids import Grid
from schemas.errors import UsageError

_STEM = 4
"""Cells along each axis that the convolutions of the front-end make into one place."""
_STEM_CHANNELS = (16, 32)
_SPREAD = 0.02
"""Standard deviation of untrained embeddings of places and times"""


class GridEncoder(Encoder):
    """A transformer over space-time patches.

    Args:
        architecture: its sizes.
        grid: of the windows that it reads.
    """

    architecture: Architecture
    view: Grid

    def __init__(self, architecture: Architecture, grid: Grid) -> None:
        super().__init__(architecture, grid)
        frames, channels, rows, columns = grid.shape
        depth, height, width = architecture.patch
        if frames % depth:
            raise UsageError(f"patches of {depth} frames do not fit windows of {frames}")
        self._times, self._rows, self._columns = frames // depth, math.ceil(rows / height), math.ceil(columns / width)
        self.front: nn.Module | None = None
        if architecture.front == "cnn":
            if height % _STEM or width % _STEM:
                raise UsageError(f"patches of an encoder with convolutions have edges that are multiples of {_STEM}")
            self.front = _convolutions(depth * channels)
            height, width, depth, channels = height // _STEM, width // _STEM, 1, _STEM_CHANNELS[-1]
        dim, places = architecture.dim, self._rows * self._columns
        self.embedding = nn.Linear(depth * channels * height * width, dim)
        self.place = nn.Parameter(_drawn(places, dim))
        self.time = nn.Parameter(_drawn(self._times, 1, dim))
        self.blocks = nn.ModuleList(Block(architecture) for _ in range(architecture.depth))

    def forward(self, grids: Tensor) -> Tensor:
        """Features (n, dim) of grids (n, frames, channels, rows, columns), uint8 or floats from 0 to 255.

        Raises:
            UsageError: the grids have another shape than the encoder's.
        """
        self.require_shape(grids)
        tokens = self.embedding(self._tokens(grids)) + self.place + self.time
        for block in self.blocks:
            tokens = block(tokens)
        return self.norm(tokens.mean(dim=(1, 2), dtype=torch.float32))

    def augmented(self, grids: Tensor) -> Tensor:
        """See `recognition.encoder.augmentation`."""
        return augmented(grids)

    def _tokens(self, grids: Tensor) -> Tensor:
        """Values of each token: (n, times, places, values)."""
        kind = self.embedding.weight.dtype
        if torch.is_autocast_enabled(grids.device.type):
            kind = torch.get_autocast_dtype(grids.device.type)
        cells = self._padded(grids).to(kind, copy=True).div_(255.0)
        cells = cells.unflatten(1, (self._times, -1))  # (n, times, frames of a patch, channels, rows, columns)
        if self.front is not None:
            cells = self.front(cells.flatten(2, 3).flatten(0, 1)).unflatten(0, cells.shape[:2]).unsqueeze(2)
        return self.architecture.cut(cells, self._rows, self._columns).reshape(
            len(grids), self._times, self._rows * self._columns, -1
        )

    def _padded(self, grids: Tensor) -> Tensor:
        """Grids with empty rows and columns at the end, so that patches fit."""
        _, height, width = self.architecture.patch
        below, behind = self._rows * height - grids.shape[3], self._columns * width - grids.shape[4]
        return F.pad(grids, (0, behind, 0, below)) if below or behind else grids


def _drawn(*shape: int) -> Tensor:
    """Untrained embeddings; no numbers on the device `meta`, for which torch would import its compiler first."""
    values = torch.empty(shape)
    return values if values.is_meta else values.normal_(std=_SPREAD)


def _convolutions(channels: int) -> nn.Module:
    """Two convolutions over the frames of a patch, stacked as channels."""
    first, second = _STEM_CHANNELS
    return nn.Sequential(
        nn.Conv2d(channels, first, 3, stride=2, padding=1),
        nn.ReLU(),
        nn.Conv2d(first, second, 3, stride=2, padding=1),
        nn.ReLU(),
    )
