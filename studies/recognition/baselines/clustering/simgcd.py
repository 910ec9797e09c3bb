"""A parametric classifier of known and new classes that teaches itself, on the axes in which TRFE
clusters, given the true K."""

from __future__ import annotations

import math

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from recognition.trfe.discovery.clustering import Projection, jitter
from recognition.trfe.training.windows import seeded
from schemas.common.array_types import IntArray
from studies.recognition.baselines.clustering.pool import ClusteringMethod, Pool

TITLE = "SimGCD heads on TRFE's axes, given K"

STUDENT, TEACHER = 0.1, (0.07, 0.04)
"""Temperatures τ_s and τ_t; the latter falls over the first epochs."""
ENTROPY, SUPERVISED = 2.0, 0.35
"""ε, and λ between losses with and without labels."""
_EPOCHS, _FALLING, _RATE, _BATCH = 60, 20, 0.1, 128


class CosineHeads(nn.Module):
    """Cosines (n, classes) of features (n, d), corrected as TRFE's heads may, with a prototype of
    each class."""

    def __init__(self, width: int, classes: int) -> None:
        super().__init__()
        self.backbone, self.prototypes = Projection(width), nn.Linear(width, classes, bias=False)

    def forward(self, features: Tensor) -> Tensor:
        """Cosines."""
        return functional.linear(
            functional.normalize(self.backbone(features), dim=1),
            functional.normalize(self.prototypes.weight, dim=1),
        )


def distillation_loss(student: Tensor, teacher: Tensor, temperature: float) -> Tensor:
    """Mean cross-entropy of p = softmax(student/τ_s) against softmax(teacher/τ_t), less ε times the
    entropy of the mean p.

    Args:
        student, teacher: cosines (n, classes) of two views of the same samples.
        temperature: τ_t.
    """
    truth = (teacher / temperature).softmax(dim=1).detach()
    logarithm = (student / STUDENT).log_softmax(dim=1)
    mean = logarithm.exp().mean(dim=0)
    return (
        -(truth * logarithm).sum(dim=1).mean()
        + ENTROPY * (mean * mean.clamp(min=1e-12).log()).sum()
    )


class SimGCD(ClusteringMethod):
    """L = (1 − λ) L_distillation over all samples, both ways between two views, + λ cross-entropy
    of the labelled ones at τ_s.

    Samples of the known classes and of the new ones have one classifier; the greatest cosine names
    the cluster.

    Wen, Zhao, Qi, Parametric Classification for Generalized Category Discovery: A Baseline Study,
    ICCV 2023; its contrastive losses train the encoder, which is frozen here.
    """

    given_count = True

    def cluster(self, pool: Pool) -> IntArray:
        """Cluster number of each sample (n,)."""
        unknown, known = (
            torch.from_numpy(np.ascontiguousarray(part, np.float32)) for part in pool.directions
        )
        classes, columns = np.unique(pool.labels, return_inverse=True)
        samples = torch.cat([known, unknown])
        truth = torch.cat([torch.from_numpy(columns), torch.full((len(unknown),), -1)])
        with seeded(self.seed):
            heads = CosineHeads(samples.shape[1], len(classes) + pool.classes)
            _train(heads, samples, truth)
            with torch.no_grad():
                return np.asarray(heads(unknown).argmax(dim=1).numpy(), np.int64)


def _train(heads: CosineHeads, samples: Tensor, truth: Tensor) -> None:
    """Train on samples (n, d) whose classes (n,) are −1 where they are unknown."""
    optimiser = torch.optim.SGD(heads.parameters(), _RATE, momentum=0.9, weight_decay=5e-5)
    rates = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, _EPOCHS)
    for epoch in range(_EPOCHS):
        first, last = TEACHER
        temperature = last + (first - last) * 0.5 * (
            1.0 + math.cos(math.pi * min(epoch / _FALLING, 1.0))
        )
        for batch in torch.randperm(len(samples)).split(_BATCH):
            one, other = (heads(jitter(samples[batch])) for _ in range(2))
            loss = 0.5 * (
                distillation_loss(one, other, temperature)
                + distillation_loss(other, one, temperature)
            )
            labelled = truth[batch] >= 0
            loss = (1.0 - SUPERVISED) * loss
            if labelled.any():
                loss = loss + SUPERVISED * functional.cross_entropy(
                    one[labelled] / STUDENT, truth[batch][labelled]
                )
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
        rates.step()


METHOD = SimGCD
