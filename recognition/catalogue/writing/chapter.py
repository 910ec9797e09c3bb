"""The scenarios of one recording in a catalogue, and the OpenSCENARIO catalogues that they refer to, class by class."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple

from recognition.catalogue.episodes import Episode, plain
from recognition.catalogue.scenes import replay
from recognition.catalogue.scenes.entities import entry
from recognition.catalogue.scenes.scenes import EGO, Part, Scene, SceneCutter, Scope
from recognition.catalogue.writing import annotation
from recognition.catalogue.writing.store import Store
from recognition.datasets import Source
from recognition.maneuvers.events import Maneuvers, Span
from recognition.maneuvers.scenario import document as variation
from recognition.maneuvers.scenario.document import CONTROLLER
from recognition.maneuvers.scenario.start import paths
from recognition.sites import Site
from runner.recording import Recording, Track
from schemas.errors import Unsupported
from xosc import maneuvers, tags
from xosc.document import to_bytes
from xosc.files import Header
from xosc.versions import Version

AUTHOR = "xosc-recognize"
DATE = datetime(2000, 1, 1)
"""Date in every file: the recordings tell none, and the same catalogue has to have the same bytes."""

_FOLDERS = {
    "Vehicle": "vehicles",
    "Pedestrian": "pedestrians",
    "MiscObject": "objects",
    "Controller": "controllers",
    "Maneuver": "maneuvers",
    "Trajectory": "trajectories",
    "Route": "routes",
}
_PROPERTIES = (1, 2)
"""First version of the standard with Properties in the FileHeader"""


@dataclass(frozen=True)
class CatalogueConfig:
    """How a catalogue is written.

    Attributes:
        scope: what belongs to a scene.
        version: of OpenSCENARIO.
    """

    scope: Scope = field(default_factory=Scope)
    version: Version = (1, 3)


class Place(NamedTuple):
    """Where the entries of a catalogue go: the class's folder, the kind, and what distinguishes catalogues of that kind."""

    folder: str
    kind: str
    part: str

    @property
    def directory(self) -> str:
        """Relative to the class's folder."""
        return "/".join(filter(None, ("catalogs", _FOLDERS[self.kind], self.part)))


class _Entry(NamedTuple):
    """An entry of a catalogue, as scenariogeneration has it."""

    place: Place
    name: str
    built: Any


Entries = dict[Place, dict[str, Any]]
"""Entries of OpenSCENARIO catalogues by their names, for each catalogue; as scenariogeneration has them"""


class Written(NamedTuple):
    """What writing the scenarios of a recording left to be done for the whole catalogue.

    rows: of the index. entries: of OpenSCENARIO catalogues that other recordings have entries of, too.
    files: digests of the files written, by name. edited: files that a person has edited, left alone.
    """

    rows: list[dict[str, Any]]
    entries: Entries
    files: dict[str, str]
    edited: list[str]


class Material:
    """A recording, which has its road coordinates, ready for scenes and manoeuvres to be taken from it.

    Attributes:
        source, site: where it is from.
        scenes: cuts scenes.
        maneuvers: measures manoeuvres.
    """

    def __init__(self, source: Source, recording: Recording, site: Site, scope: Scope) -> None:
        self.source, self.site = source, site
        self.scenes, self.maneuvers = SceneCutter(recording, scope), Maneuvers(recording, site)


class Chapter:
    """Scenarios of recordings, being written into the folder of a catalogue.

    Args:
        root: the folder.
        sorted_by: whose labels decide the class of a scenario, and thereby its folder.

    Raises:
        UsageError: it can't be written.
    """

    def __init__(self, root: Path, config: CatalogueConfig, sorted_by: str) -> None:
        self._store = Store(root)
        self._rows: list[dict[str, Any]] = []
        self._config, self._sorted_by = config, sorted_by
        self._entries: Entries = {}

    def add(self, material: Material, road: str, episodes: Iterable[Episode]) -> None:
        """Write the scenarios of a recording on the catalogue's road file of this name."""
        for episode in episodes:
            scene = material.scenes.cut(episode.ego, episode.start, episode.end)
            self._write(_Context(material, road, episode, scene))
            for place in sorted(place for place in self._entries if place.kind == "Trajectory"):  # of this scenario alone
                write_catalog(self._store, place, self._entries.pop(place), self._config.version)

    @property
    def written(self) -> Written:
        """What has been written so far."""
        return Written(self._rows, self._entries, self._store.written, self._store.edited)

    def _enter(self, entries: Iterable[_Entry]) -> None:
        for each in entries:
            self._entries.setdefault(each.place, {}).setdefault(each.name, each.built)

    def _write(self, context: _Context) -> None:
        episode, scene = context.episode, context.scene
        facts = _facts(context, self._sorted_by)
        tagged = annotation.tags(episode.name, episode.title, scene, facts)
        described = f"{episode.title}: {scene.ego.track.category} {episode.ego} of {context.material.source.name}"
        properties = tags.properties(tagged) if self._config.version >= _PROPERTIES else {}
        header = Header(f"{described}, {scene.start:.2f} s to {scene.end:.2f} s", AUTHOR, DATE, properties)
        row = facts | {
            "file": self._put(episode, ".xosc", self._replay(context, header)),
            "maneuver": None,
            "no_maneuver": None,
            "road": context.road,
        }
        try:
            row["maneuver"] = self._put(episode, "_maneuver.xosc", self._variation(context, header))
        except Unsupported as reason:
            row["no_maneuver"] = reason.message
        row["openlabel"] = self._put(episode, ".openlabel.json", tags.to_bytes(tagged, f"{episode.name}.xosc", AUTHOR))
        self._rows.append(row)

    def _put(self, episode: Episode, ending: str, content: bytes) -> str:
        """Write a file of an episode; its name in the catalogue."""
        name = f"{episode.folder}/{episode.name}{ending}"
        self._store.write(name, content)
        return name

    def _replay(self, context: _Context, header: Header) -> bytes:
        episode, scene = context.episode, context.scene
        participants = {part.name: entry(part.track) for part in scene.parts}
        entries = [context.entry(each.kind, each.name, each.built, context.recorded) for each in participants.values()]
        entries += [context.entry("Trajectory", path.name, path, episode.name) for path in replay.trajectories(scene)]
        self._enter(entries)
        path = self._store.root / episode.folder / f"{episode.name}.xosc"
        road, catalogs, version = f"../{context.road}", _directories(entries), self._config.version
        return replay.scenario(path, header, scene, road=road, entries=participants, catalogs=catalogs, version=version)

    def _variation(self, context: _Context, header: Header) -> bytes:
        episode, network, finding = context.episode, context.material.site.network, context.episode.finding
        if finding is None or episode.passage is not None:
            raise Unsupported("this is the scene of a whole vehicle, not of one manoeuvre")
        partner, span = finding.moment.partner, Span(finding.start, finding.moment.time, finding.end)
        measured = context.material.maneuvers.of(episode.label, episode.ego, partner, span)
        participants = [entry(track) for track in (measured.ego, measured.other) if track is not None]
        entries = [context.entry(each.kind, each.name, each.built, context.recorded) for each in participants]
        other = context.name_of(measured.other)
        built, followed = variation.catalogue_entries(measured), paths(measured, network, episode.name, other)
        entries += [context.entry("Maneuver", each.name, each) for each in built]
        entries += [context.entry("Controller", CONTROLLER.name, CONTROLLER)]
        entries += [context.entry("Route", route.name, route, context.recorded) for route in followed.routes.values()]
        entries += [context.entry("Trajectory", path.name, path, episode.name) for path in followed.trajectories.values()]
        path = self._store.root / episode.folder / f"{episode.name}_maneuver.xosc"
        stage = variation.Stage(path, f"../{context.road}", _directories(entries))
        document = variation.scenario(stage, header, measured, network, other, followed, self._config.version)
        self._enter(entries)
        return to_bytes(document)


def write_catalog(store: Store, place: Place, entries: dict[str, Any], version: Version) -> None:
    """Write an OpenSCENARIO catalogue with entries in the order of their names."""
    name = f"{place.folder}/{place.directory}/{_FOLDERS[place.kind]}.xosc"
    header = Header(f"{place.kind} catalogue of {place.folder}", AUTHOR, DATE)
    ordered = [entries[key] for key in sorted(entries)]
    if place.kind == "Trajectory":
        content = maneuvers.trajectory_catalog(header, ordered, version)
    else:
        content = to_bytes(maneuvers.catalog(store.root / name, header, f"{place.kind}Catalog", ordered, version))
    store.write(name, content)


def _directories(entries: Iterable[_Entry]) -> dict[str, str]:
    """The folders of catalogues by their kind, relative to the scenario."""
    return {place.kind: place.directory for place in dict.fromkeys(each.place for each in entries)}


class _Context(NamedTuple):
    """A scenario being written, and where it comes from."""

    material: Material
    road: str
    episode: Episode
    scene: Scene

    @property
    def recorded(self) -> str:
        """What distinguishes catalogues of this recording."""
        return plain(self.material.source.name)

    def entry(self, kind: str, name: str, built: Any, part: str = "") -> _Entry:
        """An entry of a catalogue of the scenario's class."""
        return _Entry(Place(self.episode.folder, kind, part), name, built)

    def name_of(self, track: Track | None) -> str:
        """Name in the scenario of a track that takes part in it."""
        parts: tuple[Part, ...] = self.scene.parts
        return next((part.name for part in parts if part.track is track and part.name != EGO), "Other")


def _facts(context: _Context, sorted_by: str) -> dict[str, Any]:
    """The scenario's row of the index, but for its files."""
    source, episode, scene = context.material.source, context.episode, context.scene
    moment = episode.finding.moment if episode.finding is not None else None
    rule = moment.rule.title if moment is not None and moment.rule else None
    measured = {name: None if value is None else round(value, 3) for name, value in annotation.measures(scene).items()}
    return {
        "class": episode.title,
        "state": episode.state,
        "sorted_by": sorted_by,
        "confidence": moment.confidence if moment is not None else None,
        "rule_class": rule,
        "model_class": moment.model if moment is not None else None,
        "nearest_class": moment.nearest if moment is not None else None,
        "labels_agree": moment.labels_agree if moment is not None else None,
        "passage": episode.passage,
        "data_set": source.format,
        "site": source.site,
        "recording": source.name,
        "vehicle": episode.ego,
        "partner": moment.partner if moment is not None else None,
        "time": round(moment.time, 3) if moment is not None else None,
        "start": round(scene.start, 3),
        "end": round(scene.end, 3),
        "participants": len(scene.parts),
        "tags": dict(sorted(moment.tags.items())) if moment is not None else {},
        **measured,
    }
