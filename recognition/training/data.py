"""Training data: windows of many recordings, their division into splits, and operating points."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import compress
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch

from recognition import datasets
from recognition.labels import Rules, label
from recognition.sites import Site, site_of
from recognition.training import Unit
from recognition.training.windows import Moment, View, Windows, events_and_background, store, visible, windows_of
from recognition.trfe.samples import drawn_of_each
from runner.recording import Recording
from schemas.common.array_types import FloatArray, IntArray
from schemas.common.errors import UsageError
from schemas.common.policy import limited


def windows_at(path: Path, cache: Path, view: View, most: int | None, *, background: bool = False) -> Windows:
    """Windows of a folder that `Windows.save` wrote, or of recordings.

    Args:
        path: folder of windows, or folder or file of recordings.
        cache: folder that keeps windows made of recordings for the next time; roads made for them go there too.
        view: of windows that have to be made.
        most: most windows of each class that are made of one recording; None takes all.
        background: whether there are windows at a regular stride too, with those in which nothing happens.

    Raises:
        InvalidFile: nothing of a known format.
        UsageError: windows of another shape than the view's, or no event in the recordings.
    """
    if is_windows(path):
        windows = Windows.load(path)
    elif is_windows(cache):
        windows = Windows.load(cache)
    else:
        windows = _made(path, cache, view, most, background)
    if windows.inputs.shape[1:] != view.shape:
        raise UsageError(f"windows of shape {windows.inputs.shape[1:]} are not of the shape {view.shape}", path=path)
    return windows


def source_of(path: Path) -> str:
    """Short digest of which recordings a folder holds, by their names and sizes; `windows` for one that holds windows."""
    if is_windows(path):
        return "windows"
    found = [(source.name, source.path.stat().st_size) for source in datasets.open(path).sources]
    return hashlib.sha256(repr(found).encode()).hexdigest()[:16]


def fingerprint(windows: Windows) -> str:
    """Short digest of which windows there are: their labels, recordings, egos and times."""
    digest = hashlib.sha256(repr(windows.inputs.shape).encode())
    for column in (windows.labels, windows.times):
        digest.update(np.ascontiguousarray(column).tobytes())
    for names in (windows.recordings, windows.egos):
        digest.update("\0".join(names.tolist()).encode())
    return digest.hexdigest()[:16]


def is_windows(folder: Path) -> bool:
    """Whether a folder holds windows."""
    return (folder / "windows.parquet").is_file()


def _made(path: Path, cache: Path, view: View, most: int | None, background: bool) -> Windows:
    """Windows of recordings, each read once."""
    roads = cache / "roads"

    def parts() -> Iterator[Windows]:
        for source in datasets.open(path, roads=roads).sources:
            with limited():
                recording = source.load()
                site = site_of(source, recording, roads)
                found = _moments(recording, site, source.name, view, background)
                windows = windows_of(recording, _thinned(found, most), view, site)
            if len(windows):
                yield windows

    if not store(parts(), cache):
        raise UsageError("no rule finds an event in these recordings", path=path)
    return Windows.load(cache)


def _moments(recording: Recording, site: Site, name: str, view: View, background: bool) -> list[Moment]:
    """Events, at junctions with lights too, and perhaps moments at the stride whose window lies within the ego's track."""
    rules = Rules(signalised=True)
    if background:
        events, regular = events_and_background(recording, site, name, rules)
    else:
        events, regular = label(recording, site, name, rules), []
    found = [*(Moment(one.recording, one.ego, one.time, int(one.label)) for one in events), *regular]
    return list(compress(found, visible(recording, [(one.ego, one.time) for one in found], view)))


def _thinned(found: Sequence[Moment], most: int | None) -> list[Moment]:
    """At most so many moments of each class, drawn, in their order."""
    labels = np.array([one.label for one in found], np.int64)
    return [found[number] for number in np.sort(drawn_of_each(labels, most, np.random.default_rng(0))).tolist()]


@contextmanager
def seeded(seed: int) -> Iterator[None]:
    """Within, torch is seeded and has one thread: small layers lose more by handing out work than more threads bring."""
    threads = torch.get_num_threads()
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        torch.set_num_threads(1)
        try:
            yield
        finally:
            torch.set_num_threads(threads)


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
        _thinned_rows(np.flatnonzero(kept & (of_window == k)), labels, share, events_per_class, generator)
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


def _thinned_rows(rows: IntArray, labels: IntArray, share: float, most: int | None, generator: np.random.Generator) -> IntArray:
    """At most round(share · most) rows of each class, drawn; ascending."""
    if most is None:
        return rows
    return np.sort(rows[drawn_of_each(labels[rows], max(round(share * most), 1), generator)])
