"""Windows of a folder of recordings, read, labelled by the rules and rasterised; or windows that are there already."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import compress
from pathlib import Path

import numpy as np

from recognition import datasets
from recognition.datasets import Source
from recognition.grids import Grid, covered
from recognition.labels import Event, label
from recognition.sites import site_of
from recognition.training.windows import Windows, store, windows_of
from schemas.errors import UsageError


def windows_at(path: Path, cache: Path, grid: Grid, events_per_class: int | None) -> Windows:
    """Windows of a folder that `Windows.save` wrote, or of recordings.

    Args:
        path: folder of windows, or folder or file of recordings.
        cache: folder that keeps windows made of recordings for the next time; roads made for them go there too.
        grid: of windows that have to be made.
        events_per_class: most events of each class; None takes all.

    Raises:
        InvalidFile: nothing of a known format.
        UsageError: windows of another shape than `grid`'s, or no event in the recordings.
    """
    if _is_windows(path):
        windows = Windows.load(path)
    elif _is_windows(cache):
        windows = Windows.load(cache)
    else:
        windows = _made(path, cache, grid, events_per_class)
    if windows.grids.shape[1:] != grid.shape:
        raise UsageError(f"windows of shape {windows.grids.shape[1:]} are not of the grid {grid.shape}", path=path)
    return windows


def source_of(path: Path) -> str:
    """Short digest of which recordings a folder holds, by their names and sizes; `windows` for one that holds windows."""
    if _is_windows(path):
        return "windows"
    found = [(source.name, source.path.stat().st_size) for source in datasets.open(path).sources]
    return hashlib.sha256(repr(found).encode()).hexdigest()[:16]


def fingerprint(windows: Windows) -> str:
    """Short digest of which windows there are: their labels, recordings, egos and times."""
    digest = hashlib.sha256(repr(windows.grids.shape).encode())
    for column in (windows.labels, windows.times):
        digest.update(np.ascontiguousarray(column).tobytes())
    for names in (windows.recordings, windows.egos):
        digest.update("\0".join(names.tolist()).encode())
    return digest.hexdigest()[:16]


def _is_windows(folder: Path) -> bool:
    return (folder / "windows.parquet").is_file()


def _made(path: Path, cache: Path, grid: Grid, events_per_class: int | None) -> Windows:
    """Windows of recordings that are read twice: to find their events, and for those that are taken."""
    roads = cache / "roads"
    sources = datasets.open(path, roads=roads).sources
    usable = [event for source in sources for event in _usable(source, grid, roads)]
    if not usable:
        raise UsageError("no rule finds an event in these recordings", path=path)
    taken_events: dict[str, list[Event]] = {}
    for event in _thinned(usable, events_per_class):
        taken_events.setdefault(event.recording, []).append(event)

    def parts() -> Iterator[Windows]:
        for source in sources:
            if source.name in taken_events:
                recording = source.load()
                yield windows_of(recording, taken_events[source.name], grid, site_of(source, recording, roads))

    store(parts(), (sum(map(len, taken_events.values())), *grid.shape), cache)
    return Windows.load(cache)


def _usable(source: Source, grid: Grid, roads: Path) -> list[Event]:
    """The events of a recording whose window lies within the ego's track."""
    recording = source.load()
    events = label(recording, site_of(source, recording, roads), source.name)
    return list(compress(events, covered(recording, [(event.ego, event.time) for event in events], grid)))


def _thinned(events: Sequence[Event], most: int | None) -> list[Event]:
    """At most so many events of each class, drawn, in their order."""
    if most is None:
        return list(events)
    order = np.random.default_rng(0).permutation(len(events)).tolist()
    taken: Counter[int] = Counter()
    chosen = []
    for number in order:
        taken[events[number].label] += 1
        if taken[events[number].label] <= most:
            chosen.append(number)
    return [events[number] for number in sorted(chosen)]
