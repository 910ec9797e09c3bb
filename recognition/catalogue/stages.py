"""The stages of a recording on its way into a catalogue.

1. read: the recording, smoothed, on the roads of its site (`read`).
2. label: the events that the rules find in it (`read`).
3. recognise: moments, labelled by rules and model, joined into findings (a `Recogniser`, in the order of the recordings).
4. cut: an episode for each finding or vehicle, and the scene of it (`write`).
5. write: the scenario of each scene (`write`).

Between 2 and 4 a recording lies on the shelf. What is done for one recording needs no other one, but for 3: a model learns as it
goes on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from recognition import datasets
from recognition.catalogue import usable
from recognition.catalogue.episodes import Around, of_findings, of_vehicles
from recognition.catalogue.recognisers import findings
from recognition.catalogue.recognisers.findings import Moment
from recognition.catalogue.shelf import Shelf, loaded
from recognition.catalogue.writing.chapter import CatalogueConfig, Chapter, Written
from recognition.datasets import Exclusion, Report, Source, cache_roads
from recognition.labels import Event, Rules, label
from recognition.sites import Roles, Site, site_of
from runner.recording import Recording
from schemas.errors import InvalidFile, ToolchainError, Unsupported, UsageError

EVENTS, VEHICLES = "events", "vehicles"
_REFUSALS = (InvalidFile, Unsupported, UsageError)


@dataclass(frozen=True)
class CatalogueSettings:
    """What is recognised and written.

    Attributes:
        scenes: what a scenario is made for: every event, or every usable vehicle.
        rules: thresholds of the labelling rules.
        needs: what makes a vehicle usable.
        around: time before and after an event that belongs to its scenario.
        gap: greatest time between two windows of one event, s.
        config: how the catalogue is written.
    """

    scenes: str = EVENTS
    rules: Rules = field(default_factory=Rules)
    needs: usable.Usable = field(default_factory=usable.Usable)
    around: Around = field(default_factory=Around)
    gap: float = 1.0
    config: CatalogueConfig = field(default_factory=CatalogueConfig)


class Place(NamedTuple):
    """Where a recording is: the paths that its data set was opened by, its name there, and the folder of the shelf."""

    paths: tuple[Path, ...]
    name: str
    shelf: Path

    @property
    def source(self) -> Source:
        """Its source."""
        return next(source for source in opened(self.paths) if source.name == self.name)


class Seen(NamedTuple):
    """What reading and labelling a recording gave, but the recording itself."""

    report: Report
    road: Path
    roles: Roles
    events: list[Event]

    def site(self) -> Site:
        """Its site."""
        return Site(self.road, loaded(self.road), self.roles)


class Told(NamedTuple):
    """A recording to be written: what was seen of it, its moments, and the name of its road in the catalogue."""

    place: Place
    seen: Seen
    moments: list[Moment]
    road: str


class Done(NamedTuple):
    """What became of a recording: what has been written of it, vehicles that are no egos, and what went wrong."""

    written: Written
    exclusions: Sequence[Exclusion]
    error: ToolchainError | None


@lru_cache(maxsize=1)
def opened(paths: tuple[Path, ...]) -> list[Source]:
    """The recordings in files and folders, listed once in each process."""
    return [source for path in paths for source in datasets.open(path).sources]


def looked(source: Source, rules: Rules) -> tuple[Recording, Site, list[Event]]:
    """A recording, placed on the roads of its site, and the events that rules find in it.

    Raises:
        InvalidFile, Unsupported, UsageError: it can't be read, or its roads are unknown or unsound.
    """
    recording = source.load()
    site = site_of(source, recording, cache_roads())
    return recording, site, label(recording, site, source.name, rules)


def read(rules: Rules, place: Place) -> Seen | ToolchainError:
    """Read a recording, unless it is on the shelf already, put it there, and label it; or what is wrong with it."""
    source, shelf = place.source, Shelf(place.shelf)
    try:
        if shelf.has(source):
            recording, report = shelf.get(source)
            site = site_of(source, recording, cache_roads())
            return Seen(report, site.path, site.roles, label(recording, site, source.name, rules))
        recording, site, events = looked(source, rules)
        assert source.report is not None, "the recording has been read"
        shelf.put(source, recording, source.report)
    except _REFUSALS as error:
        return _of(source, error)
    return Seen(source.report, site.path, site.roles, events)


def write(out: Path, settings: CatalogueSettings, sorted_by: str, told: Told) -> Done:
    """Write the scenarios of a recording into the folder of a catalogue."""
    source, site = told.place.source, told.seen.site()
    chapter = Chapter(out, settings.config, sorted_by)
    exclusions: list[Exclusion] = []
    try:
        recording = Shelf(told.place.shelf).get(source).recording
        found = findings.joined(told.moments, settings.gap)
        if settings.scenes == EVENTS:
            episodes = of_findings(source.name, found, settings.around)
        else:
            names, exclusions = usable.vehicles(recording, site.network, settings.needs)
            episodes = of_vehicles(source.name, [recording.tracks[name] for name in names], found)
        chapter.add(source, recording, site, told.road, episodes)
    except _REFUSALS as error:
        return Done(chapter.written, exclusions, _of(source, error))
    return Done(chapter.written, exclusions, None)


def _of(source: Source, error: ToolchainError) -> ToolchainError:
    """An error that names the source where it names no file."""
    error.path = error.path or str(source.path)
    return error
