"""Data sets of recordings: their sources, reports of what was repaired or left out, and the
readers' participants."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache, partial
from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn

from recognition.recordings.conditions import OddConditions, conditions_of
from recognition.recordings.intake import REFUSED, Report, examine
from runner.engine.participants.declaration import BoundingBox
from runner.recording import Recording
from schemas.common import packages, plugins
from schemas.common.errors import InvalidFile, nearest
from schemas.common.policy import current
from schemas.common.storage import LONGEST_POINTER, cache_folder, read_bytes
from schemas.common.terminal.text import one_line

if TYPE_CHECKING:
    from runner.recording import Track
    from schemas.common.array_types import FloatArray


class SiteRoad(NamedTuple):
    """An OpenDRIVE file, and what other files say of its traffic lights.

    lights: roads in it that traffic lights are for.
    signalised: whether phases of lights were recorded, so that all junctions have some.
    notes: what was assumed, changed or left out when the road was made, one sentence each.
    """

    path: Path
    lights: frozenset[str] = frozenset()
    signalised: bool = False
    notes: tuple[str, ...] = ()


_STOP_LINE, _APPROACH = 3.0, 8.0
"""Greatest distance (m) of a vehicle's way from the stop line of its light, and time (s) within
which it passes there"""


class LightStates(NamedTuple):
    """Recorded states of traffic lights.

    x, y: middle of the stop line of each light (k,), m. time: of the states (n,), s. states: of
    each light, one per time, in the words of the data set.
    """

    x: FloatArray
    y: FloatArray
    time: FloatArray
    states: tuple[tuple[str, ...], ...]

    def ahead(self, track: Track, time: float) -> str | None:
        """Return the state at a time (s) of the light whose stop line a track passes soonest before
        or after; None for none."""
        import numpy as np

        columns = track.columns
        rows = np.flatnonzero(np.abs(columns["time"] - time) <= _APPROACH)
        if not len(rows) or not len(self.time):
            return None
        apart = np.hypot(columns["x"][rows][:, None] - self.x, columns["y"][rows][:, None] - self.y)
        passing = np.where(
            apart.min(axis=0) <= _STOP_LINE,
            np.abs(columns["time"][rows[apart.argmin(axis=0)]] - time),
            np.inf,
        )
        light = int(passing.argmin()) if len(passing) else 0
        if not len(passing) or not np.isfinite(passing[light]):
            return None
        return self.states[light][int(np.abs(self.time - time).argmin())]


def _no_ego() -> None:
    """Return no name: the recording has no vehicle of its own."""


def _no_lights() -> None:
    """Return no states: the recording has none of traffic lights."""


@dataclass(eq=False)
class Source:
    """One recording of a data set, not read yet.

    Args:
        name: unique in its data set; splits into training and test data go by it.
        site: where it was recorded; sources of one site share a map.
        format: name of the format; empty where the file can't be read far enough to tell.
        path: its main file.
        read: reads it.
        road: makes the site's road in a folder, from the recording and what the data set has
            instead of OpenDRIVE; None where it has nothing.
        map: the site's map, as the data set has it (Lanelet2, CommonRoad); None without one, or
            where the recording brings its road network with it.
        origin: latitude and longitude (degrees) of the origin of the coordinates, where the data
            set has them.
        given: the OpenDRIVE file that the user names, before all others.
        columns: the declaration of its columns, if it is a table of the user's own.
        ego: name of the recording's own vehicle, asked for after it was read; None where it has
            none.
        lights: recorded states of traffic lights, asked for after it was read; None where it has
            none.
        odd: conditions that the data state, asked for after it was read.
        simulated: whether it is a run, in which what happened did happen: nothing is refused.
    """

    name: str
    site: str
    format: str
    path: Path
    read: Callable[[], tuple[Recording, Report]] = field(repr=False)
    map: Path | None = None
    origin: tuple[float, float] | None = None
    road: Callable[[Recording, Path], SiteRoad] | None = field(default=None, repr=False)
    given: Path | None = None
    columns: Path | None = None
    ego: Callable[[], str | None] = field(default=_no_ego, repr=False)
    lights: Callable[[], LightStates | None] = field(default=_no_lights, repr=False)
    odd: Callable[[], OddConditions] = field(default=OddConditions, repr=False)
    simulated: bool = False
    report: Report | None = field(default=None, init=False, repr=False)
    """what the last reading found; None before"""

    def beside(self) -> list[Path]:
        """Other files that a reading depends on, which a user edits: map and declaration."""
        road = self.path.parent / f"{self.site}.xodr"
        files = (self.given, self.map, self.columns, road)
        return [file for file in files if file is not None and file.is_file()]

    def load(self) -> Recording:
        """Read and examine the recording, afresh each time, and renew `report`.

        Raises:
            InvalidFile: a file is malformed, or the recording is impossible; names file, line and
                column, or all reasons.
            Unsupported: it holds something that is not supported.
        """
        recording = self.examine()
        self.require()
        return recording

    def examine(self) -> Recording:
        """Read the recording and check whether it is possible; `report` has the outcome.

        Raises:
            InvalidFile: a file is malformed; names file, line and column.
            Unsupported: it holds something that is not supported.
        """
        try:
            recording, self.report = self.read()
        except InvalidFile as error:
            error.path = error.path or str(self.path)
            raise
        if not self.simulated:
            recording = examine(recording, self.report)
        self.report.remarks += [
            check.reason for check in self.report.checks if check.verdict != REFUSED
        ]
        return recording

    def conditions(self) -> OddConditions:
        """Conditions of the operational design domain, by the data and an `odd.toml`.

        Raises:
            InvalidFile: that file is malformed; names key and choices.
        """
        return conditions_of(self.path, self.name, self.odd())

    def require(self) -> None:
        """Refuse the recording if a check failed.

        Raises:
            InvalidFile: with the reasons.
        """
        assert self.report is not None, "the recording has been read"
        reasons = [check.reason for check in self.report.checks if check.verdict == REFUSED]
        if reasons:
            raise InvalidFile("; ".join(reasons), path=self.path)


@dataclass(eq=False)
class DataSet:
    """A folder or file with recordings; `sources` lists them without reading their tracks."""

    path: Path
    find: Callable[[], tuple[list[Source], list[Path]]] = field(repr=False)

    @cached_property
    def _found(self) -> tuple[list[Source], list[Path]]:
        return self.find()

    @property
    def skipped(self) -> list[Path]:
        """Files that no format claims, and that belong to no recording: of an unknown format."""
        return self._found[1]

    @property
    def sources(self) -> list[Source]:
        """The recordings, in the order of their files.

        Raises:
            InvalidFile: no recording of a known format is there, or the name of one can't be
                printed. A table or index that can't be read, so that it may be a recording or not,
                is a source that says so when it is loaded.
        """
        return self._found[0]


def _columns_hint(path: Path) -> str:
    """The way to read a table with columns of its own; empty for other files."""
    if path.suffix.lower() not in (".csv", ".txt") or not path.is_file():
        return ""
    with suppress(OSError, ValueError), path.open(encoding="utf-8") as file:
        names = one_line(file.readline(_LONGEST_HEAD).strip())
        return (
            f"; its first line is {names!r}: a columns.toml beside it, or --columns FILE, says "
            "which column is which"
        )
    return ""


_LONGEST_HEAD = 200
"""Characters of the first line of a table that a message shows"""
REAR_AXLE = 0.3
"""Distance of the rear axle behind the centre of a vehicle, in lengths of it."""

_USUAL = {
    "car": (4.5, 1.8, 1.5),
    "van": (6.0, 2.1, 2.6),
    "truck": (8.0, 2.4, 3.5),
    "bus": (12.0, 2.5, 3.0),
    "trailer": (6.0, 2.2, 2.5),
    "tram": (30.0, 2.4, 3.5),
    "motorbike": (2.2, 0.9, 1.5),
    "bicycle": (1.8, 0.6, 1.8),
    "pedestrian": (0.5, 0.5, 1.8),
    "obstacle": (1.0, 1.0, 1.0),
}
"""Usual length, width and height of each category, m."""


class TrackParticipant(NamedTuple):
    """Participant of a track."""

    name: str
    kind: str
    category: str
    box: BoundingBox


_LONGEST, _WIDEST = 100.0, 10.0
"""Greatest length and width of what moves, m; trams reach 75 m"""


def wrong_size(category: str, length: float, width: float) -> str | None:
    """Return what is wrong with the size (m) of what moves, such as other units;
    None for nothing.
    """
    too_large = length > _LONGEST or width > _WIDEST
    return f"{length:g} m by {width:g} m is no size of a {category}" if too_large else None


def participant(
    name: str, category: str, length: float | None = None, width: float | None = None
) -> TrackParticipant:
    """A participant of a category of `_USUAL`, with the usual size where none was recorded; m.

    Raises:
        InvalidFile: there is no such category, or a moving participant has a size in other units
            than m.
    """
    if category not in _USUAL:
        told = f"there is no category {category!r}; {nearest(category, _USUAL)}"
        raise InvalidFile(told, element=f"participant {name}")
    usual_length, usual_width, height = _USUAL[category]
    length = usual_length if length is None else length
    width = usual_width if width is None else width
    kind = {"pedestrian": "pedestrian", "obstacle": "miscellaneous"}.get(category, "vehicle")
    wrong = None if kind == "miscellaneous" else wrong_size(category, length, width)
    if wrong:
        raise InvalidFile(wrong, element=f"participant {name}")
    # OpenSCENARIO's reference point is the rear axle of a vehicle, and the centre of others.
    behind = REAR_AXLE * length if kind == "vehicle" else 0.0
    return TrackParticipant(
        name, kind, category, BoundingBox(behind, 0.0, height / 2, length, width, height)
    )


FORMATS = "recognition.recordings.formats"
_PARTS = ("TITLE", "BY_CONTENT", "claims", "sources")
"""Names that the module of a format defines"""
_SUFFIXES = (".bag", ".csv", ".feather", ".json", ".mcap", ".osi", ".parquet", ".txt", ".xml")
"""Endings of recordings"""


def cache_roads() -> Path:
    """Folder for roads that are made from recordings, where no other is named."""
    return cache_folder("roads")


def open(
    path: str | PathLike[str],
    roads: str | PathLike[str] | None = None,
    columns: Path | None = None,
) -> DataSet:
    """The recordings in a folder (with all that is below it) or a file.

    Formats are the modules of `recognition.recordings.formats`. Nothing is read before
    `DataSet.sources` is asked for, and no track before a source is loaded.

    Args:
        roads: folder for roads that are made from recordings (highD); `cache_roads` by default.
        columns: declaration of the columns of all tables (`recordings.formats.any_table`); None for
            those beside them.

    Raises:
        InvalidFile: there is no such folder or file.
    """
    path = Path(path)
    if not path.exists():
        raise InvalidFile("no such file or folder", path=path)
    # Roads that are made never go into the user's data.
    folder = Path(roads) if roads is not None else cache_roads()
    return DataSet(path, partial(_find, path, folder, columns))


# Each worker opens the recordings anew, by the paths that were given: sources hold functions, and
# don't go to other processes. A folder is therefore listed once in each process, not once for each
# recording; one call at a time is kept, as data sets have millions of files.


@lru_cache(maxsize=1)
def listed(paths: tuple[Path, ...], columns: Path | None = None) -> list[DataSet]:
    """The data sets in files and folders, listed once in each process."""
    return [*map(partial(open, columns=columns), paths)]


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
def by_name(paths: tuple[Path, ...], road: Path | None, columns: Path | None) -> dict[str, Source]:
    """The recordings in files and folders by name."""
    return {source.name: source for source in opened(paths, road, columns)}


def forget() -> None:
    """List files and folders again when they are asked for: they may have others by then."""
    for cached in (listed, opened, by_name):
        cached.cache_clear()


def formats() -> list[str]:
    """Return a sentence on each format of recordings that can be read, installed ones included."""
    return [" ".join(str(module.__doc__).partition("\n\n")[0].split()) for module in _modules()]


def _modules() -> list[Any]:
    by_content = packages.described(FORMATS, "BY_CONTENT")
    modules = [import_module(f"{FORMATS}.{name}") for name in by_content]
    return [*modules, *plugins.modules("xosc.dataset", taken=by_content, needs=_PARTS).values()]


def _find(path: Path, roads: Path, columns: Path | None) -> tuple[list[Source], list[Path]]:
    files = sorted(file for file in path.rglob("*") if file.is_file()) if path.is_dir() else [path]
    modules = _modules()
    # Formats that claim by name come first: contents of their files may look like others'.
    formats: list[Any] = sorted(modules, key=lambda module: bool(module.BY_CONTENT))
    if columns is not None:
        tables: Any = import_module(f"{FORMATS}.any_table")
        formats.insert(0, tables.DeclaredTables(columns))
    by_file = {file: _sources(file, formats, roads) for file in files}
    found = _told_apart([source for sources in by_file.values() for source in sources], path)
    skipped = [
        file for file, sources in by_file.items() if not sources and not _belongs(file, found)
    ]
    if not found:
        known = ", ".join(module.TITLE for module in modules)
        others = f"; skipped: {named(skipped)}" if path.is_dir() and skipped else ""
        told = f"no recording of a known format is here ({known}){others}"
        raise InvalidFile(told + _columns_hint(path), path=path)
    for source in found:
        if not source.name.isprintable():
            raise InvalidFile(
                f"the name of recording {source.name!r} has characters that can't be printed",
                path=source.path,
            )
    return found, skipped


_BESIDE = re.compile(
    r".*(_tracksMeta|_recordingMeta|meta_data)\.csv|(pedestrian_track|signal_phase)s_\d+\.csv|log_map_archive.*|"
    r"Ped_smoothed_tracks\.csv|(Veh|Ped)_tracks_meta\.csv|Traff?ic_?Lights?.*\.(csv|xlsx)|reco(r)?ding_metas\.csv|.*(?<!_tracks)\.(xodr|osm|md|rst|pdf|html|"
    r"docx?|png|jpe?g|svg|gif|mp4|avi|py|ipynb|toml|ya?ml|lock|log|sha256|md5|xosc|jsonl|sumocfg)|.*\.roles\.json|LICEN[CS]E.*|"
    r"README.*|dataset_(summary|mapping)\.pkl|CITATION.*|NOTICE.*|\..*",
    re.IGNORECASE,
)
"""Names of files that accompany recordings: maps, meta data, pictures, documents, hidden files"""
_OF_FOLDER = ("nuScenes", "Argoverse 2", "run")
"""Formats whose recordings are folders: files in them, and beside them, are theirs"""
_OF_BAG = "metadata.yaml"
"""Main file of a ROS bag that is a folder: files in it are its own"""


def _belongs(file: Path, found: Sequence[Source]) -> bool:
    """Whether a file without a recording of its own is part of another recording, or no data at
    all."""
    if _BESIDE.fullmatch(file.name):
        return True
    if any(source.path.parent in file.parents for source in found if source.path.name == _OF_BAG):
        return True
    folders = [source.path.parent for source in found if source.format in _OF_FOLDER]
    return any(folder in file.parents or file.parent == folder.parent for folder in folders)


_NAMED = 3


def named(files: Sequence[Path]) -> str:
    """Names of some files and the number of all by ending."""
    counts = Counter(file.suffix or "no ending" for file in files)
    listed = ", ".join(file.name for file in files[:_NAMED]) + (
        ", …" if len(files) > _NAMED else ""
    )
    return (
        f"{listed} ({', '.join(f'{count} {ending}' for ending, count in sorted(counts.items()))})"
    )


def _sources(file: Path, formats: Sequence[Any], roads: Path) -> list[Source]:
    """The recordings in a file. One that can't be read may be a recording or not: a source that
    says so when it is loaded."""
    try:
        current().admit(file)
        if file.suffix.lower() in _SUFFIXES and file.stat().st_size <= LONGEST_POINTER:
            read_bytes(
                file
            )  # a pointer of Git LFS, which no format claims, may be in the place of a recording
        form = next((form for form in formats if form.claims(file)), None)
        return form.sources(file, roads) if form is not None else []
    except InvalidFile as error:
        return [Source(file.name, file.stem, "", file, partial(_fail, error))]


def _fail(error: InvalidFile) -> NoReturn:
    raise error


def _told_apart(sources: list[Source], folder: Path) -> list[Source]:
    """The sources, with names that several have led by the place of their files in the folder."""
    # By the place below the folder that was given: names stay when the whole folder is moved.
    counts = Counter(source.name for source in sources)

    def renamed(source: Source) -> Source:
        return replace(source, name=f"{source.path.relative_to(folder).as_posix()}/{source.name}")

    return [renamed(source) if counts[source.name] > 1 else source for source in sources]
