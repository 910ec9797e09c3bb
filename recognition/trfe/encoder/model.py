"""Transformers over tokens of participants: blocks, the encoder's base class, the encoder that
ships."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from recognition.trfe.encoder.config import Architecture, Sizes, TokenArchitecture
from recognition.trfe.encoder.inference import FURTHEST, WIDER
from recognition.trfe.inputs.grids import Grid
from recognition.trfe.inputs.tokens import Tokens
from recognition.trfe.training.windows import View
from schemas.common.errors import UsageError


class Attention(nn.Module):
    """Multi-head self-attention with its norm, over the last but one axis: (…, tokens, dim)."""

    def __init__(self, dim: int, heads: int) -> None:
        super().__init__()
        self.heads = heads
        self.norm = nn.LayerNorm(dim)
        self.mixed = nn.Linear(dim, 3 * dim)
        self.out = nn.Linear(dim, dim)

    def forward(
        self, tokens: Tensor, there: Tensor | None = None, count: int | None = None
    ) -> Tensor:
        """Return the attention output of all tokens, or of the first `count`, over the present ones
        (n, tokens)."""
        normed, dim = self.norm(tokens), tokens.shape[-1]
        # Queries are of the wanted tokens only, keys and values of all: the weights are split.
        weights, biases = (
            self.mixed.weight.split((dim, 2 * dim)),
            self.mixed.bias.split((dim, 2 * dim)),
        )
        query = F.linear(normed[..., :count, :], weights[0], biases[0])
        key, value = F.linear(normed, weights[1], biases[1]).chunk(2, dim=-1)
        query, key, value = (
            part.unflatten(-1, (self.heads, -1)).transpose(-3, -2) for part in (query, key, value)
        )
        mask = None if there is None else there[..., None, None, :]
        return self.out(
            F.scaled_dot_product_attention(query, key, value, mask).transpose(-3, -2).flatten(-2)
        )


class AttentionBlock(nn.Module):
    """One block: tokens (n, frames, places, dim) to the same."""

    def __init__(self, architecture: Sizes) -> None:
        super().__init__()
        dim, heads = architecture.dim, architecture.heads
        self.attention = Attention(dim, heads)
        self.layers = nn.Sequential(
            nn.LayerNorm(dim), nn.Linear(dim, WIDER * dim), nn.GELU(), nn.Linear(WIDER * dim, dim)
        )

    def forward(
        self, tokens: Tensor, there: Tensor | None = None, count: int | None = None
    ) -> Tensor:
        """Return tokens of the first `count` frames after attention to all present ones (n, frames,
        places)."""
        seen, wanted = None if there is None else there.flatten(1), tokens[:, :count]
        attended = self.attention(tokens.flatten(1, 2), seen, wanted.shape[1] * wanted.shape[2])
        tokens = wanted + attended.view_as(wanted)
        return tokens + self.layers(tokens)


class Encoder(nn.Module):
    """A transformer with a class head once it has been fine-tuned.

    Args:
        architecture: its sizes.
        view: of the windows that it reads.
    """

    architecture: Sizes
    view: View

    def __init__(self, architecture: Sizes, view: View) -> None:
        super().__init__()
        self.architecture, self.view = architecture, view
        self.norm = nn.LayerNorm(architecture.dim)
        self.classes: tuple[int, ...] = ()
        self.head: nn.Linear | None = None

    def set_classes(self, classes: Sequence[int]) -> None:
        """Set a new, untrained class head for labels, ascending; no labels leave the head."""
        self.classes = tuple(classes)
        if classes:
            self.head = nn.Linear(
                self.architecture.dim, len(self.classes), device=self.norm.weight.device
            )

    @abstractmethod
    def forward(self, windows: Tensor) -> Tensor:
        """Features (n, dim) of windows (n, ...).

        Raises:
            UsageError: the windows have another shape than the view's.
        """

    @abstractmethod
    def augmented(self, windows: Tensor) -> Tensor:
        """Windows with changes that leave their classes as they are."""

    def logits(self, windows: Tensor) -> Tensor:
        """Logits (n, classes) of windows.

        Raises:
            UsageError: the encoder has not been fine-tuned to any classes.
        """
        if self.head is None:
            raise UsageError("this encoder has no class head: fine-tune it")
        return self.head(self(windows))

    def require_shape(self, windows: Tensor) -> None:
        """Refuse windows of another shape than the view's."""
        if windows.shape[1:] != self.view.shape:
            raise UsageError(
                f"the encoder reads windows of shape {self.view.shape}, not "
                f"{tuple(windows.shape[1:])}"
            )


_SPREAD = 0.02
"""Standard deviation of untrained embeddings of places, times and kinds"""
_NOISE, _MISSED, _CUT = 0.03, 0.1, 0.15
"""Of augmentation: noise of all features, shares of missing others and of windows cut at either end
"""


class TokenEncoder(Encoder):
    """A transformer over tokens, each a participant for some frames; features are what the ego's
    have taken in.

    Args:
        architecture: its sizes.
        tokens: of the windows that it reads.
    """

    architecture: TokenArchitecture
    view: Tokens

    def __init__(self, architecture: TokenArchitecture, tokens: Tokens) -> None:
        super().__init__(architecture, tokens)
        _, frames, features = tokens.shape
        if frames % architecture.patch:
            raise UsageError(
                f"tokens of {architecture.patch} frames do not fit windows of {frames}"
            )
        dim = architecture.dim
        self.frame = nn.Sequential(nn.Linear(features + 1, architecture.frame), nn.GELU())
        self.embedding = nn.Linear(architecture.patch * architecture.frame, dim)
        self.time = nn.Parameter(torch.empty(frames // architecture.patch, dim))
        self.kind = nn.Parameter(torch.empty(2, 1, dim))
        self.blocks = nn.ModuleList(AttentionBlock(architecture) for _ in range(architecture.depth))
        # Tensors on `meta` have shapes only, see `_drawn`.
        if not self.time.is_meta:
            nn.init.normal_(self.time, std=_SPREAD)
            nn.init.normal_(self.kind, std=_SPREAD)

    def forward(self, values: Tensor) -> Tensor:
        """Features (n, dim) of windows (n, participants, frames, features), NaN for absent
        participants.

        Raises:
            UsageError: windows of another shape.
        """
        self.require_shape(values)
        embedded, there = self.embedded(values)
        *blocks, last = self.blocks
        for block in blocks:
            embedded = block(embedded, there)
        # The mean is over the times at which the ego is there. Others' tokens are not read any
        # more: the last block leaves them out.
        weight = there[:, :1].unsqueeze(-1).float()
        ego = (last(embedded, there, 1) * weight).sum(dim=(1, 2)) / weight.sum(dim=(1, 2)).clamp(
            min=1.0
        )
        return self.norm(ego.float())

    def embedded(self, values: Tensor) -> tuple[Tensor, Tensor]:
        """Tokens (n, participants, times, dim) before the blocks, and the mask of present
        participants."""
        # `tokenise` writes NaN into all features of an absent participant: one of them tells.
        there = ~values[..., 0].isnan()
        seen = torch.cat(
            [torch.nan_to_num(values.float()).clamp(-FURTHEST, FURTHEST), there.unsqueeze(-1)],
            dim=-1,
        )
        # Without the mask the layer's bias would give absent frames a value.
        frames = self.frame(seen) * there.unsqueeze(-1)
        patch = self.architecture.patch
        tokens = self.embedding(frames.unflatten(2, (-1, patch)).flatten(3)) + self.time
        # Two kinds of tokens: the ego's, which come first, and others'.
        kinds = self.kind[[0] + [1] * (values.shape[1] - 1)]
        return tokens + kinds, there.unflatten(2, (-1, patch)).any(dim=-1)

    def augmented(self, values: Tensor) -> Tensor:
        """Windows from which others and the ends of tracks are missing, and with noise."""
        return self._cut(self._without_some(values.float())) + _NOISE * torch.randn_like(
            values, dtype=torch.float32
        )

    def _without_some(self, values: Tensor) -> Tensor:
        """Remove a share of the others."""
        missed = torch.rand(values.shape[:2], device=values.device) < _MISSED
        # Never the ego, which the window is about.
        missed[:, 0] = False
        return values.masked_fill(missed[..., None, None], torch.nan)

    def _cut(self, values: Tensor) -> Tensor:
        """Remove the participants before or after some time in a share of the windows, as at the
        ends of a recording."""
        count, frames = values.shape[0], values.shape[2]
        # Less than half at either end, so that the middle of the window stays.
        most = frames // 2 - 1
        lost = torch.rand((2, count, 1), device=values.device)
        # One draw for both: below `_CUT` it is uniform, so that it gives the length as well.
        cut = (lost < _CUT) * (lost / _CUT * most).ceil()
        time = torch.arange(frames, device=values.device)
        away = (time < cut[0]) | (time >= frames - cut[1])
        return values.masked_fill(away[:, None, :, None], torch.nan)


_SHIFT = (1, 2)
"""Greatest shift, in rows and columns."""
_DROPPED = 0.1
"""Share of the cells that are emptied, in all frames and channels. `_NOISE` is the greatest
relative change of others' values."""


def augmented(grids: Tensor) -> Tensor:
    """Grids (n, frames, channels, rows, columns), uint8, as bfloat16 from 0 to 263: shifted by a
    few cells, with dropped cells and noise.

    All windows of the batch are shifted alike. A cell is dropped or changed in all frames and
    channels alike, and empty cells stay empty.
    """
    n, _, _, rows, columns = grids.shape
    drawn = torch.rand((n, 1, 1, rows, columns), device=grids.device)
    # One draw for both: beyond `_DROPPED` it is uniform, and gives a change of up to ±_NOISE.
    noise = 1.0 - _NOISE + 2.0 * _NOISE * (drawn - _DROPPED) / (1.0 - _DROPPED)
    return _shifted(grids) * torch.where(drawn < _DROPPED, 0.0, noise).to(torch.bfloat16)


def _shifted(grids: Tensor) -> Tensor:
    down, right = (int(torch.randint(-most, most + 1, ())) for most in _SHIFT)
    # Negative padding crops, so that the size stays.
    return F.pad(grids, (right, -right, down, -down))


_STEM = 4
"""Cells along each axis that the convolutions of the front-end make into one place."""
_STEM_CHANNELS = (16, 32)


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
        self._times, self._rows, self._columns = (
            frames // depth,
            math.ceil(rows / height),
            math.ceil(columns / width),
        )
        self.front: nn.Module | None = None
        if architecture.front == "cnn":
            if height % _STEM or width % _STEM:
                raise UsageError(
                    "patches of an encoder with convolutions have edges that are "
                    f"multiples of {_STEM}"
                )
            self.front = _convolutions(depth * channels)
            # The convolutions take the frames of a patch as channels, and give one frame.
            height, width, depth, channels = height // _STEM, width // _STEM, 1, _STEM_CHANNELS[-1]
        dim, places = architecture.dim, self._rows * self._columns
        self.embedding = nn.Linear(depth * channels * height * width, dim)
        self.place = nn.Parameter(_drawn(places, dim))
        self.time = nn.Parameter(_drawn(self._times, 1, dim))
        self.blocks = nn.ModuleList(AttentionBlock(architecture) for _ in range(architecture.depth))

    def forward(self, grids: Tensor) -> Tensor:
        """Features (n, dim) of grids (n, frames, channels, rows, columns), uint8 or floats from 0
        to 255.

        Raises:
            UsageError: the grids have another shape than the encoder's.
        """
        self.require_shape(grids)
        tokens = self.embedding(self._tokens(grids)) + self.place + self.time
        for block in self.blocks:
            tokens = block(tokens)
        return self.norm(tokens.mean(dim=(1, 2), dtype=torch.float32))

    def augmented(self, grids: Tensor) -> Tensor:
        """See `recognition.trfe.encoder.model`."""
        return augmented(grids)

    def _tokens(self, grids: Tensor) -> Tensor:
        """Values of each token: (n, times, places, values)."""
        # In the precision of autocast from the start, which would convert the cells later anyway.
        kind = self.embedding.weight.dtype
        if torch.is_autocast_enabled(grids.device.type):
            kind = torch.get_autocast_dtype(grids.device.type)
        cells = self._padded(grids).to(kind, copy=True).div_(255.0)
        cells = cells.unflatten(
            1, (self._times, -1)
        )  # (n, times, frames of a patch, channels, rows, columns)
        if self.front is not None:
            cells = (
                self.front(cells.flatten(2, 3).flatten(0, 1))
                .unflatten(0, cells.shape[:2])
                .unsqueeze(2)
            )
        return self.architecture.cut(cells, self._rows, self._columns).reshape(
            len(grids), self._times, self._rows * self._columns, -1
        )

    def _padded(self, grids: Tensor) -> Tensor:
        """Grids with empty rows and columns at the end, so that patches fit."""
        _, height, width = self.architecture.patch
        below, behind = self._rows * height - grids.shape[3], self._columns * width - grids.shape[4]
        return F.pad(grids, (0, behind, 0, below)) if below or behind else grids


def _drawn(*shape: int) -> Tensor:
    """Untrained embeddings; no numbers on the device `meta`, for which torch would import its
    compiler first."""
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


def untrained(architecture: Sizes, view: View, classes: Sequence[int] = ()) -> Encoder:
    """A new encoder of a view, with a head for these classes, if any.

    Raises:
        UsageError: the architecture is for another view.
    """
    if isinstance(view, Tokens) and isinstance(architecture, TokenArchitecture):
        made: Encoder = TokenEncoder(architecture, view)
    elif isinstance(view, Grid) and isinstance(architecture, Architecture):
        made = GridEncoder(architecture, view)
    else:
        raise UsageError(
            f"{type(architecture).__name__} is for no encoder of {type(view).__name__}"
        )
    made.set_classes(classes)
    return made
