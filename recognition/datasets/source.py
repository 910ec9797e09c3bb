"""What a data set consists of: sources, each read into one `Recording` when it is asked for, and what reading found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from runner.recording import Recording
from schemas.errors import InvalidFile


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


class Gap(NamedTuple):
    """Frames that a track lacks between two rows that it has (at `start` and `end`, s)."""

    track: str
    start: float
    end: float
    missing: int


class Cut(NamedTuple):
    """Where a track was cut in two: it jumped by `distance` (m), or has no rows (distance 0), between two times (s).

    rest: name of the track that goes on; None where too little of it is left.
    """

    track: str
    start: float
    end: float
    distance: float
    rest: str | None


class Exclusion(NamedTuple):
    """Something of a source that is not in its recording: a track or an element, how many rows of it, and why."""

    what: str
    rows: int
    reason: str


@dataclass
class Report:
    """What reading a source found.

    Attributes:
        rows, tracks: how many the recording has.
        gaps: frames missing inside tracks; nothing is put in their place.
        cuts: where tracks were cut, because they jump or are not recorded for long.
        exclusions: what was left out.
        remarks: what was assumed, derived or corrected, one sentence each.
    """

    rows: int = 0
    tracks: int = 0
    gaps: list[Gap] = field(default_factory=list)
    cuts: list[Cut] = field(default_factory=list)
    exclusions: list[Exclusion] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)

    def add(self, other: Report) -> None:
        """Take in what was found in another file of the same recording."""
        self.rows += other.rows
        self.tracks += other.tracks
        self.gaps += other.gaps
        self.cuts += other.cuts
        self.exclusions += other.exclusions
        self.remarks += (remark for remark in other.remarks if remark not in self.remarks)

    @property
    def missing(self) -> int:
        """Frames missing inside tracks."""
        return sum(gap.missing for gap in self.gaps)

    @property
    def excluded(self) -> int:
        """Rows that were left out."""
        return sum(exclusion.rows for exclusion in self.exclusions)


@dataclass(eq=False)
class Source:
    """One recording of a data set, not read yet.

    Args:
        name: unique in its data set; splits into training and test data go by it.
        site: where it was recorded; sources of one site share a map.
        format: name of the format; empty where the file can't be read far enough to tell.
        path: its main file.
        read: reads it.
        road: makes the site's road in a folder, from the recording and what the data set has instead of OpenDRIVE; None where it
            has nothing.
        map: the site's map, as the data set has it (Lanelet2, CommonRoad); None without one, or where the
            recording brings its road network with it.
        origin: latitude and longitude (degrees) of the origin of the coordinates, where the data set has them.
    """

    name: str
    site: str
    format: str
    path: Path
    read: Callable[[], tuple[Recording, Report]] = field(repr=False)
    map: Path | None = None
    origin: tuple[float, float] | None = None
    road: Callable[[Recording, Path], SiteRoad] | None = field(default=None, repr=False)
    report: Report | None = field(default=None, init=False, repr=False)
    """what the last reading found; None before"""

    def load(self) -> Recording:
        """Read the recording, afresh each time, and renew `report`.

        Raises:
            InvalidFile: a file is malformed; names file, line and column.
            Unsupported: it holds something that is not supported.
        """
        try:
            recording, self.report = self.read()
        except InvalidFile as error:
            error.path = error.path or str(self.path)
            raise
        return recording


@dataclass(eq=False)
class DataSet:
    """A folder or file with recordings; `sources` lists them without reading their tracks."""

    path: Path
    find: Callable[[], list[Source]] = field(repr=False)

    @cached_property
    def sources(self) -> list[Source]:
        """The recordings, in the order of their files.

        Raises:
            InvalidFile: no recording of a known format is there, or the name of one can't be printed. A table or index that can't
                be read, so that it may be a recording or not, is a source that says so when it is loaded.
        """
        return self.find()
