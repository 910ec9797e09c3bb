"""Keeps recordings between recognising and writing, so that none is read twice.

They are kept on disk: a data set may be larger than memory.
"""

from __future__ import annotations

import tempfile
from functools import partial
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np
import pyarrow as pa
from pyarrow import feather

from runner.participants.declaration import BoundingBox
from runner.recording import Recording, Track
from xodr.network import RoadNetwork


class _Label(NamedTuple):
    """A track without its columns; rows: where they are among those of all tracks."""

    name: str
    kind: str
    category: str
    box: BoundingBox
    rows: slice


class _Kept(NamedTuple):
    path: Path
    labels: list[_Label]
    timestep: float
    network: RoadNetwork | None


class Shelf:
    """Recordings in files of a temporary folder, which goes with it; a context manager."""

    def __init__(self) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="recordings-")
        self._kept: dict[str, _Kept] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._folder.cleanup()

    def put(self, name: str, recording: Recording) -> None:
        """Keep a recording with all columns as they are."""
        tracks = list(recording.tracks.values())
        ends = np.cumsum([0, *(len(track.columns["time"]) for track in tracks)]).tolist()
        labels = [
            _Label(track.name, track.kind, track.category, track.box, slice(start, end))
            for track, start, end in zip(tracks, ends, ends[1:], strict=False)
        ]
        names = tracks[0].columns if tracks else ()
        table = pa.table({name: np.concatenate([track.columns[name] for track in tracks]) for name in names})
        path = Path(self._folder.name) / f"{len(self._kept)}.arrow"
        feather.write_feather(table, str(path), compression="uncompressed")
        self._kept[name] = _Kept(path, labels, recording.timestep, recording.network)

    def take(self, name: str) -> Recording:
        """The recording, which is kept no longer."""
        kept = self._kept.pop(name)
        table = feather.read_table(str(kept.path), memory_map=False)
        columns = {name: table[name].to_numpy() for name in table.column_names}
        kept.path.unlink()
        tracks = [Track(*label[:4], partial(_part, columns, label.rows)) for label in kept.labels]
        return Recording(tracks, kept.timestep, kept.network)


def _part(columns: dict[str, np.ndarray], rows: slice) -> dict[str, np.ndarray]:
    return {name: values[rows].copy() for name, values in columns.items()}
