"""Changes to grids that leave the class as it is. Left and right are never exchanged: that would change it."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

_SHIFT = (1, 2)
"""Greatest shift, in rows and columns."""
_DROPPED = 0.1
"""Share of the cells that are emptied, in all frames and channels."""
_NOISE = 8
"""Greatest change of a value that is not 0."""


def augmented(grids: Tensor) -> Tensor:
    """Grids (n, frames, channels, rows, columns), uint8, shifted by a few cells, with dropped cells and noise.

    All windows of the batch are shifted alike. Noise leaves empty cells empty.
    """
    n, _, _, rows, columns = grids.shape
    kept = torch.rand((n, 1, 1, rows, columns), device=grids.device) >= _DROPPED
    noise = torch.randint(-_NOISE, _NOISE + 1, (n, 1, 1, rows, columns), device=grids.device, dtype=torch.int16)
    shifted = _shifted(grids)
    noisy = (shifted.to(torch.int16) + noise).clamp_(1, 255).to(torch.uint8)
    return torch.where(kept & (shifted > 0), noisy, 0)


def _shifted(grids: Tensor) -> Tensor:
    down, right = (int(torch.randint(-most, most + 1, ())) for most in _SHIFT)
    return F.pad(grids, (right, -right, down, -down))
