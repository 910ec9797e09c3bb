"""Changes to grids that leave the class as it is. Left and right are never exchanged: that would change it."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

_SHIFT = (1, 2)
"""Greatest shift, in rows and columns."""
_DROPPED = 0.1
"""Share of the cells that are emptied, in all frames and channels."""
_NOISE = 0.03
"""Greatest relative change of the value of a cell."""


def augmented(grids: Tensor) -> Tensor:
    """Grids (n, frames, channels, rows, columns), uint8, as bfloat16 from 0 to 263: shifted by a few cells, with dropped cells
    and noise.

    All windows of the batch are shifted alike. A cell is dropped or changed in all frames and channels alike, and empty cells
    stay empty.
    """
    n, _, _, rows, columns = grids.shape
    drawn = torch.rand((n, 1, 1, rows, columns), device=grids.device)
    noise = 1.0 - _NOISE + 2.0 * _NOISE * (drawn - _DROPPED) / (1.0 - _DROPPED)
    return _shifted(grids) * torch.where(drawn < _DROPPED, 0.0, noise).to(torch.bfloat16)


def _shifted(grids: Tensor) -> Tensor:
    down, right = (int(torch.randint(-most, most + 1, ())) for most in _SHIFT)
    return F.pad(grids, (right, -right, down, -down))
