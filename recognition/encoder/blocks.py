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

    def forward(self, tokens: Tensor, there: Tensor | None = None, count: int | None = None) -> Tensor:
        """What each token, or each of the first `count`, takes in from the others, or from those (n, tokens) that are there."""
        normed, dim = self.norm(tokens), tokens.shape[-1]
        weights, biases = self.mixed.weight.split((dim, 2 * dim)), self.mixed.bias.split((dim, 2 * dim))
        query = F.linear(normed[..., :count, :], weights[0], biases[0])
        key, value = F.linear(normed, weights[1], biases[1]).chunk(2, dim=-1)
        query, key, value = (part.unflatten(-1, (self.heads, -1)).transpose(-3, -2) for part in (query, key, value))
        mask = None if there is None else there[..., None, None, :]
        return self.out(F.scaled_dot_product_attention(query, key, value, mask).transpose(-3, -2).flatten(-2))


class Block(nn.Module):
    """One block: tokens (n, frames, places, dim) to the same."""

    def __init__(self, architecture: Sizes) -> None:
        super().__init__()
        dim, heads = architecture.dim, architecture.heads
        self.attention = Attention(dim, heads)
        self.layers = nn.Sequential(nn.LayerNorm(dim), nn.Linear(dim, _WIDER * dim), nn.GELU(), nn.Linear(_WIDER * dim, dim))

    def forward(self, tokens: Tensor, there: Tensor | None = None, count: int | None = None) -> Tensor:
        """Tokens that have taken in the others, or those (n, frames, places) that are there; of the first `count` frames."""
        seen, wanted = None if there is None else there.flatten(1), tokens[:, :count]
        attended = self.attention(tokens.flatten(1, 2), seen, wanted.shape[1] * wanted.shape[2])
        tokens = wanted + attended.view_as(wanted)
        return tokens + self.layers(tokens)
