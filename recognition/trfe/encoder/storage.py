"""Encoders in a folder: weights as safetensors, everything else as JSON; and features of many
windows."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from recognition.trfe.encoder.config import Architecture, Sizes, TokenArchitecture
from recognition.trfe.encoder.inference import (
    CONFIG,
    FORMAT,
    TOKENS,
    WEIGHTS,
    Weights,
    read_weights,
    require_shapes,
)
from recognition.trfe.encoder.model import Encoder, untrained
from recognition.trfe.encoder.training import deterministic, device, mixed
from recognition.trfe.inputs.grids import Grid
from recognition.trfe.inputs.tokens import Tokens
from recognition.trfe.training.windows import Inputs, View, Windows
from schemas.common.errors import InvalidFile, ToolchainError, reason
from schemas.common.storage import keep, read_object, writing

_GRIDS = "grids"


def save(encoder: Encoder, folder: Path) -> None:
    """Write `encoder.safetensors` and `encoder.json` into a folder.

    Raises:
        UsageError: the folder can't be written.
    """
    from safetensors import torch as safetensors

    config = {
        "format": FORMAT,
        "architecture": vars(encoder.architecture),
        "reads": TOKENS if isinstance(encoder.view, Tokens) else _GRIDS,
        "view": asdict(encoder.view),
        "classes": list(encoder.classes),
    }
    weights = {
        name: _smallest(value.detach().cpu().contiguous())
        for name, value in encoder.state_dict().items()
    }
    with writing("the encoder", folder):
        keep((json.dumps(config, indent=1) + "\n").encode(), folder / CONFIG)
        keep(safetensors.save(weights), folder / WEIGHTS)


def load(folder: Path, architecture: type[Architecture] = Architecture) -> Encoder:
    """Read an encoder, onto CUDA where that is present.

    Args:
        folder: that `save` wrote into.
        architecture: class of an encoder of grids, which says how its patches are cut; the file has
            its sizes only.

    Raises:
        InvalidFile: a file is missing, truncated, or not an encoder's.
    """
    path = folder / WEIGHTS
    weights = read_weights(path)
    encoder = _untrained(folder / CONFIG, weights, path, architecture)
    encoder.load_state_dict({name: torch.from_numpy(value) for name, value in weights.items()})
    return encoder.to(device()).eval()


def rounded(encoder: Encoder) -> Encoder:
    """The encoder, with weights that half precision holds, so that it takes half the space when
    stored."""
    for value in encoder.state_dict().values():
        value.copy_(value.half())
    return encoder


def _smallest(value: torch.Tensor) -> torch.Tensor:
    """The same values in half precision where that holds them."""
    half = value.half()
    return half if torch.equal(half.to(value.dtype), value) else value


def _untrained(path: Path, weights: Weights, of: Path, kind: type[Architecture]) -> Encoder:
    """The encoder that a file describes. It takes memory only if these weights, `of` another file,
    are of its shapes."""
    config = read_object(path)
    try:
        if config["format"] != FORMAT:
            raise ValueError(f"its format is {config['format']!r}, {FORMAT!r} is expected")
        sizes, values = _tuples(config["architecture"]), _tuples(config["view"])
        architecture: Sizes
        view: View
        if config["reads"] == TOKENS:
            architecture, view = TokenArchitecture(**sizes), Tokens(**values)
        elif config["reads"] == _GRIDS:
            architecture, view = kind(**sizes), Grid(**values)
        else:
            raise ValueError(f"it reads {config['reads']!r}, neither {TOKENS} nor {_GRIDS}")
        classes = [int(label) for label in config["classes"]]
        # A block costs time on `meta` too: a depth of billions would not end.
        if architecture.depth > len(weights):
            raise ValueError(
                f"the {len(weights)} tensors of {of.name} are too few for its "
                f"{architecture.depth} blocks"
            )
        # Shapes without memory, as the sizes in the file are not trusted.
        with torch.device("meta"):
            shapes = untrained(architecture, view, classes).state_dict()
    except (
        ArithmeticError,
        ValueError,
        TypeError,
        KeyError,
        RuntimeError,
        ToolchainError,
    ) as error:
        raise InvalidFile(f"this describes no encoder: {reason(error)}", path=path) from None
    require_shapes({name: tuple(value.shape) for name, value in shapes.items()}, weights, of)
    return untrained(architecture, view, classes)


def _tuples(values: dict[str, Any]) -> dict[str, Any]:
    return {
        name: tuple(value) if isinstance(value, list) else value for name, value in values.items()
    }


_BATCH = 64
"""Windows at a time: as many as stay in the processor's cache."""


def features(
    encoders: Encoder | Sequence[Encoder], windows: Windows | Inputs
) -> NDArray[np.float32]:
    """Features (n, dim) of windows or of their inputs; those of several encoders beside each other.

    Raises:
        UsageError: they have another shape than an encoder's.
    """
    chosen = [encoders] if isinstance(encoders, Encoder) else encoders
    return _applied(chosen, chosen, windows, sum(one.architecture.dim for one in chosen))


def logits(encoder: Encoder, windows: Windows | Inputs) -> NDArray[np.float32]:
    """Logits (n, classes) of a fine-tuned encoder; columns in the order of `encoder.classes`.

    Raises:
        UsageError: they have another shape than the encoder's, or it has no class head.
    """
    return _applied([encoder], [encoder.logits], windows, len(encoder.classes))


def _applied(
    encoders: Sequence[Encoder],
    functions: Sequence[Callable[[Tensor], Tensor]],
    windows: Windows | Inputs,
    columns: int,
) -> NDArray[np.float32]:
    """Return the outputs of the encoders' functions (n, columns), concatenated.

    Threads take a batch each instead of sharing one: batches are too small to be divided well, and
    no sum depends on how many threads there are.
    """
    inputs = windows.inputs if isinstance(windows, Windows) else windows
    where = encoders[0].norm.weight.device
    found = np.empty((len(inputs), columns), np.float32)
    for encoder in encoders:
        encoder.eval()

    def apply(start: int) -> None:
        part = inputs[start : start + _BATCH]
        with torch.inference_mode(), mixed(where):
            # Torch warns of arrays that can't be written, such as those mapped from a file.
            batch = torch.from_numpy(part if part.flags.writeable else part.copy()).to(where)
            found[start : start + _BATCH] = (
                torch.cat([function(batch).float() for function in functions], dim=1).cpu().numpy()
            )

    with (
        deterministic(0),
        ThreadPoolExecutor(
            torch.get_num_threads(), initializer=torch.set_num_threads, initargs=(1,)
        ) as pool,
    ):
        list(pool.map(apply, range(0, len(inputs), _BATCH)))
    return found
