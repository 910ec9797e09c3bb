"""Densities of recorded parameters, fitted once: held-out log-densities say what is plausible (METHOD §3)."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Hashable
from functools import wraps
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from generation.density.base import Density, folds
from generation.density.model import model
from xodr.array_types import FloatArray, IntArray

_Found = TypeVar("_Found")
_Work = Callable[[str, FloatArray, NDArray[Any]], _Found]


def _once(work: _Work[_Found]) -> _Work[_Found]:
    """The same model of the same rows is asked for by every round of a loop and by the tables of a report: work it out once."""
    found: dict[Hashable, _Found] = {}

    @wraps(work)
    def remembering(name: str, theta: FloatArray, recordings: NDArray[Any]) -> _Found:
        content = hashlib.blake2b(theta.tobytes() + repr(recordings.tolist()).encode()).digest()
        key = name, theta.shape, content
        if key not in found:
            found[key] = work(name, theta, recordings)
        return found[key]

    return remembering


@_once
def fitted(name: str, theta: FloatArray, recordings: NDArray[Any]) -> Density:
    """The model fitted on rows (n, d) of recordings (n,), the same object each time: not to be fitted anew."""
    return model(name).fit(theta, recordings)


@_once
def held_out(name: str, theta: FloatArray, recordings: NDArray[Any]) -> FloatArray:
    """Log-density (n,) of each row (n, d) by the model fitted on a part of the other recordings (n,); read-only."""
    found = np.empty(len(theta))
    for each, tested in others(name, theta, recordings):
        found[tested] = each.log_density(theta[tested])
    found.flags.writeable = False
    return found


@_once
def others(name: str, theta: FloatArray, recordings: NDArray[Any]) -> list[tuple[Density, IntArray]]:
    """Models fitted on parts of the recordings, each with the rows of the others; every row is in one of them.

    What takes long to choose, as how many components a mixture has, is that of the model of all recordings (`Density.again`).
    """
    whole = fitted(name, theta, recordings)
    return [(whole.again(len(rows)).fit(theta[rows], recordings[rows]), tested) for rows, tested in folds(recordings)]
