"""Which windows train, stream, validate and test: whole recordings (or whole vehicles) go to one part, never single windows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from recognition.training import Unit
from recognition.training.windows import Windows
from recognition.trfe.samples import drawn_of_each
from xodr.array_types import FloatArray, IntArray

SHARES = {"labelled": 0.56, "stream": 0.14, "validation": 0.15, "test": 0.15}
"""The training share of 70 % in two: a fifth of it never gets a label, as the known traffic of later streams."""


class Split(NamedTuple):
    """Window numbers of each part, ascending.

    Attributes:
        labelled: training windows whose labels may be learnt once their class is known.
        stream: training windows that only ever arrive without a label.
        validation: for calibration and thresholds.
        test: for figures.
        left_out: classes that have not enough units to be in every part, with the number of their windows.
    """

    labelled: IntArray
    stream: IntArray
    validation: IntArray
    test: IntArray
    left_out: dict[int, int]


def split(windows: Windows, seed: int, unit: Unit = "recording", events_per_class: int | None = None) -> Split:
    """Divide the windows that have a class.

    Units are dealt by iterative stratification, so that each class has its share in each part. Windows of classes that miss
    a part are left out of all; with `events_per_class` each class is thinned to that number.

    Source: Sechidis, Tsoumakas, Vlahavas, On the Stratification of Multi-Label Data, ECML PKDD 2011.
    """
    generator = np.random.default_rng(seed)
    labels = windows.labels
    units, classes = _units(windows, unit), np.unique(labels[labels > 0])
    held = np.array([[np.count_nonzero(labels[rows] == label) for label in classes] for rows in units]).reshape(-1, len(classes))
    part = _deal(held, np.array(list(SHARES.values())), generator)
    of_window = np.full(len(labels), -1)
    for rows, chosen in zip(units, part.tolist(), strict=True):
        of_window[rows] = chosen
    present = np.array([[((of_window == k) & (labels == label)).any() for k in range(len(SHARES))] for label in classes])
    complete = present.all(axis=1)
    kept = np.isin(labels, classes[complete])
    labelled, stream, validation, test = (
        _thinned(np.flatnonzero(kept & (of_window == k)), labels, share, events_per_class, generator)
        for k, share in enumerate(SHARES.values())
    )
    left_out = {int(label): int(np.count_nonzero(labels == label)) for label in classes[~complete]}
    return Split(labelled, stream, validation, test, left_out)


def _units(windows: Windows, unit: Unit) -> list[IntArray]:
    """Rows of each unit that has a window with a class, in the order of names."""
    names = windows.recordings if unit == "recording" else np.char.add(np.char.add(windows.recordings, "\0"), windows.egos)
    rows = np.flatnonzero(windows.labels > 0)
    _, number = np.unique(names[rows], return_inverse=True)
    order = np.argsort(number, kind="stable")
    return np.split(rows[order], np.flatnonzero(np.diff(number[order])) + 1) if len(rows) else []


def _deal(held: IntArray, shares: FloatArray, generator: np.random.Generator) -> IntArray:
    """Part of each unit, given how many windows (units, classes) it holds.

    The class with the fewest units left is dealt next, its largest unit to a part that has none of it, else to the part that
    lacks most windows of it.
    """
    part = np.full(len(held), -1)
    lacking = shares[:, None] * held.sum(axis=0)
    order = generator.permutation(len(held))
    while (part < 0).any():
        open_ = order[part[order] < 0]
        left = held[open_].sum(axis=0)
        rarest = int(np.where(left > 0, (held[open_] > 0).sum(axis=0), len(held) + 1).argmin())
        having = open_[held[open_, rarest] > 0]
        largest = having[held[having, rarest].argmax()]
        without = np.array([not held[part == k, rarest].any() for k in range(len(shares))])
        taker = int(np.lexsort((-lacking.sum(axis=1), -lacking[:, rarest], ~without))[0])
        part[largest] = taker
        lacking[taker] -= held[largest]
    return part


def _thinned(rows: IntArray, labels: IntArray, share: float, most: int | None, generator: np.random.Generator) -> IntArray:
    """At most round(share · most) rows of each class, drawn; ascending."""
    if most is None:
        return rows
    return np.sort(rows[drawn_of_each(labels[rows], max(round(share * most), 1), generator)])
