"""Which density model says most of recordings that it has not seen: held-out log-likelihoods (METHOD §3)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from generation.density.base import folds
from generation.density.fitting import held_out
from generation.density.model import models
from recognition.study.report.tables import Table, spread
from xodr.array_types import FloatArray


def comparison(theta: FloatArray, recordings: NDArray[Any], names: Sequence[str] | None = None) -> Table:
    """Table of the models' held-out log-likelihoods, best first.

    Args:
        theta: rows (n, d). recordings: of each row (n,).
        names: of the models; all where it is None.
    """
    every = models()
    found = {name: held_out(name, theta, recordings) for name in names or every}
    parts = [tested for _, tested in folds(recordings)]
    rows: list[tuple[str, ...]] = [
        (every[name].title, spread(found[name][tested].mean() for tested in parts))
        for name in sorted(found, key=lambda name: -found[name].mean())
    ]
    groups = len(np.unique(recordings))
    note = (
        f"{len(theta)} samples of {theta.shape[1]} parameters from {groups} recordings; mean ± standard deviation over the "
        "folds of log p (natural, in the parameters' units) of rows from recordings that were not fitted."
    )
    return Table("density", "Held-out log-likelihood", note, ("density", "log-likelihood per sample"), rows)
