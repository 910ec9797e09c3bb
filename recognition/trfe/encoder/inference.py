"""Features of a stored encoder of tokens, in numpy: recognising needs no torch, whose import takes
seconds.

The same function as `recognition.trfe.encoder.model.TokenEncoder.forward`, in single precision.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from recognition.trfe.encoder.config import TokenArchitecture
from recognition.trfe.inputs.samples import Features
from recognition.trfe.inputs.tokens import Tokens
from schemas.common.array_types import BoolArray
from schemas.common.errors import InvalidFile, ToolchainError, UsageError, reason
from schemas.common.policy import current
from schemas.common.storage import keep, read_bytes, read_object, writing

WEIGHTS, CONFIG = "encoder.safetensors", "encoder.json"
"""Files of an encoder"""
FORMAT, TOKENS = "xosc-toolchain encoder 3", "tokens"
"""Format of the files, and what an encoder of tokens reads, as they say it"""
FURTHEST = 5.0
"""Features are cut to this amount: what is farther away or faster is that, and no more."""
WIDER = 4
"""The hidden layer of a block is this many times as wide as its tokens."""
_BATCH = 64
"""Windows at a time: as many as stay in the processor's cache"""
_HIDDEN = np.float32(-1e9)
"""Score of an absent token: its weight is 0 beside any that is there"""
_STABLE = 1e-5
"""Added to variances by layer norms (torch's default)"""

Weights = dict[str, NDArray[np.float32]]


class StoredEncoder:
    """An encoder of tokens as its files have it.

    Args:
        architecture: its sizes.
        view: of the windows that it reads.
        classes: labels that its head was fine-tuned to; none without a head.
        files: contents by name, for writing it as it was read.
        weights: of the files.
    """

    def __init__(
        self,
        architecture: TokenArchitecture,
        view: Tokens,
        classes: tuple[int, ...],
        files: Mapping[str, bytes],
        weights: Weights,
    ) -> None:
        self.architecture, self.view, self.classes = architecture, view, classes
        self._files, self._weights = files, weights

    @classmethod
    def read(cls, folder: Path) -> StoredEncoder | None:
        """Read an encoder of tokens; None for one of grids.

        Raises:
            InvalidFile: a file is missing, truncated, or not an encoder's.
        """
        path = folder / CONFIG
        config = read_object(path)
        if config.get("reads") != TOKENS:
            return None
        weights = read_weights(folder / WEIGHTS)
        try:
            if config["format"] != FORMAT:
                raise ValueError(f"its format is {config['format']!r}, {FORMAT!r} is expected")
            architecture = TokenArchitecture(**config["architecture"])
            view = Tokens(**config["view"])
            classes = tuple(int(label) for label in config["classes"])
            if view.frames % architecture.patch:
                raise ValueError(f"tokens of {architecture.patch} frames do not fit its windows")
            # Before `_shapes` lists them: a depth of billions would fill the memory.
            if architecture.depth > len(weights):
                raise ValueError(
                    f"the {len(weights)} tensors of {WEIGHTS} are too few for its "
                    f"{architecture.depth} blocks"
                )
        except (ArithmeticError, ValueError, TypeError, KeyError, ToolchainError) as error:
            raise InvalidFile(f"this describes no encoder: {reason(error)}", path=path) from None
        require_shapes(_shapes(architecture, view, len(classes)), weights, folder / WEIGHTS)
        files = {name: read_bytes(folder / name) for name in (CONFIG, WEIGHTS)}
        return cls(architecture, view, classes, files, weights)

    def save(self, folder: Path) -> None:
        """Write its files as they were read.

        Raises:
            UsageError: the folder can't be written.
        """
        with writing("the encoder", folder):
            for name, content in self._files.items():
                keep(content, folder / name)

    def features(self, windows: NDArray[np.floating[Any]]) -> Features:
        """Features (n, dim) of windows (n, participants, frames, features), NaN for absent
        participants; the same for any number of threads.

        Raises:
            UsageError: windows of another shape.
        """
        if windows.shape[1:] != self.view.shape:
            raise UsageError(
                f"the encoder reads windows of shape {self.view.shape}, not {windows.shape[1:]}"
            )
        found = np.empty((len(windows), self.architecture.dim), np.float32)

        def apply(start: int) -> None:
            found[start : start + _BATCH] = self._forward(windows[start : start + _BATCH])

        # Threads take whole batches and none divides a product, so that no sum depends on their
        # number.
        with threadpool_limits(1, "blas"), ThreadPoolExecutor(os.cpu_count()) as pool:
            list(pool.map(apply, range(0, len(windows), _BATCH)))
        return found

    def _forward(self, values: NDArray[np.floating[Any]]) -> Features:
        # `tokenise` writes NaN into all features of an absent participant: one of them tells.
        there = ~np.isnan(values[..., 0])
        seen = np.nan_to_num(values.astype(np.float32)).clip(-FURTHEST, FURTHEST)
        seen = np.concatenate([seen, there[..., None].astype(np.float32)], axis=-1)
        frames = _gelu(self._linear("frame.0", seen)) * there[..., None]
        n, participants, count, width = frames.shape
        patch = self.architecture.patch
        tokens = self._linear(
            "embedding", frames.reshape(n, participants, count // patch, patch * width)
        )
        tokens += self._weights["time"]
        tokens += self._weights["kind"][np.minimum(np.arange(participants), 1)]
        present = there.reshape(n, participants, -1, patch).any(axis=-1)
        *blocks, last = range(self.architecture.depth)
        for block in blocks:
            tokens = self._block(block, tokens, present, participants)
        # Only the ego's tokens are read: the last block leaves out the others.
        ego = self._block(last, tokens, present, 1)
        weight = present[:, :1, :, None].astype(np.float32)
        mean = (ego * weight).sum(axis=(1, 2)) / weight.sum(axis=(1, 2)).clip(min=1.0)
        return self._normed("norm", mean)

    def _block(self, number: int, tokens: Features, present: BoolArray, count: int) -> Features:
        """Tokens (n, participants, times, dim) of the first `count` participants after a block."""
        name, (n, participants, times, dim) = f"blocks.{number}", tokens.shape
        wanted: Any = tokens[:, :count]
        normed = self._normed(f"{name}.attention.norm", tokens).reshape(
            n, participants * times, dim
        )
        mixed = f"{name}.attention.mixed"
        # Rows of the mixed weights: dim of queries, then dim of keys and dim of values.
        query = self._linear(mixed, normed[:, : count * times], slice(dim))
        both = self._linear(mixed, normed, slice(dim, None))
        heads, size = self.architecture.heads, dim // self.architecture.heads
        query, key, value = (
            part.reshape(n, -1, heads, size).transpose(0, 2, 1, 3)
            for part in (query, both[..., :dim], both[..., dim:])
        )
        query *= np.float32(1.0 / np.sqrt(size))
        scores = query @ key.transpose(0, 1, 3, 2)
        scores += np.where(present, np.float32(0.0), _HIDDEN).reshape(n, 1, 1, -1)
        # Softmax is the same; in single precision exp overflows above 88.
        scores -= scores.max(axis=-1, keepdims=True)
        np.exp(scores, out=scores)
        scores /= scores.sum(axis=-1, keepdims=True)
        attended: Any = (scores @ value).transpose(0, 2, 1, 3).reshape(n, count, times, dim)
        tokens = wanted + self._linear(f"{name}.attention.out", attended)
        hidden = self._linear(f"{name}.layers.1", self._normed(f"{name}.layers.0", tokens))
        return np.asarray(tokens + self._linear(f"{name}.layers.3", _gelu(hidden)), np.float32)

    def _linear(self, name: str, values: Features, rows: slice = slice(None)) -> Features:
        # One product of two matrices: numpy takes products of stacks one by one.
        flat = values.reshape(-1, values.shape[-1]) @ self._weights[f"{name}.weight"][rows].T
        flat += self._weights[f"{name}.bias"][rows]
        return flat.reshape(*values.shape[:-1], -1)

    def _normed(self, name: str, values: Features) -> Features:
        centred = values - values.mean(axis=-1, keepdims=True)
        scale = np.sqrt((centred * centred).mean(axis=-1, keepdims=True) + np.float32(_STABLE))
        return centred / scale * self._weights[f"{name}.weight"] + self._weights[f"{name}.bias"]


def _gelu(values: Features) -> Features:
    from scipy.special import erf

    found = values * np.float32(np.sqrt(0.5))
    erf(found, out=found)
    found += np.float32(1.0)
    found *= values
    found *= np.float32(0.5)
    return found


def _shapes(
    architecture: TokenArchitecture, view: Tokens, classes: int
) -> dict[str, tuple[int, ...]]:
    """Shapes of all weights by name."""
    _, frames, features = view.shape
    dim, patch, frame = architecture.dim, architecture.patch, architecture.frame
    linear = {"frame.0": (frame, features + 1), "embedding": (dim, patch * frame)}
    norms = ["norm"]
    for number in range(architecture.depth):
        name = f"blocks.{number}"
        norms += [f"{name}.attention.norm", f"{name}.layers.0"]
        linear |= {
            f"{name}.attention.mixed": (3 * dim, dim),
            f"{name}.attention.out": (dim, dim),
            f"{name}.layers.1": (WIDER * dim, dim),
            f"{name}.layers.3": (dim, WIDER * dim),
        }
    if classes:
        linear["head"] = (classes, dim)
    found: dict[str, tuple[int, ...]] = {"time": (frames // patch, dim), "kind": (2, 1, dim)}
    for name, (out, into) in linear.items():
        found |= {f"{name}.weight": (out, into), f"{name}.bias": (out,)}
    for name in norms:
        found |= {f"{name}.weight": (dim,), f"{name}.bias": (dim,)}
    return found


def read_weights(path: Path) -> Weights:
    """Read the weights of an encoder by name, in single precision.

    Raises:
        InvalidFile: the file is missing, truncated, or holds anything but finite numbers.
    """
    from safetensors import SafetensorError
    from safetensors.numpy import load_file

    current().admit(path)
    try:
        weights = load_file(path)
    # numpy has no name for some kinds of numbers that the format has, such as bfloat16.
    except (OSError, SafetensorError, TypeError, AttributeError) as error:
        raise InvalidFile(f"these are no weights: {reason(error)}", path=path) from None
    for name, value in weights.items():
        if not np.issubdtype(value.dtype, np.floating) or not np.isfinite(value).all():
            raise InvalidFile(f"the weights {name} are not finite numbers", path=path)
    # Stored weights may have half precision, see `encoder.storage.rounded`.
    return {name: value.astype(np.float32) for name, value in weights.items()}


def require_shapes(shapes: Mapping[str, tuple[int, ...]], weights: Weights, path: Path) -> None:
    """Check that weights have all these names and shapes, and no others.

    Raises:
        InvalidFile: they have not.
    """
    wrong = "these are not the weights of this encoder: "
    for found, names in (
        ("lack", shapes.keys() - weights.keys()),
        ("have besides", weights.keys() - shapes.keys()),
    ):
        if names:
            more = f" and {len(names) - 1} more" if len(names) > 1 else ""
            raise InvalidFile(f"{wrong}they {found} {min(names)}{more}", path=path)
    for name, value in weights.items():
        if value.shape != shapes[name]:
            raise InvalidFile(
                f"{wrong}{name} is of shape {value.shape}, not {shapes[name]}", path=path
            )
