"""Class anchor clustering."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from studies.recognition.baselines.open_set.heads import Head, HeadMethod

TITLE = "CAC"

ANCHOR = 10.0
"""Length α of the anchors α·e_k."""
PULL = 0.1
"""Weight λ of the anchor term."""


def cac_loss(distances: Tensor, indices: Tensor) -> Tensor:
    """Mean of log(1 + Σ_{j≠y} exp(d_y − d_j)) + λ·d_y over distances (b, K) and
    class indices (b,).
    """
    own = distances.gather(1, indices[:, None])
    tuplet = torch.logsumexp(own - distances, dim=1)  # the term j = y is the 1
    return (tuplet + PULL * own[:, 0]).mean()


def cac_rejection(distances: Tensor) -> Tensor:
    """γ_k = d_k·(1 − softmin(d)_k) of distances (n, K)."""
    return distances * (1.0 - torch.softmax(-distances, dim=1))


class CAC(HeadMethod):
    """Classes drawn to fixed anchors in logit space.

    Anchors c_k = 10·e_k; d_k = ‖z − c_k‖. Loss: log(1 + Σ_{j≠y} e^{d_y − d_j}) + 0.1·d_y.
    Rejection: γ_k = d_k·(1 − softmin(d)_k); class argmin_k γ_k, score min_k γ_k. As in the paper,
    distances are then taken to the mean logits of the rightly classified training samples; a class
    that has none keeps its anchor.

    Miller et al., Class Anchor Clustering: a Loss for Distance-Based Open Set Recognition,
    WACV 2021.
    """

    def _network(self, inputs: int, classes: int) -> nn.Module:
        self.centres = ANCHOR * torch.eye(classes)
        return Head(inputs, classes, self.training.hidden)

    def _loss(self, network: nn.Module, features: Tensor, indices: Tensor) -> Tensor:
        return cac_loss(torch.cdist(network(features), self.centres), indices)

    def _finish(self, features: Tensor, indices: Tensor) -> None:
        logits = self.network(features)
        right = torch.cdist(logits, self.centres).argmin(dim=1) == indices
        centres = self.centres.clone()
        for k in range(len(centres)):
            own = logits[right & (indices == k)]
            if len(own):
                centres[k] = own.mean(dim=0)
        self.centres = centres

    def _measure(self, features: Tensor) -> tuple[Tensor, Tensor]:
        rejection = cac_rejection(torch.cdist(self.network(features), self.centres))
        return -rejection, rejection.min(dim=1).values


METHOD = CAC
