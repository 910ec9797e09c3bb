"""Self-supervised pretraining of encoders of tokens: motion that is hidden, and where in time a window was cut."""

from __future__ import annotations

from collections.abc import Callable

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from recognition.encoder.tokens import TokenEncoder

_HIDDEN = 0.4
"""Share of the ego's and the others' frames that are hidden."""
_SHIFTS = (-2, -1, 0, 1, 2)
"""By how many frames windows are shifted."""


class MaskedMotion(nn.Module):
    """What hidden stretches of participants hold: mean absolute error of the ego's features, from what is left of the window.

    Source: masked autoencoding as in He et al., "Masked Autoencoders Are Scalable Vision Learners" (CVPR 2022), for trajectories
    Chen et al., "Traj-MAE" (ICCV 2023).
    """

    def __init__(self, encoder: TokenEncoder) -> None:
        super().__init__()
        _, self.frames, self.features = encoder.view.shape
        self.head = nn.Linear(encoder.architecture.dim, self.frames * self.features)

    def forward(self, encoder: TokenEncoder, values: Tensor) -> Tensor:
        """Loss of a batch."""
        seen = encoder.augmented(values)
        patch = encoder.architecture.patch
        hidden = torch.rand(values.shape[0], self.frames // patch, device=values.device) < _HIDDEN
        hidden = hidden.repeat_interleave(patch, dim=1)
        truth = values[:, 0].float()
        found = self.head(encoder(seen.masked_fill(hidden[:, None, :, None], torch.nan))).view_as(truth)
        asked = hidden[..., None] & ~truth.isnan()
        return F.l1_loss(found[asked], truth[asked].clamp(-5.0, 5.0)) if asked.any() else found.sum() * 0.0


class TimeShift(nn.Module):
    """By how many frames a window was shifted in time: cross-entropy."""

    def __init__(self, encoder: TokenEncoder) -> None:
        super().__init__()
        self.head = nn.Linear(encoder.architecture.dim, len(_SHIFTS))

    def forward(self, encoder: TokenEncoder, values: Tensor) -> Tensor:
        """Loss of a batch."""
        truth = torch.randint(len(_SHIFTS), (len(values),), device=values.device)
        frame = torch.arange(values.shape[2], device=values.device)
        moved = (frame + torch.tensor(_SHIFTS, device=values.device)[truth][:, None]).clamp(0, values.shape[2] - 1)
        shifted = values.gather(2, moved[:, None, :, None].expand_as(values))
        return F.cross_entropy(self.head(encoder(encoder.augmented(shifted))), truth)


OBJECTIVES: dict[str, Callable[[TokenEncoder], nn.Module]] = {"masked": MaskedMotion, "shift": TimeShift}
