"""Convolutional prototype learning, in the place of FCPN."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from studies.recognition.baselines.open_set.heads import Head, HeadMethod

TITLE = "CPN for FCPN"

WEIGHT = 0.01
"""Weight λ of the prototype term."""
SHARPNESS = 1.0
"""γ of the distance-based softmax."""
DIMENSION = 32
"""Size of the embedding."""


def cpn_loss(distances: Tensor, indices: Tensor) -> Tensor:
    """Mean of −log softmax(−γ·d)_y + λ·d_y over squared distances to the prototypes (b, K) and
    class indices (b,)."""
    own = distances.gather(1, indices[:, None]).mean()
    return functional.cross_entropy(-SHARPNESS * distances, indices) + WEIGHT * own


class Prototypes(nn.Module):
    """Embedding and one learnt prototype for each class; gives squared distances (n, K)."""

    def __init__(self, inputs: int, classes: int, hidden: int) -> None:
        super().__init__()
        self.embed = Head(inputs, DIMENSION, hidden)
        self.points = nn.Parameter(torch.randn(classes, DIMENSION))

    def forward(self, features: Tensor) -> Tensor:
        """Squared distance of each sample to each prototype."""
        return torch.cdist(self.embed(features), self.points).square()


class CPN(HeadMethod):
    """CPN for FCPN: the paper's FCPN can't be identified; this is the prototype learning that its
    name points to.

    d_k = ‖f(h) − m_k‖², prototypes m_k learnt. Loss: −log softmax(−γ d)_y + λ·d_y, γ 1, λ 0.01.
    Score: min_k d_k.

    Yang et al., Robust Classification with Convolutional Prototype Learning, CVPR 2018.
    """

    def _network(self, inputs: int, classes: int) -> nn.Module:
        return Prototypes(inputs, classes, self.training.hidden)

    def _loss(self, network: nn.Module, features: Tensor, indices: Tensor) -> Tensor:
        return cpn_loss(network(features), indices)

    def _measure(self, features: Tensor) -> tuple[Tensor, Tensor]:
        distances: Tensor = self.network(features)
        return -distances, distances.min(dim=1).values


METHOD = CPN
