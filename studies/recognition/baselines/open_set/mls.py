"""Maximum logit score."""

from __future__ import annotations

from torch import Tensor, nn
from torch.nn import functional

from studies.recognition.baselines.open_set.heads import Head, HeadMethod

TITLE = "max logit"


def logit_outlyingness(logits: Tensor) -> Tensor:
    """−max_k z_k of logits (n, K)."""
    return -logits.max(dim=1).values


class MLS(HeadMethod):
    """A plain classifier, rejected by its greatest logit.

    Loss: cross entropy. Score: −max_k z_k.

    Vaze et al., Open-Set Recognition: a Good Closed-Set Classifier is All You Need?, ICLR 2022.
    """

    def _network(self, inputs: int, classes: int) -> nn.Module:
        return Head(inputs, classes, self.training.hidden)

    def _loss(self, network: nn.Module, features: Tensor, indices: Tensor) -> Tensor:
        return functional.cross_entropy(network(features), indices)

    def _measure(self, features: Tensor) -> tuple[Tensor, Tensor]:
        logits: Tensor = self.network(features)
        return logits, logit_outlyingness(logits)


METHOD = MLS
