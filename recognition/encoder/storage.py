"""Encoders in a folder: weights as safetensors, everything else as JSON."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch

from recognition.encoder.config import Architecture, Sizes, TokenArchitecture
from recognition.encoder.kinds import untrained
from recognition.encoder.model import Encoder
from recognition.encoder.training import device
from recognition.grids import Grid
from recognition.tokens.config import Tokens
from recognition.training.views import View
from schemas.errors import InvalidFile, ToolchainError, reason
from schemas.storage import keep, read_object, writing

_WEIGHTS, _CONFIG = "encoder.safetensors", "encoder.json"
_FORMAT = "xosc-toolchain encoder 3"
_TOKENS, _GRIDS = "tokens", "grids"
Tensors = dict[str, torch.Tensor]


def save(encoder: Encoder, folder: Path) -> None:
    """Write `encoder.safetensors` and `encoder.json` into a folder.

    Raises:
        UsageError: the folder can't be written.
    """
    from safetensors import torch as safetensors

    config = {
        "format": _FORMAT,
        "architecture": vars(encoder.architecture),
        "reads": _TOKENS if isinstance(encoder.view, Tokens) else _GRIDS,
        "view": asdict(encoder.view),
        "classes": list(encoder.classes),
    }
    weights = {name: _smallest(value.detach().cpu().contiguous()) for name, value in encoder.state_dict().items()}
    with writing("the encoder", folder):
        keep((json.dumps(config, indent=1) + "\n").encode(), folder / _CONFIG)
        keep(safetensors.save(weights), folder / _WEIGHTS)


def load(folder: Path, architecture: type[Architecture] = Architecture) -> Encoder:
    """Read an encoder, onto CUDA where that is present.

    Args:
        folder: that `save` wrote into.
        architecture: class of an encoder of grids, which says how its patches are cut; the file has its sizes only.

    Raises:
        InvalidFile: a file is missing, truncated, or not an encoder's.
    """
    path = folder / _WEIGHTS
    weights = _weights(path)
    encoder = _untrained(folder / _CONFIG, weights, path, architecture)
    encoder.load_state_dict(weights)
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


def _weights(path: Path) -> Tensors:
    from safetensors import SafetensorError
    from safetensors.torch import load_file

    try:
        weights = load_file(path)
    except (OSError, SafetensorError) as error:
        raise InvalidFile(f"these are no weights: {reason(error)}", path=path) from None
    for name, value in weights.items():
        if not value.is_floating_point() or not torch.isfinite(value).all():
            raise InvalidFile(f"the weights {name} are not finite numbers", path=path)
    return weights


def _untrained(path: Path, weights: Tensors, of: Path, kind: type[Architecture]) -> Encoder:
    """The encoder that a file describes. It takes memory only if these weights, `of` another file, are of its shapes."""
    config = read_object(path)
    try:
        if config["format"] != _FORMAT:
            raise ValueError(f"its format is {config['format']!r}, {_FORMAT!r} is expected")
        sizes, values = _tuples(config["architecture"]), _tuples(config["view"])
        architecture: Sizes
        view: View
        if config["reads"] == _TOKENS:
            architecture, view = TokenArchitecture(**sizes), Tokens(**values)
        elif config["reads"] == _GRIDS:
            architecture, view = kind(**sizes), Grid(**values)
        else:
            raise ValueError(f"it reads {config['reads']!r}, neither {_TOKENS} nor {_GRIDS}")
        classes = [int(label) for label in config["classes"]]
        if architecture.depth > len(weights):
            raise ValueError(f"the {len(weights)} tensors of {of.name} are too few for its {architecture.depth} blocks")
        with torch.device("meta"):
            shapes = untrained(architecture, view, classes).state_dict()
    except (ArithmeticError, ValueError, TypeError, KeyError, RuntimeError, ToolchainError) as error:
        raise InvalidFile(f"this describes no encoder: {reason(error)}", path=path) from None
    _require_shapes(shapes, weights, of)
    return untrained(architecture, view, classes)


def _require_shapes(shapes: Tensors, weights: Tensors, path: Path) -> None:
    """Refuse weights that are not of all these names and shapes."""
    for found, names in (("lack", shapes.keys() - weights.keys()), ("have besides", weights.keys() - shapes.keys())):
        if names:
            more = f" and {len(names) - 1} more" if len(names) > 1 else ""
            raise InvalidFile(f"these are not the weights of this encoder: they {found} {min(names)}{more}", path=path)
    for name, value in weights.items():
        if value.shape != shapes[name].shape:
            shape, expected = tuple(value.shape), tuple(shapes[name].shape)
            raise InvalidFile(f"these are not the weights of this encoder: {name} is of shape {shape}, not {expected}", path=path)


def _tuples(values: dict[str, Any]) -> dict[str, Any]:
    return {name: tuple(value) if isinstance(value, list) else value for name, value in values.items()}
