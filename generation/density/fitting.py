"""Which density model says most of recordings that it has not seen: held-out log-likelihoods (METHOD §3)."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Hashable, Sequence
from functools import wraps
from importlib import import_module
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from generation.density.base import Density, folds
from recognition.study.report.tables import Table, spread
from recognition.trfe.samples import Floats
from schemas.errors import UsageError

MODELS = {
    "kde": ("KDE", "KDE, full covariance"),
    "independent": ("Independent", "independent 1-D KDEs"),
    "gaussian": ("Gaussian", "one Gaussian"),
    "mixture": ("Mixture", "Gaussian mixture (BIC)"),
    "flow": ("Flow", "normalizing flow (RealNVP)"),
}
"""Class and title of each model, by the name of its module."""


def model(name: str) -> Density:
    """A new model with its defaults.

    Raises:
        UsageError: there is none of that name.
    """
    if name not in MODELS:
        raise UsageError(f"there is no density {name!r}; densities: {', '.join(MODELS)}")
    make: Callable[[], Density] = getattr(import_module(f"generation.density.models.{name}"), MODELS[name][0])
    return make()


_Found = TypeVar("_Found")
_Work = Callable[[str, Floats, NDArray[Any]], _Found]


def _once(work: _Work[_Found]) -> _Work[_Found]:
    """The same model of the same rows is asked for by every round of a loop and by the tables of a report: work it out once."""
    found: dict[Hashable, _Found] = {}

    @wraps(work)
    def remembering(name: str, theta: Floats, recordings: NDArray[Any]) -> _Found:
        content = hashlib.blake2b(theta.tobytes() + repr(recordings.tolist()).encode()).digest()
        key = name, theta.shape, content
        if key not in found:
            found[key] = work(name, theta, recordings)
        return found[key]

    return remembering


@_once
def fitted(name: str, theta: Floats, recordings: NDArray[Any]) -> Density:
    """The model fitted on rows (n, d) of recordings (n,), the same object each time: not to be fitted anew."""
    return model(name).fit(theta, recordings)


@_once
def held_out(name: str, theta: Floats, recordings: NDArray[Any]) -> Floats:
    """Log-density (n,) of each row (n, d) by the model fitted on a part of the other recordings (n,); read-only."""
    found = np.empty(len(theta))
    for rows, tested in folds(recordings):
        found[tested] = model(name).fit(theta[rows], recordings[rows]).log_density(theta[tested])
    found.flags.writeable = False
    return found


def comparison(theta: Floats, recordings: NDArray[Any], names: Sequence[str] = tuple(MODELS)) -> Table:
    """Table of the models' held-out log-likelihoods, best first.

    Args:
        theta: rows (n, d). recordings: of each row (n,).
    """
    found = {name: held_out(name, theta, recordings) for name in names}
    parts = [tested for _, tested in folds(recordings)]
    rows: list[tuple[str, ...]] = [
        (MODELS[name][1], spread(found[name][tested].mean() for tested in parts))
        for name in sorted(names, key=lambda name: -found[name].mean())
    ]
    groups = len(np.unique(recordings))
    note = (
        f"{len(theta)} samples of {theta.shape[1]} parameters from {groups} recordings; mean ± standard deviation over the "
        "folds of log p (natural, in the parameters' units) of rows from recordings that were not fitted."
    )
    return Table("density", "Held-out log-likelihood", note, ("density", "log-likelihood per sample"), rows)
