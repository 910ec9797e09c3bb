"""The policy of MCSG: two LSTM layers that look at the parameters as edited so far, and say how the next one is edited."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor, nn

HIDDEN, LAYERS, DROPOUT = 32, 2, 0.2
State = tuple[Tensor, Tensor]


class Bins(NamedTuple):
    """Bins of edits, as many for each parameter.

    Attributes:
        low, high: outer edges (d,). number: of bins.
    """

    low: Tensor
    high: Tensor
    number: int

    @property
    def width(self) -> Tensor:
        """Of the bins (d,)."""
        return (self.high - self.low) / self.number

    def centres(self, step: int) -> Tensor:
        """Of the bins (number,) of a parameter."""
        return self.low[step] + (torch.arange(self.number) + 0.5) * self.width[step]

    def holding(self, step: int, edits: Tensor) -> Tensor:
        """The bin that holds each edit (n,) of a parameter, or is nearest to it."""
        return ((edits - self.low[step]) / self.width[step]).floor().long().clamp(0, self.number - 1)


class Policy(nn.Module):
    """LSTM over the parameters, with a layer of its own for each parameter that weighs its bins.

    Untrained, it takes edits as a normal distribution around none would.

    Args:
        bins: of edits. spread: standard deviation (d,) of the untrained policy's edits.
    """

    def __init__(self, bins: Bins, spread: Tensor) -> None:
        super().__init__()
        d = len(spread)
        self.lstm = nn.LSTM(2 * d, HIDDEN, LAYERS, dropout=DROPOUT)
        self.bins = bins
        self.weight = nn.Parameter(torch.zeros(d, bins.number, HIDDEN))
        self.bias = nn.Parameter(torch.stack([-0.5 * (bins.centres(step) / spread[step]) ** 2 for step in range(d)]))

    def forward(self, step: int, observation: Tensor, state: State | None) -> tuple[Tensor, State]:
        """Logits (n, bins) of a parameter's edit, and what is remembered, given the observation (n, 2d)."""
        features, state = self.lstm(observation[None], state)
        return features[0] @ self.weight[step].T + self.bias[step], state

    def rebin(self, bins: Bins) -> None:
        """Change to other bins; each is weighed as the old bin was that its centre lies in."""
        old, self.bins = self.bins, bins
        chosen = torch.stack([old.holding(step, bins.centres(step)) for step in range(len(self.bias))])
        with torch.no_grad():
            weight = self.weight.gather(1, chosen[..., None].expand(-1, -1, HIDDEN))
            bias = self.bias.gather(1, chosen)
        self.weight, self.bias = nn.Parameter(weight.clone()), nn.Parameter(bias.clone())
