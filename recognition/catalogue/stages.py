"""The stages of a recording on its way into a catalogue.

1. read: the recording, smoothed, on the roads of its site (`read`).
2. label: the events that the rules find in it (`read`).
3. recognise: moments, labelled by rules and model, joined into findings (a `Recogniser`, in the order of the recordings).
4. plan: an episode for each finding or vehicle (`episodes`).
5. write: the scene of each episode and its scenario (`write`), some episodes at a time, so that several processes share a long
   recording.

Between 2 and 5 a recording lies on the shelf. What is done for one recording needs no other one, but for 3: a model learns as it
goes on.
"""

from __future__ import annotations

import gc
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from recognition import datasets
from recognition.catalogue import usable
from recognition.catalogue.episodes import Around, Episode, of_findings, of_vehicles
from recognition.catalogue.recognisers import findings
from recognition.catalogue.recognisers.findings import Moment
from recognition.catalogue.scenes.scenes import Scope
from recognition.catalogue.shelf import Shelf, loaded
from recognition.catalogue.usable import Vehicle
from recognition.catalogue.writing.chapter import CatalogueConfig, Chapter, Material, Written
from recognition.datasets import Exclusion, Report, Source, cache_roads
from recognition.labels import Event, Rules, label
from recognition.sites import Roles, Site, site_of
from runner.recording import Recording
from schemas.errors import InvalidFile, ToolchainError, Unsupported, UsageError

EVENTS, VEHICLES = "events", "vehicles"
_REFUSALS = (InvalidFile, Unsupported, UsageError)
_LONG = 200
"""Participants of a recording that takes so long to write that it is worth a search for garbage, in all that is loaded"""


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


class Ground(NamedTuple):
    """A recording that has been read, and what it is on."""

    place: Place
    road: Path
    roles: Roles

    @property
    def site(self) -> Site:
        """Its site."""
        return Site(self.road, loaded(self.road), self.roles)


class Seen(NamedTuple):
    """What reading and labelling a recording gave, but the recording itself.

    egos, exclusions: the vehicles that are egos of scenes of vehicles, and those that are not.
    """

    ground: Ground
    report: Report
    events: list[Event]
    egos: list[Vehicle]
    exclusions: list[Exclusion]


class Block(NamedTuple):
    """Episodes of a recording to be written, and the name of its road in the catalogue."""

    ground: Ground
    road: str
    episodes: Sequence[Episode]


class Done(NamedTuple):
    """What has been written of a recording, and what went wrong."""

    written: Written
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


def read(settings: CatalogueSettings, place: Place) -> Seen | ToolchainError:
    """Read a recording, unless it is on the shelf already, put it there, and label it; or what is wrong with it."""
    source, shelf = place.source, Shelf(place.shelf)
    try:
        if shelf.has(source):
            recording, report = shelf.get(source)
            site = site_of(source, recording, cache_roads())
            events = label(recording, site, source.name, settings.rules)
        else:
            recording, site, events = looked(source, settings.rules)
            assert source.report is not None, "the recording has been read"
            report = source.report
            shelf.put(source, recording, report)
    except _REFUSALS as error:
        return _of(source, error)
    egos, exclusions = usable.vehicles(recording, site.network, settings.needs) if settings.scenes == VEHICLES else ([], [])
    return Seen(Ground(place, site.path, site.roles), report, events, egos, exclusions)


def episodes(settings: CatalogueSettings, seen: Seen, moments: Iterable[Moment]) -> list[Episode]:
    """What scenarios are made of a recording."""
    name, found = seen.ground.place.name, findings.joined(moments, settings.gap)
    return of_findings(name, found, settings.around) if settings.scenes == EVENTS else of_vehicles(name, seen.egos, found)


def write(out: Path, settings: CatalogueSettings, sorted_by: str, block: Block) -> Done:
    """Write scenarios of a recording into the folder of a catalogue."""
    chapter = Chapter(out, settings.config, sorted_by)
    try:
        chapter.add(_material(block.ground, settings.config.scope), block.road, block.episodes)
    except _REFUSALS as error:
        return Done(chapter.written, _of(block.ground.place.source, error))
    return Done(chapter.written, None)


@lru_cache(maxsize=1)
def recorded(place: Place) -> Recording:
    """A recording from the shelf, which is kept for its next stages, also in processes that are forked from this one."""
    return Shelf(place.shelf).get(place.source).recording


@lru_cache(maxsize=1)
def _material(ground: Ground, scope: Scope) -> Material:
    """What is taken from a recording, which is kept for its other blocks."""
    recording = recorded(ground.place)
    material = Material(ground.place.source, recording, ground.site, scope)
    if len(recording.tracks) >= _LONG:
        gc.unfreeze()
        gc.collect()
        gc.freeze()  # until the next such recording no garbage is sought in it, nor in the roads
    return material


def forget() -> None:
    """Keep nothing of what was opened: other files may have the same names."""
    opened.cache_clear()
    recorded.cache_clear()
    _material.cache_clear()


def _of(source: Source, error: ToolchainError) -> ToolchainError:
    """An error that names the source where it names no file."""
    error.path = error.path or str(source.path)
    return error
