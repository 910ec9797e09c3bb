"""Blocks of the transformer: joint attention over space and time, then two layers for each token."""

from __future__ import annotations

import torch.nn.functional as F
from torch import Tensor, nn

from recognition.encoder.config import Sizes

_WIDER = 4
"""The hidden layer of a block is this many times as wide as its tokens."""


class Attention(nn.Module):
    """Multi-head self-attention with its norm, over the last but one axis: (…, tokens, dim)."""

    def __init__(self, dim: int, heads: int) -> None:
        super().__init__()
        self.heads = heads
        self.norm = nn.LayerNorm(dim)
        self.mixed = nn.Linear(dim, 3 * dim)
        self.out = nn.Linear(dim, dim)

    def forward(self, tokens: Tensor, there: Tensor | None = None) -> Tensor:
        """What each token takes in from the others, or from those (n, tokens) that are there."""
        parts = self.mixed(self.norm(tokens)).unflatten(-1, (3, self.heads, -1))
        query, key, value = (part.transpose(-3, -2) for part in parts.unbind(-3))
        mask = None if there is None else there[..., None, None, :]
        return self.out(F.scaled_dot_product_attention(query, key, value, mask).transpose(-3, -2).flatten(-2))


class Block(nn.Module):
    """One block: tokens (n, frames, places, dim) to the same."""

    def __init__(self, architecture: Sizes) -> None:
        super().__init__()
        dim, heads = architecture.dim, architecture.heads
        self.attention = Attention(dim, heads)
        self.layers = nn.Sequential(nn.LayerNorm(dim), nn.Linear(dim, _WIDER * dim), nn.GELU(), nn.Linear(_WIDER * dim, dim))

    def forward(self, tokens: Tensor, there: Tensor | None = None) -> Tensor:
        """Tokens that have taken in the others, or those (n, frames, places) that are there."""
        seen = None if there is None else there.flatten(1)
        tokens = tokens + self.attention(tokens.flatten(1, 2), seen).view_as(tokens)
        return tokens + self.layers(tokens)
