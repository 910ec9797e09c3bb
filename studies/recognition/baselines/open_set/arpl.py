"""Adversarial reciprocal point learning."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from studies.recognition.baselines.open_set.heads import Head, HeadMethod
from studies.recognition.baselines.open_set.mls import logit_outlyingness

TITLE = "ARPL"

WEIGHT = 0.1
"""Weight λ of the margin term."""
DIMENSION = 64
"""Size m of the embedding."""


def reciprocal_distances(embedding: Tensor, points: Tensor) -> tuple[Tensor, Tensor]:
    """d = d_e − d_d and d_e (both (n, K)): d_e = ‖f − P_k‖²/m, d_d = f·P_k, of embeddings (n, m)
    and points (K, m)."""
    euclidean = torch.cdist(embedding, points).square() / embedding.shape[1]
    return euclidean - embedding @ points.T, euclidean


def arpl_loss(embedding: Tensor, points: Tensor, radius: Tensor, indices: Tensor) -> Tensor:
    """Cross entropy of the logits d plus λ times the mean of max(d_e(f, P_y) − R, 0)."""
    logits, euclidean = reciprocal_distances(embedding, points)
    margin = functional.relu(euclidean.gather(1, indices[:, None])[:, 0] - radius)
    return functional.cross_entropy(logits, indices) + WEIGHT * margin.mean()


class ReciprocalPoints(nn.Module):
    """Embedding, one reciprocal point for each class, and the margin R, all learnt."""

    def __init__(self, inputs: int, classes: int, hidden: int) -> None:
        super().__init__()
        self.embed = Head(inputs, DIMENSION, hidden)
        self.points = nn.Parameter(0.1 * torch.randn(classes, DIMENSION))
        self.radius = nn.Parameter(torch.zeros(()))


class ARPL(HeadMethod):
    """A class lies far from its reciprocal point, which stands for everything else; a margin bounds
    the space left to that.

    d_e = ‖f − P_k‖²/m, d_d = f·P_k, logits z_k = d_e − d_d. Loss: cross entropy + 0.1·max(d_e(f,
    P_y) − R, 0), R learnt. Score: −max_k z_k. Without the paper's confusing samples from a
    generator, as features have none.

    Chen et al., Adversarial Reciprocal Points Learning for Open Set Recognition, TPAMI 2022.
    """

    network: ReciprocalPoints

    def _network(self, inputs: int, classes: int) -> nn.Module:
        return ReciprocalPoints(inputs, classes, self.training.hidden)

    def _loss(self, network: nn.Module, features: Tensor, indices: Tensor) -> Tensor:
        return arpl_loss(
            self.network.embed(features), self.network.points, self.network.radius, indices
        )

    def _measure(self, features: Tensor) -> tuple[Tensor, Tensor]:
        logits, _ = reciprocal_distances(self.network.embed(features), self.network.points)
        return logits, logit_outlyingness(logits)


METHOD = ARPL
