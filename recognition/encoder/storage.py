"""Encoders in a folder: weights as safetensors, everything else as JSON."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch

from recognition.encoder.config import Architecture
from recognition.encoder.model import Encoder
from recognition.encoder.training import device
from recognition.grids import Grid
from schemas.errors import InvalidFile, ToolchainError
from schemas.storage import keep, writing

_WEIGHTS, _CONFIG = "encoder.safetensors", "encoder.json"
_FORMAT = "xosc-toolchain encoder 1"


def save(encoder: Encoder, folder: Path) -> None:
    """Write `encoder.safetensors` and `encoder.json` into a folder.

    Raises:
        UsageError: the folder can't be written.
    """
    from safetensors import torch as safetensors

    config = {
        "format": _FORMAT,
        "architecture": asdict(encoder.architecture),
        "grid": asdict(encoder.grid),
        "classes": list(encoder.classes),
    }
    weights = {name: _smallest(value.detach().cpu().contiguous()) for name, value in encoder.state_dict().items()}
    with writing("the encoder", folder):
        keep((json.dumps(config, indent=1) + "\n").encode(), folder / _CONFIG)
        keep(safetensors.save(weights), folder / _WEIGHTS)


def load(folder: Path) -> Encoder:
    """Read an encoder, onto CUDA where that is present.

    Raises:
        InvalidFile: a file is missing, truncated, or not an encoder's.
    """
    from safetensors import SafetensorError
    from safetensors.torch import load_file

    encoder = _untrained(folder / _CONFIG)
    path = folder / _WEIGHTS
    try:
        encoder.load_state_dict(load_file(path))
    except (OSError, SafetensorError, RuntimeError) as error:
        raise InvalidFile(f"these are not the weights of this encoder: {_first_line(error)}", path=path) from None
    if not all(torch.isfinite(value).all() for value in encoder.state_dict().values()):
        raise InvalidFile("there are weights that are not finite", path=path)
    return encoder.to(device()).eval()


def rounded(encoder: Encoder) -> Encoder:
    """The encoder, with weights that half precision holds, so that it takes half the space when stored."""
    for value in encoder.state_dict().values():
        value.copy_(value.half())
    return encoder


def _smallest(value: torch.Tensor) -> torch.Tensor:
    """The same values in half precision where that holds them."""
    half = value.half()
    return half if torch.equal(half.to(value.dtype), value) else value


def _untrained(path: Path) -> Encoder:
    try:
        config = json.loads(path.read_text(encoding="utf-8"))
        if config["format"] != _FORMAT:
            raise ValueError(f"its format is {config['format']!r}, {_FORMAT!r} is expected")
        architecture, grid = Architecture(**_tuples(config["architecture"])), Grid(**_tuples(config["grid"]))
        return Encoder(architecture, grid, [int(label) for label in config["classes"]])
    except (OSError, ValueError, TypeError, KeyError, ToolchainError) as error:
        raise InvalidFile(f"this describes no encoder: {_first_line(error)}", path=path) from None


def _tuples(values: dict[str, Any]) -> dict[str, Any]:
    return {name: tuple(value) if isinstance(value, list) else value for name, value in values.items()}


def _first_line(error: Exception) -> str:
    return str(error).strip().split("\n")[0] or type(error).__name__
