"""Energy score."""

from __future__ import annotations

from torch import Tensor

from studies.recognition.baselines.open_set.mls import MLS

TITLE = "energy"


def energy(logits: Tensor) -> Tensor:
    """−log Σ_k e^{z_k} of logits (n, K)."""
    return -logits.logsumexp(dim=1)


class Energy(MLS):
    """The plain classifier of `MLS`, rejected by its energy −log Σ_k e^{z_k}.

    Liu et al., Energy-based Out-of-distribution Detection, NeurIPS 2020.
    """

    def _measure(self, features: Tensor) -> tuple[Tensor, Tensor]:
        logits: Tensor = self.network(features)
        return logits, energy(logits)


METHOD = Energy
