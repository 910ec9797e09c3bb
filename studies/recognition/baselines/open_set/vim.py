"""Virtual-logit matching."""

from __future__ import annotations

import torch
from torch import Tensor

from studies.recognition.baselines.open_set.energy import energy
from studies.recognition.baselines.open_set.heads import Head
from studies.recognition.baselines.open_set.mls import MLS

TITLE = "ViM"

_KEPT = 0.9
"""Share of the variance in the principal subspace; the source fixes the dimension of each of its
networks instead."""


def residual_axes(inputs: Tensor) -> Tensor:
    """Axes (d, r) of what the principal subspace of samples (n, d) leaves, at least one; the
    samples are about the origin."""
    values, axes = torch.linalg.eigh(inputs.T @ inputs / len(inputs))
    share = values.cumsum(0) / values.sum()
    return axes[:, : max(int((share <= 1.0 - _KEPT).sum()), 1)]


class ViM(MLS):
    """The plain classifier of `MLS`, rejected by α ‖x^⊥‖ − log Σ_k e^{z_k}.

    x is the input of the last layer, less −W⁺b at which all logits are 0, x^⊥ its part outside the
    principal subspace of the training samples, and α the mean greatest logit over the mean ‖x^⊥‖ of
    these.

    Wang, Li, Feng, Zhang, ViM: Out-Of-Distribution with Virtual-logit Matching, CVPR 2022.
    """

    network: Head

    def _finish(self, features: Tensor, indices: Tensor) -> None:
        last = self.network.layers[-1]
        self._origin = -torch.linalg.pinv(last.weight) @ last.bias
        inputs = self.network.before_last(features) - self._origin
        self._axes = residual_axes(inputs)
        greatest = self.network(features).max(dim=1).values
        self._weight = greatest.mean() / (inputs @ self._axes).norm(dim=1).mean().clamp(min=1e-6)

    def _measure(self, features: Tensor) -> tuple[Tensor, Tensor]:
        logits: Tensor = self.network(features)
        residual = ((self.network.before_last(features) - self._origin) @ self._axes).norm(dim=1)
        return logits, self._weight * residual + energy(logits)


METHOD = ViM
