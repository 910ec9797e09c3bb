"""Sizes of the encoder and schedules of its training, by name of the preset."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, NamedTuple

from schemas.errors import UsageError


@dataclass(frozen=True)
class Architecture:
    """A transformer over space-time patches (after TimeSformer: Bertasius, Wang, Torresani, ICML 2021).

    Attributes:
        dim, depth, heads: size of the tokens and of the features, number of blocks, attention heads.
        patch: frames, rows and columns of cells that make one token.
        attention: `joint` over all tokens of a window, or `divided`: first over time at each place, then over space.
        tokens: `patches` of neighbouring cells, or `rows`: each frame flattened row by row and cut into as many runs.
        front: what a token is made from: `cells` as they are, or `cnn`: the output of two small convolutions.
    """

    dim: int
    depth: int
    heads: int
    patch: tuple[int, int, int]
    attention: Literal["joint", "divided"] = "joint"
    tokens: Literal["patches", "rows"] = "patches"
    front: Literal["cells", "cnn"] = "cells"

    def __post_init__(self) -> None:
        if min(self.dim, self.depth, self.heads, *self.patch) < 1 or self.dim % self.heads:
            raise UsageError("sizes of an encoder are positive, and dim a multiple of heads")
        for name, value, known in (
            ("attention", self.attention, ("joint", "divided")),
            ("tokens", self.tokens, ("patches", "rows")),
            ("front", self.front, ("cells", "cnn")),
        ):
            if value not in known:
                raise UsageError(f"{name} of an encoder is one of {', '.join(known)}, not {value!r}")


class Schedule(NamedTuple):
    """How long and how fast to train: AdamW with a linear warm-up over the first tenth and a cosine decay to zero.

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

    architecture: Architecture
    pretraining: Schedule
    finetuning: Schedule


_CPU = Preset(
    Architecture(dim=128, depth=3, heads=4, patch=(4, 32, 20), front="cnn"), Schedule(1, 256, 1e-3), Schedule(8, 64, 1e-3)
)
PRESETS: dict[str, Preset] = {
    "cpu": _CPU,
    "full": Preset(Architecture(dim=512, depth=8, heads=4, patch=(1, 20, 20)), Schedule(20, 256, 3e-4), Schedule(30, 128, 3e-4)),
}
"""`cpu` trains at paper scale in minutes on two cores, `full` has the size of the publication and wants a GPU."""


def preset(name: str, presets: Mapping[str, Preset] = PRESETS) -> Preset:
    """The preset of that name.

    Raises:
        UsageError: there is none.
    """
    if name not in presets:
        raise UsageError(f"there is no preset {name!r}; presets: {', '.join(presets)}")
    return presets[name]
