"""Keeps recordings as they were read and placed on roads, so that none is read twice: by other stages, processes, or a later run.

They are kept in files: a data set may be larger than memory.
"""

from __future__ import annotations

import json
import shutil
from dataclasses import asdict
from functools import cached_property, lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from pyarrow import feather

from recognition.datasets import Cut, Exclusion, Gap, Report, Source
from runner.participants.declaration import BoundingBox
from runner.recording import Recording, Track
from schemas.packages import version
from schemas.storage import Stamp, digest, keep, read_object, stamp, writing
from xodr.network import RoadNetwork
from xodr.reader import load


class Kept(NamedTuple):
    """A recording, and what reading it found."""

    recording: Recording
    report: Report


class Shelf:
    """Recordings in a folder, each under a name that changes with its file and with this package.

    Args:
        folder: is made where it is absent.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def has(self, source: Source) -> bool:
        """Whether the recording of a source is kept."""
        return self._path(source, "json").is_file()

    def put(self, source: Source, recording: Recording, report: Report) -> None:
        """Keep a recording with all columns as they are.

        Raises:
            UsageError: the folder can't be written.
        """
        tracks = list(recording.tracks.values())
        sizes = [len(track.columns["time"]) for track in tracks]
        names = tracks[0].columns if tracks else ()
        table = pa.table({name: np.concatenate([track.columns[name] for track in tracks]) for name in names})
        listed = [
            [track.name, track.kind, track.category, list(track.box), size] for track, size in zip(tracks, sizes, strict=True)
        ]
        network = str(recording.network.path) if recording.network is not None else None
        about = {"timestep": recording.timestep, "network": network, "tracks": listed}
        with writing("this", self._folder):
            self._folder.mkdir(parents=True, exist_ok=True)
            feather.write_feather(table, str(self._path(source, "arrow")), compression="uncompressed")
            keep(json.dumps(about | {"report": asdict(report)}).encode(), self._path(source, "json"))

    def get(self, source: Source) -> Kept:
        """The recording of a source, whose columns are read when they are asked for."""
        about: dict[str, Any] = read_object(self._path(source, "json"))
        table = _Table(self._path(source, "arrow"))
        ends = np.cumsum([0, *(size for *_, size in about["tracks"])]).tolist()
        tracks = [
            Track(name, kind, category, BoundingBox(*box), partial(table.rows, slice(start, end)))
            for (name, kind, category, box, _), start, end in zip(about["tracks"], ends, ends[1:], strict=False)
        ]
        network = loaded(Path(about["network"])) if about["network"] else None
        return Kept(Recording(tracks, about["timestep"], network), _report(about["report"]))

    def clear(self) -> None:
        """Forget all recordings."""
        shutil.rmtree(self._folder, ignore_errors=True)

    def _path(self, source: Source, ending: str) -> Path:
        key = f"{version()}\n{source.name}\n{source.path.absolute()}\n{stamp(source.path)}"
        return self._folder / f"{digest(key.encode(errors='surrogateescape'))}.{ending}"


def loaded(path: Path) -> RoadNetwork:
    """The road network of a file, read once for several recordings."""
    return _loaded(path, stamp(path))


@lru_cache(maxsize=4)
def _loaded(path: Path, _stamp: Stamp) -> RoadNetwork:
    return load(path)


class _Table:
    """The rows of all tracks, read at once when one of them is asked for."""

    def __init__(self, path: Path) -> None:
        self._path = path

    @cached_property
    def _columns(self) -> dict[str, np.ndarray]:
        table = feather.read_table(str(self._path), memory_map=False)
        return {name: table[name].to_numpy() for name in table.column_names}

    def rows(self, part: slice) -> dict[str, np.ndarray]:
        """Some rows of each column."""
        return {name: values[part].copy() for name, values in self._columns.items()}


def _report(values: dict[str, Any]) -> Report:
    gaps, cuts = [Gap(*one) for one in values.pop("gaps")], [Cut(*one) for one in values.pop("cuts")]
    return Report(**values | {"gaps": gaps, "cuts": cuts, "exclusions": [Exclusion(*one) for one in values.pop("exclusions")]})
