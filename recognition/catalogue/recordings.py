"""Recordings of a catalogue: reading, checking and cutting one, and its copy on disk."""

from __future__ import annotations

import gc
import hashlib
import json
import shutil
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property, lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from pyarrow import feather

from recognition import recordings as datasets
from recognition.catalogue import detect
from recognition.catalogue.detect import (
    Around,
    EgoVehicle,
    Episode,
    Moment,
    of_findings,
    of_vehicles,
)
from recognition.catalogue.exposure import Mileage, exposure_of
from recognition.catalogue.writing.played import Played, Trial, play
from recognition.catalogue.writing.write import (
    CatalogueConfig,
    CatalogWriter,
    Material,
    PendingCatalog,
    facts_of,
)
from recognition.labels import LabelledEvent, Rules, label
from recognition.labels.critical import with_critical
from recognition.labels.labelling import BY_ROLE
from recognition.recordings import Check, Cut, Exclusion, Gap, Report, Source, cache_roads
from recognition.recordings.intake import REFUSED
from recognition.scenes import Roles, Site, site_of
from recognition.scenes.cut import Scope
from runner.engine.participants.declaration import BoundingBox
from runner.recording import Recording, Track
from schemas.common.errors import InvalidFile, NotWritten, ToolchainError, Unsupported, UsageError
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
        # stamp.
        key = f"{version()}\n{source.name}\n{source.path.absolute()}\n{stamp(source.path)}"
        if source.given is not None:
            key += f"\n{source.given.absolute()}\n{stamp(source.given)}"
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
_REFUSALS = (InvalidFile, Unsupported, UsageError)
_LONG = 200
"""Participants of a recording that takes so long to write that it is worth a search for garbage, in
all that is loaded"""


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

    store: folder of the recordings that were read. road, columns: given road and declaration of
    columns.
    """

    paths: tuple[Path, ...]
    name: str
    store: Path
    road: Path | None = None
    columns: Path | None = None

    @property
    def source(self) -> Source:
        """Source that has the recording."""
        return _by_name(self.paths, self.road, self.columns)[self.name]


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


class LabelledRecording(NamedTuple):
    """Results of reading and labelling a recording, without the recording itself.

    egos, exclusions: the vehicles that are egos of scenes of vehicles, and those that are not.
    """

    placed: PlacedRecording
    report: Report
    exposure: Mileage
    events: list[LabelledEvent]
    egos: list[EgoVehicle]
    exclusions: list[Exclusion]


class Block(NamedTuple):
    """Episodes of a recording to be written, and the name of its road in the catalogue."""

    placed: PlacedRecording
    road: str
    episodes: Sequence[Episode]


class TrialBlock(NamedTuple):
    """Scenarios of a recording to be played."""

    location: RecordingLocation
    trials: Sequence[Trial]


class Done(NamedTuple):
    """Written scenarios of a recording, and errors."""

    written: PendingCatalog
    error: ToolchainError | None


@lru_cache(maxsize=1)
def opened(
    paths: tuple[Path, ...], road: Path | None = None, columns: Path | None = None
) -> list[Source]:
    """The recordings in files and folders, listed once in each process.

    Args:
        road: the OpenDRIVE file of all of them, instead of those that they have.
        columns: declaration of the columns of tables.
    """
    found = listed(paths, columns)
    return [replace(source, given=road) for data_set in found for source in data_set.sources]


@lru_cache(maxsize=1)
def _by_name(paths: tuple[Path, ...], road: Path | None, columns: Path | None) -> dict[str, Source]:
    """The recordings in files and folders by name: data sets have millions."""
    return {source.name: source for source in opened(paths, road, columns)}


@lru_cache(maxsize=1)
def listed(paths: tuple[Path, ...], columns: Path | None = None) -> list[datasets.DataSet]:
    """The data sets in files and folders, listed once in each process."""
    return [datasets.open(path, columns=columns) for path in paths]


@limited()
def looked(source: Source, rules: Rules) -> tuple[Recording, Site, list[LabelledEvent]]:
    """A recording, placed on the roads of its site, and the events and critical moments in it.

    Raises:
        InvalidFile, Unsupported, UsageError: it can't be read, or its roads are unknown or unsound.
    """
    recording = source.load()
    site = site_of(source, recording, cache_roads())
    return recording, site, _events(recording, site, source.name, rules)


def _events(recording: Recording, site: Site, name: str, rules: Rules) -> list[LabelledEvent]:
    return with_critical(label(recording, site, name, rules), recording, site, name, rules)


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
            return Inspection(source.name, source.format, REFUSED, 0.0, [str(_of(source, error))])
    assert source.report is not None, "the recording has been read"
    checks = [*dict.fromkeys(source.report.checks)]
    verdict, quality = source.report.verdict, source.report.quality
    refused = verdict == REFUSED
    reasons = [*(check.reason for check in checks), *reasons]
    return Inspection(source.name, source.format, verdict, 0.0 if refused else quality, reasons)


class Findings(NamedTuple):
    """Findings of a recording, without scenarios.

    rows: of the index, with the columns `folder` and `name` of the scenario that each stands for.
    """

    source: Source
    day: str
    exposure: Mileage
    rows: list[dict[str, Any]]


def found_in(settings: CatalogueSettings, location: RecordingLocation) -> Findings | ToolchainError:
    """Read a recording and return its findings by the rules; the error if it is unreadable."""
    source = location.source
    try:
        with limited():
            recording, site, events = looked(source, settings.rules)
            assert source.report is not None, "the recording has been read"
            exposure = _exposure(recording, site, settings.rules)
            moments = detect.joined(map(detect.by_rules, events), settings.gap)
            scope, quality = settings.config.scope, source.report.quality
            material = Material(source, recording, site, scope, quality)
            rows = facts_of(material, of_findings(source.name, moments, settings.around))
    except _REFUSALS as error:
        return _of(source, error)
    return Findings(source, material.conditions.day, exposure._replace(quality=quality), rows)


def _exposure(recording: Recording, site: Site, rules: Rules) -> Mileage:
    """Exposure of a recording; ramps are blocked where roles of lanes are in doubt."""
    exposure = exposure_of(recording, rules)
    if site.roles.doubts:
        exposure = exposure._replace(blocked=frozenset(one.title for one in BY_ROLE))
    return exposure


def read(
    settings: CatalogueSettings, location: RecordingLocation
) -> LabelledRecording | ToolchainError:
    """Read, keep and label a recording, from the store if it is there; return the error if it is
    unreadable."""
    source, store = location.source, RecordingStore(location.store)
    try:
        with limited():
            kept = store.find(source)
            if kept is not None:
                recording, report = kept
                site = site_of(source, recording, cache_roads())
                events = _events(recording, site, source.name, settings.rules)
            else:
                recording, site, events = looked(source, settings.rules)
                assert source.report is not None, "the recording has been read"
                report = source.report
                store.put(source, recording, report)
            needs = settings.needs if settings.scenes == VEHICLES else None
            egos, exclusions = (
                detect.vehicles(recording, site.network, needs) if needs is not None else ([], [])
            )
            placed = PlacedRecording(location, site.path, site.roles, report.quality)
            exposure = _exposure(recording, site, settings.rules)
    except NotWritten:
        raise  # the other recordings can't be either
    except _REFUSALS as error:
        return _of(source, error)
    return LabelledRecording(placed, report, exposure, events, egos, exclusions)


def episodes(
    settings: CatalogueSettings, labelled: LabelledRecording, moments: Iterable[Moment]
) -> list[Episode]:
    """Return the scenarios to be made of a recording."""
    name, found = labelled.placed.location.name, detect.joined(moments, settings.gap)
    return (
        of_findings(name, found, settings.around)
        if settings.scenes == EVENTS
        else of_vehicles(name, labelled.egos, found)
    )


def write(out: Path, settings: CatalogueSettings, sorted_by: str, block: Block) -> Done:
    """Write scenarios of a recording into the folder of a catalogue."""
    writer = CatalogWriter(out, settings.config, sorted_by)
    try:
        with limited():
            writer.add(_material(block.placed, settings.config.scope), block.road, block.episodes)
    except NotWritten:
        raise  # the other recordings can't be either
    except _REFUSALS as error:
        return Done(writer.written, _of(block.placed.location.source, error))
    return Done(writer.written, None)


def played(out: Path, block: TrialBlock) -> list[Played]:
    """Play scenarios in the folder of a catalogue, and compare them with their recording."""
    return play(out, recorded(block.location), block.trials)


@lru_cache(maxsize=1)
def recorded(location: RecordingLocation) -> Recording:
    """A recording from the store, which is kept for its next stages, also in processes that are
    forked from this one."""
    return RecordingStore(location.store).get(location.source).recording


@lru_cache(maxsize=1)
def _material(placed: PlacedRecording, scope: Scope) -> Material:
    """Return the used part of a recording, cached for its other blocks."""
    recording = recorded(placed.location)
    material = Material(placed.location.source, recording, placed.site, scope, placed.quality)
    if len(recording.tracks) >= _LONG:
        gc.unfreeze()
        gc.collect()
        gc.freeze()  # until the next such recording no garbage is sought in it, nor in the roads
    return material


def forget() -> None:
    """Clear the cache of opened sources: other files may have the same names."""
    opened.cache_clear()
    _by_name.cache_clear()
    listed.cache_clear()
    recorded.cache_clear()
    _material.cache_clear()


def _of(source: Source, error: ToolchainError) -> ToolchainError:
    """An error that names the source where it names no file."""
    error.path = error.path or str(source.path)
    return error
