"""Scenarios of a catalogue: replay and variation files of each scene, with tags and measures."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from recognition.catalogue.detect import Detection, Episode, plain
from recognition.catalogue.writing import replay, storyboard
from recognition.catalogue.writing.page import Film, film
from recognition.catalogue.writing.played import Trial
from recognition.catalogue.writing.replay import entry
from recognition.catalogue.writing.store import Store
from recognition.catalogue.writing.storyboard import CONTROLLER, paths
from recognition.labels.classes import Label
from recognition.labels.maneuvers.events import Maneuvers
from recognition.labels.maneuvers.maneuver import Span
from recognition.recordings import Source
from recognition.recordings.conditions import OddConditions
from recognition.scenes import Site
from recognition.scenes.cut import EGO, Excerpt, Part, SceneCutter, Scope
from recognition.scenes.roles import ROLES
from runner.judging.measures.criticality import criticality
from runner.judging.measures.measure import Series, measures
from runner.judging.measures.relations import MotionRows, relations
from runner.recording import Recording, Track
from schemas.common.array_types import FloatArray
from schemas.common.errors import Unsupported
from xosc.document import to_bytes
from xosc.writing import maneuvers
from xosc.writing import tags as xosc_tags
from xosc.writing.files import FileHeader
from xosc.writing.tags import ASAM, Tag
from xosc.writing.versions import Version

_JUNCTION, _RING, _MOTORWAY = "JunctionIntersection", "JunctionRoundabout", "RoadTypeMotorway"
_CLASSES: dict[str, tuple[str, ...]] = {
    Label.FREE_CRUISE.title: ("MotionDrive", _MOTORWAY),
    Label.CAR_FOLLOWING.title: ("MotionDrive", _MOTORWAY),
    Label.CUT_IN.title: ("MotionCutIn", _MOTORWAY),
    Label.CUT_OUT.title: ("MotionCutOut", _MOTORWAY),
    Label.LANE_CHANGE_LEFT.title: ("MotionLaneChangeLeft",),
    Label.LANE_CHANGE_RIGHT.title: ("MotionLaneChangeRight",),
    Label.RAMP_ENTERING.title: ("MotionDrive", _MOTORWAY),
    Label.RAMP_EXITING.title: ("MotionDrive", _MOTORWAY),
    Label.URBAN_CUT_IN.title: ("MotionCutIn",),
    Label.URBAN_CUT_OUT.title: ("MotionCutOut",),
    Label.ROUNDABOUT_ENTERING.title: ("MotionDrive", _RING),
    Label.ROUNDABOUT_EXITING.title: ("MotionDrive", _RING),
    Label.ROUNDABOUT_CIRCULATING.title: ("MotionDrive", _RING),
    Label.LEFT_TURN.title: ("MotionTurnLeft", _JUNCTION),
    Label.RIGHT_TURN.title: ("MotionTurnRight", _JUNCTION),
    Label.STRAIGHT_CROSS.title: ("MotionDrive", _JUNCTION),
    Label.MERGING.title: ("MotionDrive", _JUNCTION),
}
"""Tags of OpenLABEL's ontology for a class, by its title"""
_PARTICIPANTS = {
    "car": "VehicleCar",
    "van": "VehicleVan",
    "truck": "VehicleTruck",
    "bus": "VehicleBus",
    "motorbike": "VehicleMotorcycle",
    "bicycle": "VehicleCycle",
    "pedestrian": "HumanPedestrian",
}


def criticality_of(scene: Excerpt) -> dict[str, float | None]:
    """The ego's extremes of criticality in the recorded scene, by name
    (`runner.judging.measures.measure`).

    `collision_time` is when its box first touches another one, s from the scene's start: recorded
    sizes can be wrong.
    """
    ego, *others = (_motion(part, scene) for part in scene.parts)
    found = criticality(ego, others)
    extremes = {
        name: value["value"] if isinstance(value, dict) else value
        for name, value in found.summary.items()
    }
    return extremes | {
        # A scenario begins at 0, whatever the clock of its recording says then.
        "collision_time": found.impact.time - scene.start if found.impact is not None else None
    }


def _motion(part: Part, scene: Excerpt) -> MotionRows:
    """A participant within the scene."""
    moving = replace(_cut(part.track, scene.start, scene.end), name=part.name)
    return replace(moving, kind=part.track.kind, category=part.track.category, mass=part.track.mass)


def tags(
    name: str, title: str, scene: Excerpt, facts: Mapping[str, Any], conditions: OddConditions
) -> list[Tag]:
    """The tags of a scenario.

    Args:
        name: of the scenario.
        title: of its class.
        facts: what else is known, by the names of the index's columns; None is left out.
        conditions: of the recording.
    """
    named = {**facts, **{f"rule_{key}": value for key, value in facts["tags"].items()}}
    # Absent values get no tag: readers would take a word for one as a value.
    own = [
        Tag(_type(key), value)
        for key, value in named.items()
        if value is not None and key != "tags"
    ]
    asam = ontology_tags(title, {part.track.category for part in scene.parts})
    asam += [Tag(kind, None, ASAM) for kind in conditions.classes()]
    if facts["ego_speed"] is not None:
        # A whole number of km/h is all that the class takes.
        asam.append(Tag("SubjectVehicleSpeed", round(3.6 * abs(facts["ego_speed"])), ASAM))
    return [*asam, Tag("scenarioName", name, ASAM), Tag("Ego", EGO), *own]


def ontology_tags(title: str, categories: Iterable[str]) -> list[Tag]:
    """Return the tags of OpenLABEL's ontology for a class, by its title, and for categories of
    participants."""
    participants = sorted(
        _PARTICIPANTS[category] for category in set(categories) & _PARTICIPANTS.keys()
    )
    return [
        Tag(kind, None, ASAM) for kind in (*_CLASSES.get(title, ("MotionDrive",)), *participants)
    ]


def _type(name: str) -> str:
    """Name of a column as that of a tag."""
    known = measures().get(name)
    return (known.tag if known else "") or "".join(
        word[:1].upper() + word[1:] for word in name.split("_")
    )


PAIR = (
    "road_kind", "limit", "light", "ego_speed", "partner_speed", "closing_speed", "gap",
    "pair_thw", "pair_ttc", "pair_drac", "pair_touches",
)  # fmt: skip
"""Columns of the index about the ego and its partner at the event's time and within it"""
_MOST_DRAC = 20.0
"""Greatest DRAC that is a measurement, m/s²: beyond twice what tyres transmit, the gap is within
the error of recorded boxes"""
AUTHOR = "xosc-recognize"
DATE = datetime(2000, 1, 1)
"""Date in every file: the recordings tell none, and the same catalogue has to have the same bytes.
"""

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
    """Settings for writing a catalogue.

    Attributes:
        scope: what belongs to a scene.
        version: of OpenSCENARIO.
    """

    scope: Scope = field(default_factory=Scope)
    version: Version = (1, 3)


class CatalogFile(NamedTuple):
    """Location of a catalogue's entries: the class's folder, the kind, and the part of the name
    that sets it apart."""

    folder: str
    kind: str
    part: str

    @property
    def directory(self) -> str:
        """Directory relative to the class's folder; its last part is unique in the catalogue, as
        exports put all side by side."""
        kind = _FOLDERS[self.kind]
        return f"catalogs/{kind}/{'-'.join(filter(None, (self.folder, kind, self.part)))}"


class _BuiltEntry(NamedTuple):
    """An entry of a catalogue, as scenariogeneration has it."""

    place: CatalogFile
    name: str
    built: Any


Entries = dict[CatalogFile, dict[str, Any]]
"""Entries of OpenSCENARIO catalogues by their names, for each catalogue; as scenariogeneration has
them"""


class PendingCatalog(NamedTuple):
    """Parts of the catalogue that remain to be written after the scenarios of a recording.

    rows: of the index. entries: of OpenSCENARIO catalogues that other recordings have entries of,
    too. files: digests of the files written, by name. edited: files that a person has edited, left
    alone. films: by scenario's file. trials: scenarios to be played, in the order of rows.
    """

    rows: list[dict[str, Any]]
    films: dict[str, Film]
    entries: Entries
    files: dict[str, str]
    edited: list[str]
    trials: list[Trial]


class Material:
    """A recording, which has its road coordinates, ready for scenes and manoeuvres to be taken from
    it.

    Attributes:
        source, site: where it is from.
        scenes: cuts scenes.
        maneuvers: measures manoeuvres.
        lights: recorded states of traffic lights, if any.
        conditions: weather, daylight, surface.
        quality: of the recording, from 0 to 1.
    """

    def __init__(
        self, source: Source, recording: Recording, site: Site, scope: Scope, quality: float = 1.0
    ) -> None:
        self.source, self.site, self.quality = source, site, quality
        self.scenes, self.maneuvers, self.lights, self.conditions = (
            SceneCutter(recording, scope),
            Maneuvers(recording, site),
            source.lights(),
            source.conditions(),
        )


class CatalogWriter:
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
        self._films: dict[str, Film] = {}
        self._trials: list[Trial] = []
        self._config, self._sorted_by = config, sorted_by
        self._entries: Entries = {}

    def add(self, material: Material, road: str, episodes: Iterable[Episode]) -> None:
        """Write the scenarios of a recording on the catalogue's road file of this name."""
        for episode in episodes:
            self._write(_context(material, road, episode))
            # Trajectories belong to one scene: their catalogue is written with it, and does not
            # wait in memory.
            for place in sorted(
                place for place in self._entries if place.kind == "Trajectory"
            ):  # of this scenario alone
                write_catalog(self._store, place, self._entries.pop(place), self._config.version)

    @property
    def written(self) -> PendingCatalog:
        """Return the result of writing so far."""
        return PendingCatalog(
            self._rows,
            self._films,
            self._entries,
            self._store.written,
            self._store.edited,
            self._trials,
        )

    def _enter(self, entries: Iterable[_BuiltEntry]) -> None:
        for item in entries:
            self._entries.setdefault(item.place, {}).setdefault(item.name, item.built)

    def _write(self, context: _Context) -> None:
        episode, scene = context.episode, context.scene
        facts = _facts(context, self._sorted_by)
        conditions = context.material.conditions
        tagged = tags(episode.name, episode.title, scene, facts, conditions)
        described = (
            f"{episode.title}: {scene.ego.track.category} {episode.ego} of "
            f"{context.material.source.name}"
        )
        properties = xosc_tags.properties(tagged) if self._config.version >= _PROPERTIES else {}
        header = FileHeader(
            f"{described}, {scene.start:.2f} s to {scene.end:.2f} s", AUTHOR, DATE, properties
        )
        row = facts | {
            "file": self._put(episode, ".xosc", self._replay(context, header)),
            "maneuver": None,
            "no_maneuver": None,
            "inconclusive": None,
            "road": context.road,
            "deviation": None,
            "most_deviation": None,
        }
        try:
            row["maneuver"] = self._put(episode, "_maneuver.xosc", self._variation(context, header))
        except Unsupported as reason:
            # The replay stands alone then; the index says why there is no variation.
            row["no_maneuver"] = reason.message
        row["openlabel"] = self._put(
            episode, ".openlabel.json", xosc_tags.to_bytes(tagged, f"{episode.name}.xosc", AUTHOR)
        )
        self._rows.append(row)
        # Played later: catalogues that recordings share lack entries until the last one is written.
        self._trials.append(Trial.of(row["file"], row["maneuver"], scene))
        moment = episode.finding.moment if episode.finding is not None else None
        middle = moment.time if moment is not None else 0.5 * (scene.start + scene.end)
        self._films[row["file"]] = film(
            scene, middle, moment.partner if moment is not None else None
        )

    def _put(self, episode: Episode, ending: str, content: bytes) -> str:
        """Write a file of an episode; its name in the catalogue."""
        name = f"{episode.folder}/{episode.name}{ending}"
        self._store.write(name, content)
        return name

    def _replay(self, context: _Context, header: FileHeader) -> bytes:
        episode, scene = context.episode, context.scene
        participants = {part.name: entry(part.track) for part in scene.parts}
        entries = [
            context.entry(participant.kind, participant.name, participant.built, context.recorded)
            for participant in participants.values()
        ]
        entries += [
            context.entry("Trajectory", path.name, path, episode.name)
            for path in replay.trajectories(scene)
        ]
        self._enter(entries)
        path = self._store.root / episode.folder / f"{episode.name}.xosc"
        road, catalogs, version = f"../{context.road}", _directories(entries), self._config.version
        return replay.scenario(
            path, header, scene, road=road, entries=participants, catalogs=catalogs, version=version
        )

    def _variation(self, context: _Context, header: FileHeader) -> bytes:
        episode, network, finding = (
            context.episode,
            context.material.site.network,
            context.episode.finding,
        )
        if finding is None or episode.passage is not None:
            raise Unsupported("this is the scene of a whole vehicle, not of one manoeuvre")
        partner, span = (
            finding.moment.partner,
            Span(finding.start, finding.moment.time, finding.end),
        )
        measured = context.material.maneuvers.of(episode.label, episode.ego, partner, span)
        participants = [
            entry(track) for track in (measured.ego, measured.other) if track is not None
        ]
        entries = [
            context.entry(participant.kind, participant.name, participant.built, context.recorded)
            for participant in participants
        ]
        other = context.name_of(measured.other)
        built, followed = (
            storyboard.catalogue_entries(measured),
            paths(measured, network, episode.name, other),
        )
        entries += [context.entry("Maneuver", entry.name, entry) for entry in built]
        entries += [context.entry("Controller", CONTROLLER.name, CONTROLLER)]
        entries += [
            context.entry("Route", route.name, route, context.recorded)
            for route in followed.routes.values()
        ]
        entries += [
            context.entry("Trajectory", path.name, path, episode.name)
            for path in followed.trajectories.values()
        ]
        path = self._store.root / episode.folder / f"{episode.name}_maneuver.xosc"
        stage = storyboard.ScenarioFiles(path, f"../{context.road}", _directories(entries))
        document = storyboard.scenario(
            stage, header, measured, network, other, followed, self._config.version
        )
        self._enter(entries)
        return to_bytes(document)


def write_catalog(
    store: Store, place: CatalogFile, entries: dict[str, Any], version: Version
) -> None:
    """Write an OpenSCENARIO catalogue with entries in the order of their names."""
    # as esmini looks for it: by the name of the catalogue
    name = f"{place.folder}/{place.directory}/{place.kind}Catalog.xosc"
    header = FileHeader(f"{place.kind} catalogue of {place.folder}", AUTHOR, DATE)
    ordered = [entries[key] for key in sorted(entries)]
    if place.kind == "Trajectory":
        content = maneuvers.trajectory_catalog(header, ordered, version)
    else:
        content = to_bytes(
            maneuvers.catalog(store.root / name, header, f"{place.kind}Catalog", ordered, version)
        )
    store.write(name, content)


def _directories(entries: Iterable[_BuiltEntry]) -> dict[str, str]:
    """The folders of catalogues by their kind, relative to the scenario."""
    return {
        place.kind: place.directory for place in dict.fromkeys(entry.place for entry in entries)
    }


class _Context(NamedTuple):
    """A scenario being written, with its recording and road."""

    material: Material
    road: str
    episode: Episode
    scene: Excerpt

    @property
    def recorded(self) -> str:
        """Part of catalogue names that identifies this recording."""
        return plain(self.material.source.name)

    def entry(self, kind: str, name: str, built: Any, part: str = "") -> _BuiltEntry:
        """An entry of a catalogue of the scenario's class."""
        return _BuiltEntry(CatalogFile(self.episode.folder, kind, part), name, built)

    def name_of(self, track: Track | None) -> str:
        """Name in the scenario of a track that takes part in it."""
        parts: tuple[Part, ...] = self.scene.parts
        return next(
            (part.name for part in parts if part.track is track and part.name != EGO), "Other"
        )


def _context(material: Material, road: str, episode: Episode) -> _Context:
    """An episode with its scene, cut from the recording."""
    # The scene of a whole vehicle is about all that it meets: nobody in it is a bystander.
    involved = (
        None
        if episode.passage is not None or episode.finding is None
        else [episode.finding.moment.partner or ""]
    )
    scene = material.scenes.cut(episode.ego, episode.start, episode.end, involved)
    return _Context(material, road, episode, scene)


def facts_of(
    material: Material, episodes: Iterable[Episode], sorted_by: str
) -> list[dict[str, Any]]:
    """Rows of episodes as those of an index, without writing any file; with folder and name that
    their scenarios would have, and the episode itself as JSON."""
    return [
        {"folder": episode.folder, "name": episode.name, "episode": episode.as_json()}
        | _facts(_context(material, "", episode), sorted_by)
        for episode in episodes
    ]


def _facts(context: _Context, sorted_by: str) -> dict[str, Any]:
    """The scenario's row of the index, but for its files."""
    source, episode, scene = context.material.source, context.episode, context.scene
    moment = episode.finding.moment if episode.finding is not None else None
    # What rules do not name is blank, not `unknown`: that is a label of the model.
    rule = moment.rule.title if moment is not None and moment.rule else None
    measured = {
        name: None if value is None else round(value, 3)
        for name, value in criticality_of(scene).items()
    }
    return {
        "class": episode.title,
        "state": episode.state,
        "sorted_by": sorted_by,
        "confidence": moment.confidence if moment is not None else None,
        "rule_class": rule,
        "model_class": moment.model if moment is not None else None,
        "nearest_class": moment.nearest if moment is not None else None,
        "labels_agree": moment.labels_agree if moment is not None else None,
        "trust": moment.trust if moment is not None else None,
        "why": (moment.why or None) if moment is not None else None,
        "severity": moment.severity if moment is not None else None,
        "critical": (moment.critical or None) if moment is not None else None,
        "others": (", ".join(moment.participants) or None) if moment is not None else None,
        "partial": bool(moment.tags.get("partial", False)) if moment is not None else None,
        **_pair(context),
        **context.material.conditions.columns(),
        "passage": episode.passage,
        "data_set": source.format,
        "site": source.site,
        "recording": source.name,
        "quality": context.material.quality,
        "vehicle": episode.ego,
        "partner": moment.partner if moment is not None else None,
        "time": round(moment.time, 3) if moment is not None else None,
        "start": round(scene.start, 3),
        "end": round(scene.end, 3),
        "participants": len(scene.parts),
        "tags": dict(sorted(moment.tags.items())) if moment is not None else {},
        **measured,
    }


def _pair(context: _Context) -> dict[str, Any]:
    """Return the place of the ego at the event's time, and the measures of ego and partner within
    it."""
    finding, recording, site = (
        context.episode.finding,
        context.material.scenes.recording,
        context.material.site,
    )
    pair: dict[str, Any] = dict.fromkeys(PAIR)
    if finding is None:
        return pair
    ego = recording.tracks[finding.moment.ego]
    at = _row(ego, finding.moment.time)
    pair["ego_speed"] = round(float(ego.columns["speed"][at]), 3)
    lanes, (road, lane, s) = (
        site.lanes,
        (ego.columns[name][at : at + 1] for name in ("road_id", "lane_id", "s")),
    )
    strip = lanes.find(road, lane.astype(np.int64), s)
    # Beside its lane the ego has the kind and the limit of another place.
    if lanes.contains(strip, s, ego.columns["lane_offset"][at : at + 1])[0]:
        limit = float(lanes.speed_limit[strip[0]])
        pair["road_kind"] = str(ROLES[site.roles.codes(lanes, strip, s)[0]])
        # A map without limits has infinite ones; then what is stated beside the recording counts.
        given = limit if math.isfinite(limit) else context.material.conditions.limit
        pair["limit"] = None if given is None else round(given, 3)
    lights = context.material.lights
    pair["light"] = lights.ahead(ego, finding.moment.time) if lights is not None else None
    partner = recording.tracks.get(finding.moment.partner or "")
    if partner is not None:
        pair |= _encounter(ego, partner, finding)
    return pair


def _encounter(ego: Track, partner: Track, finding: Detection) -> dict[str, Any]:
    """Measures of two participants within the time of an event, by their columns in the index."""
    mine, theirs = (_cut(track, finding.start, finding.end) for track in (ego, partner))
    between = relations(mine, [theirs])
    if not len(between.rows):
        return {}
    now = int(np.abs(mine.time[between.rows] - finding.moment.time).argmin())
    view = between.view
    found: dict[str, Any] = {
        "partner_speed": float(partner.columns["speed"][_row(partner, finding.moment.time)]),
        "closing_speed": float(view.speed[now] - view.other_speed[now]),
        "gap": float(view.ahead[now]),
        "pair_touches": bool((between.distance <= 0.0).any()),
    }
    # Overlapping boxes have no gap to divide by: measures would be of the boxes' errors.
    if not found["pair_touches"]:
        measured = criticality(mine, [theirs])
        drac = _extreme(measured.drac, np.max)
        found |= {
            "pair_thw": _extreme(measured.thw, np.min),
            "pair_ttc": _extreme(measured.ttc, np.min),
        }
        found["pair_drac"] = drac if drac is not None and drac <= _MOST_DRAC else None
    return {
        name: round(value, 3) if isinstance(value, float) else value
        for name, value in found.items()
    }


def _extreme(series: Series, of: Callable[[FloatArray], float]) -> float | None:
    return float(of(series.value[series.valid])) if series.valid.any() else None


def _row(track: Track, time: float) -> int:
    """Row of a track at a time, or next to it."""
    return int(np.abs(track.columns["time"] - time).argmin())


def _cut(track: Track, start: float, end: float) -> MotionRows:
    """A track from one time to another."""
    columns = track.columns
    first, last = (
        np.searchsorted(columns["time"], start),
        np.searchsorted(columns["time"], end, "right"),
    )
    return MotionRows.from_columns(
        track.name, track.box, {name: values[first:last] for name, values in columns.items()}
    )
