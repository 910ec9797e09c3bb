"""Windows of a folder of recordings, read, labelled by the rules and drawn; or windows that are there already."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from itertools import compress
from pathlib import Path

import numpy as np

from recognition import datasets
from recognition.labels import Rules, label
from recognition.sites import Site, site_of
from recognition.training.moments import Moment, events_and_background
from recognition.training.views import View, visible
from recognition.training.windows import Windows, store, windows_of
from recognition.trfe.samples import drawn_of_each
from runner.recording import Recording
from schemas.errors import UsageError


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
