"""Sizes of the encoder and schedules of its training, by name of the preset."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, NamedTuple, Protocol

from schemas.common.errors import UsageError

if TYPE_CHECKING:
    from torch import Tensor


class Sizes(Protocol):
    """Sizes of a transformer: dim of the tokens and features, depth in blocks, attention heads."""

    @property
    def dim(self) -> int: ...
    @property
    def depth(self) -> int: ...
    @property
    def heads(self) -> int: ...


@dataclass(frozen=True)
class Architecture:
    """A transformer over space-time patches (after TimeSformer: Bertasius, Wang, Torresani, ICML
    2021).

    Attributes:
        dim, depth, heads: size of the tokens and of the features, number of blocks, attention
            heads.
        patch: frames, rows and columns of cells that make one token.
        front: what a token is made from: `cells` as they are, or `cnn`: the output of two small
            convolutions.
    """

    dim: int
    depth: int
    heads: int
    patch: tuple[int, int, int]
    front: Literal["cells", "cnn"] = "cells"

    def __post_init__(self) -> None:
        if min(self.dim, self.depth, self.heads, *self.patch) < 1 or self.dim % self.heads:
            raise UsageError("sizes of an encoder are positive, and dim a multiple of heads")
        if self.front not in ("cells", "cnn"):
            raise UsageError(f"front of an encoder is one of cells, cnn, not {self.front!r}")

    def cut(self, cells: Tensor, rows: int, columns: int) -> Tensor:
        """The cells of each token: patches of neighbouring ones.

        Args:
            cells: (n, times, frames, channels, height, width).
            rows, columns: number of tokens along each axis; their product is that of tokens a time.

        Returns:
            Of shape (n, times, rows, columns, ...), or with rows and columns as one axis; what
            follows are the values of a token.
        """
        return (
            cells.unflatten(5, (columns, -1))
            .unflatten(4, (rows, -1))
            .permute(0, 1, 4, 6, 2, 3, 5, 7)
        )


@dataclass(frozen=True)
class TokenArchitecture:
    """A transformer over participants and times.

    Attributes:
        dim, depth, heads: size of the tokens and of the features, number of blocks, attention
            heads.
        patch: frames of one participant that make one token. frame: size of what is made of a
            single frame first.
    """

    dim: int = 128
    depth: int = 3
    heads: int = 4
    patch: int = 4
    frame: int = 48

    def __post_init__(self) -> None:
        if (
            min(self.dim, self.depth, self.heads, self.patch, self.frame) < 1
            or self.dim % self.heads
        ):
            raise UsageError("sizes of an encoder are positive, and dim a multiple of heads")


class TrainingSchedule(NamedTuple):
    """Training schedule: AdamW with a linear warm-up over the first tenth and a cosine decay to
    zero.

    Attributes:
        epochs, batch: passes over the windows, and windows in a step.
        rate, decay: greatest learning rate, and weight decay.
    """

    epochs: int
    batch: int
    rate: float
    decay: float = 0.05


class Preset(NamedTuple):
    """An architecture and the schedules of its two trainings."""

    architecture: Architecture | TokenArchitecture
    pretraining: TrainingSchedule
    finetuning: TrainingSchedule


_CPU = Preset(
    Architecture(dim=128, depth=3, heads=4, patch=(4, 32, 20), front="cnn"),
    TrainingSchedule(1, 256, 1e-3),
    TrainingSchedule(8, 64, 1e-3),
)
PRESETS: dict[str, Preset] = {
    "tokens": Preset(
        TokenArchitecture(dim=96, depth=2),
        TrainingSchedule(2, 128, 1e-3),
        TrainingSchedule(6, 96, 1.5e-3),
    ),
    "cpu": _CPU,
    "full": Preset(
        Architecture(dim=512, depth=8, heads=4, patch=(1, 20, 20)),
        TrainingSchedule(20, 256, 3e-4),
        TrainingSchedule(30, 128, 3e-4),
    ),
}
"""`tokens` is what ships. The others read occupancy grids: `cpu` trains at paper scale in minutes
on two cores, `full` has the size of the publication and wants a GPU."""


def preset(name: str, presets: Mapping[str, Preset] = PRESETS) -> Preset:
    """The preset of that name.

    Raises:
        UsageError: no preset has that name.
    """
    if name not in presets:
        raise UsageError(f"there is no preset {name!r}; presets: {', '.join(presets)}")
    return presets[name]
