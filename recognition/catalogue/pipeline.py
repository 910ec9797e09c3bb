"""From recordings to a catalogue: read, recognise, write."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from recognition import datasets
from recognition.catalogue import usable
from recognition.catalogue.episodes import Around, of_findings, of_vehicles
from recognition.catalogue.recognisers import findings
from recognition.catalogue.recognisers.findings import Moment, by_rules
from recognition.catalogue.shelf import Shelf
from recognition.catalogue.writing.catalogue import Catalogue, CatalogueConfig
from recognition.catalogue.writing.index import recordings_of
from recognition.datasets import Source, cache_roads
from recognition.labels import Event, Rules, label
from recognition.sites import Site, site_of
from runner.recording import Recording
from schemas.errors import InvalidFile, ToolchainError, Unsupported, UsageError

SHIPPED = Path(__file__).resolve().parents[1] / "models" / "cpu"
"""The model that comes with the package"""
EVENTS, VEHICLES = "events", "vehicles"


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


class Recogniser(Protocol):
    """Labels moments of recordings: it looks at all of them, then gives the moments of each."""

    @property
    def sorted_by(self) -> str:
        """Whose labels sort the moments: `RULES` or `MODEL`."""
        ...

    def look(self, name: str, recording: Recording, site: Site, events: list[Event]) -> None:
        """Take in a recording and the events that rules have found in it."""
        ...

    def moments(self, name: str) -> list[Moment]:
        """The moments of a recording that was looked at."""
        ...


class ByRules:
    """The rules alone."""

    sorted_by = findings.RULES

    def __init__(self) -> None:
        self._events: dict[str, list[Event]] = {}

    def look(self, name: str, recording: Recording, site: Site, events: list[Event]) -> None:
        """Keep the events."""
        self._events[name] = events

    def moments(self, name: str) -> list[Moment]:
        """One for each event."""
        return [by_rules(event) for event in self._events[name]]


class Summary(NamedTuple):
    """What became of recordings.

    classes: scenarios by title of the class. passages: vehicles' scenes by how they pass. exclusions: vehicles without a scene.
    colliding: scenarios in which the ego touches another one from the start, as recorded.
    edited: files that a person has edited, left alone. removed: files of earlier runs that are no longer part of the catalogue.
    failures: recordings that could not be read, and why.
    """

    classes: Counter[str]
    passages: Counter[str]
    exclusions: list[dict[str, Any]]
    colliding: list[str]
    edited: list[str]
    removed: list[str]
    failures: dict[str, ToolchainError]


Progress = Callable[[Sequence[Source], str], Iterable[Source]]
"""Goes through sources while showing how far it is, under a word for what is being done"""


def build(paths: Sequence[Path], out: Path, settings: CatalogueSettings, recogniser: Recogniser, progress: Progress) -> Summary:
    """Make a catalogue of the recordings in files and folders.

    A recording that can't be read does not keep the others from their place in the catalogue.

    Raises:
        InvalidFile: there is no recording of a known format in a path.
        UsageError: the folder can't be written or has the catalogue of other recordings, or two recordings have one name.
    """
    sources = [source for path in paths for source in datasets.open(path).sources]
    _refuse_twins(sources)
    _refuse_others(out, {source.name for source in sources})
    with Shelf() as shelf:
        work = _Work(settings, recogniser, Catalogue(out, settings.config, recogniser.sorted_by), shelf)
        for source in progress(sources, "recognising"):
            work.try_to(work.look, source)
        for source in progress([source for source in sources if source.name not in work.failures], "writing"):
            work.try_to(work.write, source)
        return work.close()


def _refuse_twins(sources: Sequence[Source]) -> None:
    """Recordings are distinguished by name; those below one folder get names that differ."""
    first: dict[str, Source] = {}
    for source in sources:
        other = first.setdefault(source.name, source)
        if other is not source:
            message = f"{other.path} has a recording called {source.name!r} too: give each once, in one folder that holds both"
            raise UsageError(message, path=source.path)


def _refuse_others(out: Path, names: set[str]) -> None:
    """A catalogue is made of all its recordings at once: what is not among them would go."""
    others = sorted(set(recordings_of(out)) - names)
    if others:
        listed = f"{others[0]!r}" + (f" and {len(others) - 1} more" if len(others) > 1 else "")
        raise UsageError(
            f"this folder has a catalogue of other recordings ({listed}): give them as well, or another folder", path=out
        )


def look(source: Source, recogniser: Recogniser, rules: Rules) -> tuple[Recording, Site]:
    """Read a recording, label it by the rules, and have a recogniser look at it; the recording, placed on roads, and its site.

    Raises:
        InvalidFile, Unsupported, UsageError: it can't be read, or its roads are unknown or unsound.
    """
    recording = source.load()
    site = site_of(source, recording, cache_roads())
    recogniser.look(source.name, recording, site, label(recording, site, source.name, rules))
    return recording, site


class _Work:
    """One catalogue in the making."""

    def __init__(self, settings: CatalogueSettings, recogniser: Recogniser, catalogue: Catalogue, shelf: Shelf) -> None:
        self.failures: dict[str, ToolchainError] = {}
        self._settings, self._recogniser, self._catalogue = settings, recogniser, catalogue
        self._shelf, self._sites = shelf, dict[str, Site]()

    def try_to(self, do: Callable[[Source], None], source: Source) -> None:
        """Do something with a source; what is wrong with it is kept for the end."""
        try:
            do(source)
        except (InvalidFile, Unsupported, UsageError) as error:
            error.path = error.path or str(source.path)
            self.failures[source.name] = error

    def look(self, source: Source) -> None:
        """Read and label a recording."""
        recording, self._sites[source.name] = look(source, self._recogniser, self._settings.rules)
        self._shelf.put(source.name, recording)

    def write(self, source: Source) -> None:
        """Write the scenarios of a recording."""
        settings, site = self._settings, self._sites[source.name]
        recording = self._shelf.take(source.name)
        self._catalogue.tell(source)
        found = findings.joined(self._recogniser.moments(source.name), settings.gap)
        if settings.scenes == EVENTS:
            self._catalogue.add(source, recording, site, of_findings(source.name, found, settings.around), [])
            return
        names, exclusions = usable.vehicles(recording, site.network, settings.needs)
        episodes = of_vehicles(source.name, [recording.tracks[name] for name in names], found)
        self._catalogue.add(source, recording, site, episodes, exclusions)

    def close(self) -> Summary:
        """Finish the catalogue."""
        catalogue = self._catalogue
        rows = catalogue.rows
        removed = catalogue.close(failures={name: str(error) for name, error in self.failures.items()})
        return Summary(
            Counter(row["class"] for row in rows),
            Counter(row["passage"] for row in rows if row["passage"]),
            catalogue.exclusions,
            [row["file"] for row in rows if row["collision_time"] == 0.0],
            catalogue.store.edited,
            removed,
            self.failures,
        )
