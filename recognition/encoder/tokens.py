"""An encoder of tokens: what participants do over time, in lane coordinates, to one feature vector, and from there to classes."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from recognition.encoder.blocks import Block
from recognition.encoder.config import TokenArchitecture
from recognition.encoder.model import Encoder
from recognition.tokens.config import Tokens
from schemas.errors import UsageError

_FURTHEST = 5.0
"""Features are cut to this amount: what is farther away or faster is that, and no more."""
_SPREAD = 0.02
_NOISE, _MISSED, _CUT = 0.03, 0.1, 0.15
"""Of augmentation: noise of all features, shares of missing others and of windows cut at either end"""


class TokenEncoder(Encoder):
    """A transformer over tokens, each a participant for some frames; features are what the ego's have taken in.

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
            raise UsageError(f"tokens of {architecture.patch} frames do not fit windows of {frames}")
        dim = architecture.dim
        self.frame = nn.Sequential(nn.Linear(features + 1, architecture.frame), nn.GELU())
        self.embedding = nn.Linear(architecture.patch * architecture.frame, dim)
        self.time = nn.Parameter(torch.empty(frames // architecture.patch, dim))
        self.kind = nn.Parameter(torch.empty(2, 1, dim))
        self.blocks = nn.ModuleList(Block(architecture) for _ in range(architecture.depth))
        if not self.time.is_meta:
            nn.init.normal_(self.time, std=_SPREAD)
            nn.init.normal_(self.kind, std=_SPREAD)

    def forward(self, values: Tensor) -> Tensor:
        """Features (n, dim) of windows (n, participants, frames, features), NaN where nobody is.

        Raises:
            UsageError: windows of another shape.
        """
        self.require_shape(values)
        embedded, there = self.embedded(values)
        *blocks, last = self.blocks
        for block in blocks:
            embedded = block(embedded, there)
        weight = there[:, :1].unsqueeze(-1).float()
        ego = (last(embedded, there, 1) * weight).sum(dim=(1, 2)) / weight.sum(dim=(1, 2)).clamp(min=1.0)
        return self.norm(ego.float())

    def embedded(self, values: Tensor) -> tuple[Tensor, Tensor]:
        """Tokens (n, participants, times, dim) before the blocks, and whether anybody is there in each."""
        there = ~values[..., 0].isnan()
        seen = torch.cat([torch.nan_to_num(values.float()).clamp(-_FURTHEST, _FURTHEST), there.unsqueeze(-1)], dim=-1)
        frames = self.frame(seen) * there.unsqueeze(-1)
        patch = self.architecture.patch
        tokens = self.embedding(frames.unflatten(2, (-1, patch)).flatten(3)) + self.time
        kinds = self.kind[[0] + [1] * (values.shape[1] - 1)]
        return tokens + kinds, there.unflatten(2, (-1, patch)).any(dim=-1)

    def augmented(self, values: Tensor) -> Tensor:
        """Windows from which others and the ends of tracks are missing, and with noise."""
        return self._cut(self._without_some(values.float())) + _NOISE * torch.randn_like(values, dtype=torch.float32)

    def _without_some(self, values: Tensor) -> Tensor:
        """A share of the others is not there."""
        missed = torch.rand(values.shape[:2], device=values.device) < _MISSED
        missed[:, 0] = False
        return values.masked_fill(missed[..., None, None], torch.nan)

    def _cut(self, values: Tensor) -> Tensor:
        """In a share of the windows, nobody is there before or after some time, as where a recording begins or ends."""
        count, frames = values.shape[0], values.shape[2]
        most = frames // 2 - 1
        lost = torch.rand((2, count, 1), device=values.device)
        cut = (lost < _CUT) * (lost / _CUT * most).ceil()
        time = torch.arange(frames, device=values.device)
        away = (time < cut[0]) | (time >= frames - cut[1])
        return values.masked_fill(away[:, None, :, None], torch.nan)
