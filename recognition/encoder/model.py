"""The encoder: grids of a window to one feature vector, and from there to classes."""

from __future__ import annotations

import math
from collections.abc import Sequence

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from recognition.encoder.blocks import Block
from recognition.encoder.config import Architecture
from recognition.grids import Grid
from schemas.errors import UsageError

_STEM = 4
"""Cells along each axis that the convolutions of the front-end make into one place."""
_STEM_CHANNELS = 32


class Encoder(nn.Module):
    """A transformer over space-time patches, with a class head once it has been fine-tuned.

    Args:
        architecture: its sizes.
        grid: of the windows that it reads.
        classes: labels that the head tells apart, ascending; none before fine-tuning.
    """

    def __init__(self, architecture: Architecture, grid: Grid, classes: Sequence[int] = ()) -> None:
        super().__init__()
        self.architecture, self.grid = architecture, grid
        frames, channels, rows, columns = grid.shape
        scale = 1
        self.front: nn.Module | None = None
        if architecture.front == "cnn":
            scale, channels, self.front = _STEM, _STEM_CHANNELS, _convolutions(channels)
            if any(edge % _STEM for edge in architecture.patch):
                raise UsageError(f"patches of an encoder with convolutions have edges that are multiples of {_STEM}")
        self._patch = architecture.patch[0] // scale, architecture.patch[1] // scale
        self._rows, self._columns = math.ceil(rows / architecture.patch[0]), math.ceil(columns / architecture.patch[1])
        dim, places = architecture.dim, self._rows * self._columns
        self.embedding = nn.Linear(channels * self._patch[0] * self._patch[1], dim)
        self.place = nn.Parameter(0.02 * torch.randn(places, dim))
        self.time = nn.Parameter(0.02 * torch.randn(frames, 1, dim))
        self.blocks = nn.ModuleList(Block(architecture) for _ in range(architecture.depth))
        self.norm = nn.LayerNorm(dim)
        self.classes: tuple[int, ...] = ()
        self.head: nn.Linear | None = None
        if classes:
            self.set_classes(classes)

    def set_classes(self, classes: Sequence[int]) -> None:
        """Give it a new, untrained class head."""
        self.classes = tuple(classes)
        self.head = nn.Linear(self.architecture.dim, len(self.classes), device=self.norm.weight.device)

    def forward(self, grids: Tensor) -> Tensor:
        """Features (n, dim) of grids (n, frames, channels, rows, columns), uint8 or floats from 0 to 255.

        Raises:
            UsageError: the grids have another shape than the encoder's.
        """
        if grids.shape[1:] != self.grid.shape:
            raise UsageError(f"the encoder reads grids of shape {self.grid.shape}, not {tuple(grids.shape[1:])}")
        tokens = self.embedding(self._tokens(grids)) + self.place + self.time
        for block in self.blocks:
            tokens = block(tokens)
        return self.norm(tokens.mean(dim=(1, 2), dtype=torch.float32))

    def logits(self, grids: Tensor) -> Tensor:
        """Logits (n, classes) of grids.

        Raises:
            UsageError: the encoder has not been fine-tuned to any classes.
        """
        if self.head is None:
            raise UsageError("this encoder has no class head: fine-tune it")
        return self.head(self(grids))

    def _tokens(self, grids: Tensor) -> Tensor:
        """Values of each token: (n, frames, places, values)."""
        kind = self.embedding.weight.dtype
        if torch.is_autocast_enabled(grids.device.type):
            kind = torch.get_autocast_dtype(grids.device.type)
        cells = self._padded(grids).to(kind) / 255.0
        if self.front is not None:
            cells = self.front(cells.flatten(0, 1)).unflatten(0, cells.shape[:2])
        return self._runs(cells) if self.architecture.tokens == "rows" else self._patches(cells)

    def _padded(self, grids: Tensor) -> Tensor:
        """Grids with empty rows and columns at the end, so that patches fit."""
        below = self._rows * self.architecture.patch[0] - grids.shape[3]
        behind = self._columns * self.architecture.patch[1] - grids.shape[4]
        return F.pad(grids, (0, behind, 0, below)) if below or behind else grids

    def _patches(self, cells: Tensor) -> Tensor:
        n, frames, channels = cells.shape[:3]
        height, width = self._patch
        split = cells.reshape(n, frames, channels, self._rows, height, self._columns, width)
        return split.permute(0, 1, 3, 5, 2, 4, 6).reshape(n, frames, self._rows * self._columns, -1)

    def _runs(self, cells: Tensor) -> Tensor:
        n, frames, channels = cells.shape[:3]
        split = cells.reshape(n, frames, channels, self._rows * self._columns, -1)
        return split.transpose(2, 3).reshape(n, frames, self._rows * self._columns, -1)


def _convolutions(channels: int) -> nn.Module:
    return nn.Sequential(
        nn.Conv2d(channels, _STEM_CHANNELS // 2, 3, stride=2, padding=1),
        nn.GELU(),
        nn.Conv2d(_STEM_CHANNELS // 2, _STEM_CHANNELS, 3, stride=2, padding=1),
        nn.GELU(),
    )
