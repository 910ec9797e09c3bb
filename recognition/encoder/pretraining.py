"""Self-supervised pretraining: the order of the frames, and agreement of two views (Barlow Twins)."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from itertools import permutations
from typing import Any

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from recognition.encoder import masking
from recognition.encoder.augmentation import augmented
from recognition.encoder.config import Preset
from recognition.encoder.grids import GridEncoder
from recognition.encoder.kinds import untrained
from recognition.encoder.model import Encoder
from recognition.encoder.tokens import TokenEncoder
from recognition.encoder.training import Progress, deterministic, device, train
from recognition.training.views import View
from recognition.training.windows import Windows
from schemas.errors import UsageError

_PROJECTED = 256
_OFF_DIAGONAL = 5e-3
"""Weight of the redundancy term, as in Barlow Twins."""


class FrameOrder(nn.Module):
    """Which permutation of the frames a window was shown in: cross-entropy over all of them (Misra et al., ECCV 2016)."""

    def __init__(self, encoder: GridEncoder) -> None:
        super().__init__()
        self.orders = torch.tensor(list(permutations(range(encoder.view.frames))))
        self.head = nn.Linear(encoder.architecture.dim, len(self.orders))

    def forward(self, encoder: GridEncoder, grids: Tensor) -> Tensor:
        """Loss of a batch."""
        truth = torch.randint(len(self.orders), (len(grids),))
        order = self.orders[truth].to(grids.device)
        shuffled = augmented(grids)[torch.arange(len(grids), device=grids.device)[:, None], order]
        return F.cross_entropy(self.head(encoder(shuffled)), truth.to(grids.device))


class BarlowTwins(nn.Module):
    """Features of two views of a window agree, and are not redundant (Zbontar et al., ICML 2021).

    L = Σ_i (1 − C_ii)² + λ Σ_{i≠j} C_ij², divided by the number of features, with C the cross-correlation of both views.
    """

    def __init__(self, encoder: GridEncoder) -> None:
        super().__init__()
        dim = encoder.architecture.dim
        self.projector = nn.Sequential(
            nn.Linear(dim, _PROJECTED), nn.BatchNorm1d(_PROJECTED), nn.ReLU(), nn.Linear(_PROJECTED, _PROJECTED)
        )

    def forward(self, encoder: GridEncoder, grids: Tensor) -> Tensor:
        """Loss of a batch."""
        both = [self.projector(encoder(augmented(grids))).float() for _ in range(2)]
        one, other = ((view - view.mean(0)) / (view.std(0) + 1e-5) for view in both)
        correlation = one.T @ other / len(grids)
        same = torch.diagonal(correlation)
        redundant = (correlation**2).sum() - (same**2).sum()
        return (((1.0 - same) ** 2).sum() + _OFF_DIAGONAL * redundant) / len(same)


OBJECTIVES: dict[str, Callable[[GridEncoder], nn.Module]] = {"order": FrameOrder, "barlow": BarlowTwins}
"""Of encoders of grids; those of tokens have `recognition.encoder.masking.OBJECTIVES`."""


def pretrain(
    windows: Windows,
    preset: Preset,
    view: View,
    seed: int,
    objectives: Collection[str] | None = None,
    progress: Progress | None = None,
) -> Encoder:
    """A new encoder, trained on windows without looking at their labels.

    Args:
        view: of the windows.
        objectives: some of those for the view, whose losses are added; by default all. None of them leaves the encoder as it was
            initialised.

    Raises:
        UsageError: there are too few windows, their shape is not the view's, or an objective is unknown.
    """
    with deterministic(seed):
        encoder = untrained(preset.architecture, view)
        chosen = [objective(encoder) for objective in _chosen(encoder, objectives)]
        if chosen:
            model = nn.ModuleList([encoder, *chosen]).to(device())
            train(
                model,
                windows.inputs,
                preset.pretraining,
                lambda inputs, _: torch.stack([objective(encoder, inputs) for objective in chosen]).sum(),
                progress,
            )
    return encoder.eval()


def _chosen(encoder: Encoder, names: Collection[str] | None) -> list[Callable[[Any], nn.Module]]:
    """The objectives of these names for an encoder; all for none."""
    known: Mapping[str, Callable[[Any], nn.Module]] = masking.OBJECTIVES if isinstance(encoder, TokenEncoder) else OBJECTIVES
    unknown = set(names or ()) - set(known)
    if unknown:
        raise UsageError(f"there is no objective {sorted(unknown)[0]!r}; objectives: {', '.join(known)}")
    return [objective for name, objective in known.items() if names is None or name in names]
