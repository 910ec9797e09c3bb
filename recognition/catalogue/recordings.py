"""Recordings of a catalogue: their copies on disk, the settings for all of them, and the intake of
one."""

from __future__ import annotations

import hashlib
import json
import shutil
from dataclasses import asdict, dataclass, field
from functools import cached_property, lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from pyarrow import feather

from recognition.catalogue import detect
from recognition.catalogue.detect import Around
from recognition.catalogue.writing.write import CatalogueConfig
from recognition.labels import Rules
from recognition.recordings import Check, Cut, Exclusion, Gap, Report, Source, cache_roads
from recognition.recordings.intake import REFUSED
from recognition.recordings.source import by_name
from recognition.scenes import Roles, Site, site_of
from runner.engine.participants.declaration import BoundingBox
from runner.recording import Recording, Track
from schemas.common.errors import InvalidFile, ToolchainError, Unsupported, UsageError
from schemas.common.packages import version
from schemas.common.policy import limited
from schemas.common.storage import Records, Stamp, digest, drafted, stamp, writing
from xodr.graph.network import RoadNetwork
from xodr.reader import load


class Kept(NamedTuple):
    """A recording, and what reading it found."""

    recording: Recording
    report: Report


class RecordingStore:
    """Recordings in a folder, each under a name that changes with its file and with this package.

    Args:
        folder: is made where it is absent.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def find(self, source: Source) -> Kept | None:
        """Recording of a source; None if it is not kept, or its copy is damaged."""
        columns, records = self._path(source, "arrow"), self._records(source).read().records
        try:
            # The record is written last, with the digest: a store that was interrupted in between
            # is not whole.
            whole = bool(records) and _digest(columns) == records[0]["columns"]
            return self.get(source) if whole else None
        except (OSError, KeyError, TypeError, ValueError, pa.ArrowException):
            return None

    def put(self, source: Source, recording: Recording, report: Report) -> None:
        """Keep a recording with all columns as they are.

        Raises:
            UsageError: the folder can't be written.
        """
        tracks = list(recording.tracks.values())
        sizes = [len(track.columns["time"]) for track in tracks]
        names = tracks[0].columns if tracks else ()
        table = pa.table(
            {name: np.concatenate([track.columns[name] for track in tracks]) for name in names}
        )
        listed = [
            [track.name, track.kind, track.category, list(track.box), size]
            for track, size in zip(tracks, sizes, strict=True)
        ]
        network = str(recording.network.path) if recording.network is not None else None
        about = {"timestep": recording.timestep, "network": network, "tracks": listed}
        with writing("this", self._folder):
            self._folder.mkdir(parents=True, exist_ok=True)
            columns = self._path(source, "arrow")
            with drafted(columns) as draft:
                # Read back a few times within minutes, then removed: packing would take longer than
                # it saves.
                feather.write_feather(table, str(draft), compression="uncompressed")
            self._records(source).replace(
                [about | {"report": asdict(report), "columns": _digest(columns)}]
            )

    def get(self, source: Source) -> Kept:
        """The recording of a source, whose columns are read when they are asked for."""
        (about,) = self._records(source).read().records
        table = _Table(self._path(source, "arrow"))
        ends = np.cumsum([0, *(size for *_, size in about["tracks"])]).tolist()
        tracks = [
            Track(name, kind, category, BoundingBox(*box), partial(table.rows, slice(start, end)))
            for (name, kind, category, box, _), start, end in zip(
                about["tracks"], ends, ends[1:], strict=False
            )
        ]
        # By its path: a copy of the map in each recording would be read as another one each time.
        network = loaded(Path(about["network"])) if about["network"] else None
        return Kept(Recording(tracks, about["timestep"], network), _report(about["report"]))

    def clear(self) -> None:
        """Forget all recordings."""
        shutil.rmtree(self._folder, ignore_errors=True)

    def _records(self, source: Source) -> Records:
        """File with one record: timestep, tracks and report beside the columns,
        and their digest.
        """
        return Records(self._path(source, "jsonl"))

    def _path(self, source: Source, ending: str) -> Path:
        # Another version of the package may read a file otherwise, and a changed file has another
        # stamp. So has one that decides how it is read: the places of a copy are on its map.
        key = f"{version()}\n{source.name}\n{source.path.absolute()}\n{stamp(source.path)}"
        for file in source.beside():
            key += f"\n{file.absolute()}\n{stamp(file)}"
        return self._folder / f"{digest(key.encode(errors='surrogateescape'))}.{ending}"


def _digest(path: Path) -> str:
    """Digest of a file of any size."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, hashlib.blake2b).hexdigest()


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
        """Subset of the rows of each column."""
        # Columns of Arrow are read-only, and shared by all tracks; road coordinates are written
        # into them.
        return {name: values[part].copy() for name, values in self._columns.items()}


def _report(values: dict[str, Any]) -> Report:
    gaps, cuts = (
        [Gap(*one) for one in values.pop("gaps")],
        [Cut(*one) for one in values.pop("cuts")],
    )
    checks = [Check(*one) for one in values.pop("checks")]
    exclusions = [Exclusion(*one) for one in values.pop("exclusions")]
    return Report(
        **values | {"checks": checks, "gaps": gaps, "cuts": cuts, "exclusions": exclusions}
    )


EVENTS, VEHICLES = "events", "vehicles"


@dataclass(frozen=True)
class CatalogueSettings:
    """Settings for recognising and writing.

    Attributes:
        scenes: subject of a scenario: every event, or every suitable vehicle.
        road: the OpenDRIVE file of all recordings, instead of those that they have.
        columns: declaration of the columns of tables; None for those beside them.
        rules: thresholds of the labelling rules.
        needs: requirements on a suitable vehicle.
        around: time before and after an event that belongs to its scenario.
        gap: greatest time between two windows of one event, s.
        config: how the catalogue is written.
    """

    scenes: str = EVENTS
    road: Path | None = None
    columns: Path | None = None
    rules: Rules = field(default_factory=Rules)
    needs: detect.EgoRequirements = field(default_factory=detect.EgoRequirements)
    around: Around = field(default_factory=Around)
    gap: float = 1.0
    config: CatalogueConfig = field(default_factory=CatalogueConfig)


class RecordingLocation(NamedTuple):
    """Paths of a recording's data set and its name there, by which each process opens it.

    copies: folder of the recordings that were read; None to keep none. road, columns: given road
    and declaration of columns.
    """

    paths: tuple[Path, ...]
    name: str
    copies: Path | None = None
    road: Path | None = None
    columns: Path | None = None

    @property
    def source(self) -> Source:
        """Source that has the recording."""
        return by_name(self.paths, self.road, self.columns)[self.name]


class PlacedRecording(NamedTuple):
    """A recording with its road, and its quality from 0 to 1."""

    location: RecordingLocation
    road: Path
    roles: Roles
    quality: float = 1.0

    @property
    def site(self) -> Site:
        """Site with the road and the roles of its lanes."""
        return Site(self.road, loaded(self.road), self.roles)


class Inspection(NamedTuple):
    """Outcome of the intake of a recording: verdict, quality in [0, 1], and a reason for each check
    that found something."""

    name: str
    format: str
    verdict: str
    quality: float
    reasons: list[str]

    def as_json(self) -> str:
        """Return the inspection as one line of JSON."""
        return json.dumps(self._asdict(), ensure_ascii=False)


def inspected(source: Source) -> Inspection:
    """Read a recording and check it, on its map where it has one."""
    reasons: list[str] = []
    try:
        with limited():
            recording = source.examine()
            try:
                site_of(source, recording, cache_roads())
            except UsageError as error:  # without a map the rest stands
                reasons.append(error.message)
    except (InvalidFile, Unsupported) as error:
        if source.report is None or source.report.verdict != REFUSED:
            return Inspection(
                source.name, source.format, REFUSED, 0.0, [str(naming(source, error))]
            )
    assert source.report is not None, "the recording has been read"
    checks = [*dict.fromkeys(source.report.checks)]
    verdict, quality = source.report.verdict, source.report.quality
    refused = verdict == REFUSED
    reasons = [*(check.reason for check in checks), *reasons]
    return Inspection(source.name, source.format, verdict, 0.0 if refused else quality, reasons)


def naming(source: Source, error: ToolchainError) -> ToolchainError:
    """An error that names the source where it names no file."""
    error.path = error.path or str(source.path)
    return error
