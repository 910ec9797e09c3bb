"""Multi-modal dual-embedding network, reduced to one modality."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from studies.recognition.baselines.open_set.heads import Head, HeadMethod

TITLE = "MDENet, one modality"

TEMPERATURE = 0.1
"""τ of the supervised contrastive loss."""
RADIUS = 1.0
"""ρ of the bounded spheres."""
DIMENSION = 32
"""Size of both embeddings."""


def contrastive_loss(embedding: Tensor, indices: Tensor) -> Tensor:
    """Supervised contrastive loss of unit embeddings (b, m): −mean over positives p of
    log(e^{z·z_p/τ} / Σ_{a≠i} e^{z·z_a/τ}).

    Samples without another of their class in the batch are left out; 0 where all are.
    """
    itself = torch.eye(len(embedding), dtype=torch.bool)
    similarity = (embedding @ embedding.T / TEMPERATURE).masked_fill(itself, -torch.inf)
    positive = (indices[:, None] == indices[None, :]) & ~itself
    logarithm = (similarity - similarity.logsumexp(dim=1, keepdim=True)).masked_fill(~positive, 0.0)
    counts = positive.sum(dim=1)
    return -(logarithm.sum(dim=1) / counts.clamp(min=1)).sum() / (counts > 0).sum().clamp(min=1)


def sphere_loss(embedding: Tensor, centres: Tensor, indices: Tensor) -> Tensor:
    """Samples inside spheres of radius ρ around the centre of their class, spheres apart from each
    other.

    mean max(‖f − c_y‖ − ρ, 0) + mean over pairs j < k of max(2ρ − ‖c_j − c_k‖, 0); embeddings (b,
    m), centres (K, m).
    """
    inside = functional.relu((embedding - centres[indices]).norm(dim=1) - RADIUS).mean()
    if len(centres) < 2:
        return inside
    return inside + functional.relu(2.0 * RADIUS - functional.pdist(centres)).mean()


class DualEmbedding(nn.Module):
    """A shared layer, a discriminative embedding with a linear classifier, and an exclusive one
    with class centres."""

    def __init__(self, inputs: int, classes: int, hidden: int) -> None:
        super().__init__()
        self.shared = nn.Sequential(nn.Linear(inputs, hidden), nn.ReLU())
        self.discriminative = nn.Linear(hidden, DIMENSION)
        self.classifier = nn.Linear(DIMENSION, classes)
        self.exclusive = Head(hidden, DIMENSION, hidden)
        self.centres = nn.Parameter(torch.randn(classes, DIMENSION))


class MDENet(HeadMethod):
    """MDENet reduced to one modality: two embeddings of the features, one to classify, one to
    detect.

    Discriminative: cross entropy + supervised contrastive loss on the normalised embedding; the
    class is argmax of its logits. Exclusive: each class inside a sphere of radius ρ = 1 around a
    learnt centre, spheres apart. Score: min_k ‖f_e − c_k‖. The paper's malware images and
    sentences, and their fusion, have no counterpart here.

    Guo et al., Multimodal Dual-Embedding Networks for Malware Open-Set Recognition, TNNLS 2024.
    """

    network: DualEmbedding

    def _network(self, inputs: int, classes: int) -> nn.Module:
        return DualEmbedding(inputs, classes, self.training.hidden)

    def _loss(self, network: nn.Module, features: Tensor, indices: Tensor) -> Tensor:
        shared = self.network.shared(features)
        embedding = self.network.discriminative(shared)
        return (
            functional.cross_entropy(self.network.classifier(embedding), indices)
            + contrastive_loss(functional.normalize(embedding), indices)
            + sphere_loss(self.network.exclusive(shared), self.network.centres, indices)
        )

    def _measure(self, features: Tensor) -> tuple[Tensor, Tensor]:
        shared = self.network.shared(features)
        distances = torch.cdist(self.network.exclusive(shared), self.network.centres)
        return self.network.classifier(self.network.discriminative(shared)), distances.min(
            dim=1
        ).values


METHOD = MDENet
