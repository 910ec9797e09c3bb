"""Presets of the encoder that experiments compare: those of the product, and
ablations of the smaller one.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING

from recognition.trfe.encoder.config import PRESETS as PRODUCT
from recognition.trfe.encoder.config import Architecture, Preset

if TYPE_CHECKING:
    from torch import Tensor


@dataclass(frozen=True)
class RowTokens(Architecture):
    """As published: each frame is flattened row by row and cut into as many runs
    as it would have patches.
    """

    def cut(self, cells: Tensor, rows: int, columns: int) -> Tensor:
        """The cells of each token: runs of the flattened frame, of shape (n,
        times, rows · columns, ...).
        """
        return cells.flatten(4).unflatten(4, (rows * columns, -1)).permute(0, 1, 4, 2, 3, 5)


TOKENS = "tokens"
"""Name of the preset of what ships; all others read grids"""
_CPU = PRODUCT["cpu"]
assert isinstance(_CPU.architecture, Architecture)
_CELLS = replace(_CPU.architecture, front="cells")
_FULL = PRODUCT["full"]
assert isinstance(_FULL.architecture, Architecture)
PRESETS: dict[str, Preset] = {
    **PRODUCT,
    "full-rows": _FULL._replace(architecture=RowTokens(**asdict(_FULL.architecture))),
    "cpu-cells": _CPU._replace(architecture=_CELLS),
    "cpu-rows": _CPU._replace(architecture=RowTokens(**asdict(_CELLS))),
}
"""`cpu-cells` has no convolutions; `cpu-rows` has tokens of the grids flattened row by row besides,
as published, and `full-rows` has them in the size of the publication."""
