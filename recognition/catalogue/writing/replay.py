"""Scenes as OpenSCENARIO documents that replay recorded trajectories."""

from __future__ import annotations

from copy import deepcopy
from datetime import datetime
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from recognition.scenes.cut import EGO, Excerpt, Part
from runner.engine.participants.declaration import BoundingBox
from runner.recording import Track
from xosc.document import Document
from xosc.writing import maneuvers
from xosc.writing.files import FileHeader
from xosc.writing.maneuvers import Number
from xosc.writing.versions import Version

_KINDS = {"vehicle": "Vehicle", "pedestrian": "Pedestrian", "miscellaneous": "MiscObject"}
_BUILDERS = {
    "Vehicle": maneuvers.vehicle,
    "Pedestrian": maneuvers.pedestrian,
    "MiscObject": maneuvers.obstacle,
}


class _Limits(NamedTuple):
    """Limits of a category of vehicles: greatest speed (m/s), acceleration and
    deceleration (m/s²).
    """

    max_speed: float
    max_acceleration: float
    max_deceleration: float


_CAR = _Limits(70.0, 10.0, 10.0)
_LIMITS = {
    "van": _Limits(50.0, 6.0, 10.0),
    "truck": _Limits(35.0, 5.0, 10.0),
    "bus": _Limits(35.0, 5.0, 10.0),
    "tram": _Limits(25.0, 3.0, 5.0),
    "motorbike": _Limits(80.0, 10.0, 10.0),
    "bicycle": _Limits(20.0, 5.0, 8.0),
}
"""No data set has these: usual values, `_CAR` for every other vehicle. They are a little more than
the limits of smoothed motion (`recognition.recordings.motion.observations`): runs that may not
exceed those would be late."""


class Entry(NamedTuple):
    """An entry of a catalogue: its kind (as in `maneuvers.CATALOG_KINDS`), name and content."""

    kind: str
    name: str
    built: Any


def entry(track: Track) -> Entry:
    """The entry for a participant. Its name has the dimensions (to 1 cm), so that entries of one
    name are alike."""
    return _entry(track.kind, track.category, track.box)


@lru_cache(maxsize=4096)
def _entry(group: str, category: str, recorded: BoundingBox) -> Entry:
    box = BoundingBox(*(round(value, 2) + 0.0 for value in recorded))
    kind = _KINDS[group]
    name = f"{category}_{box.length:.2f}x{box.width:.2f}x{box.height:.2f}"
    about = (box.x, box.y, round(box.z - box.height / 2, 2) + 0.0)
    # The box's place relative to the reference point is part of the name only where it is not
    # usual.
    name += "".join(
        f"_{axis}{value:.2f}" for axis, value in zip("xyz", about, strict=True) if value
    )
    limits = _LIMITS.get(category, _CAR)._asdict() if kind == "Vehicle" else {}
    built = _BUILDERS[kind](name, box.length, box.width, box.height, category=category, **limits)
    centre = built.boundingbox.center
    centre.x, centre.y, centre.z = box.x, box.y, box.z
    return Entry(kind, name, built)


_EARLY = 1e-3
"""Times that are to be reached are passed this much (s) earlier: every version of the standard has
`greaterThan`."""
_DIGITS = 4
"""Decimals of times, speeds, and positions and headings at the beginning"""
_OF_VERTEX = (_DIGITS, 3, 3, _DIGITS)
"""Decimals of time, x, y and heading at vertices: millimetres are a thirtieth of the tolerance"""
_OF_EACH = ("ScenarioObject", "Private", "ManeuverGroup")
"""Elements of which a scenario has one for each participant"""


def trajectories(scene: Excerpt) -> list[Any]:
    """Entries of a trajectory catalogue: one for each participant, under its name, at times from
    the scene's start."""
    return [_trajectory(part, scene.start) for part in scene.parts]


def _trajectory(part: Part, start: float) -> Any:
    columns = np.stack([part.time - start, *(part.column(name) for name in ("x", "y", "h"))])
    time, x, y, h = (
        # + 0.0 turns -0.0 into 0.0, which would be written otherwise.
        np.round(values, digits) + 0.0
        for values, digits in zip(columns, _OF_VERTEX, strict=True)
    )
    return maneuvers.trajectory(part.name, time, x, y, h=h)


def scenario(
    path: Path,
    header: FileHeader,
    scene: Excerpt,
    *,
    road: str,
    entries: dict[str, Entry],
    catalogs: dict[str, str],
    version: Version,
) -> bytes:
    """The content of the scenario that replays a scene.

    The document of the ego alone has everything once; what it says of a participant is repeated as
    text for the others.

    Args:
        path: the file that it is to become.
        header: what it says about itself.
        road: the OpenDRIVE file, relative to `path`.
        entries: catalogue entry of each participant.
        catalogs: folder of each kind of catalogue, relative to `path`; a catalogue is called like
            its kind.
        version: of the standard.
    """
    ego, *others = (_participant(part, scene, entries[part.name]) for part in scene.parts)
    # XML is built once, for the ego; the others are filled into its text.
    alone = _document(
        path, header, ego, scene.end - scene.start, road=road, catalogs=catalogs, version=version
    )
    more = [
        _form(participant.appears, participant.leaves, version).filled(
            participant.names, participant.numbers
        )
        for participant in others
    ]
    return maneuvers.extended(alone, more)


class _Participant(NamedTuple):
    """Replayed participant.

    names: of itself, its catalogue and its entry there. numbers: where its trajectory begins and at
    what speed (m, rad, m/s), and when it begins and ends, from the scene's start (s). appears: it
    is not there from the beginning. leaves: before the end.
    """

    names: dict[str, str]
    numbers: dict[str, Number]
    appears: bool
    leaves: bool


def _participant(part: Part, scene: Excerpt, entry: Entry) -> _Participant:
    first, last = part.rows[0], part.rows[-1]
    columns = part.track.columns
    begins, ends = float(columns["time"][first]), float(columns["time"][last])
    numbers: dict[str, Number] = {
        name: _rounded(columns[name][first]) for name in ("x", "y", "h", "speed")
    }
    numbers |= {
        "begins": _rounded(begins - scene.start) - _EARLY,
        "ends": _rounded(ends - scene.start) - _EARLY,
    }
    names = {"name": part.name, "catalog": f"{entry.kind}Catalog", "entry": entry.name}
    # The ego stays to the end by definition of the scene.
    leaves = part.name != EGO and ends < scene.end - _EARLY
    return _Participant(names, numbers, begins > scene.start + _EARLY, leaves)


def _rounded(value: float) -> float:
    return round(float(value), _DIGITS) + 0.0


@lru_cache
def _form(appears: bool, leaves: bool, version: Version) -> maneuvers.Form:
    """Return the form in which a scenario of this version adds or deletes a participant."""
    names = {name: f"${name}" for name in ("name", "catalog", "entry")}
    numbers: dict[str, Number] = {
        name: f"${name}" for name in ("x", "y", "h", "speed", "begins", "ends")
    }
    header = FileHeader("form", "", datetime(2000, 1, 1))
    alone = _Participant(names, numbers, appears, leaves)
    return maneuvers.Form(
        _document(Path(), header, alone, 0.0, road="", catalogs={}, version=version), _OF_EACH
    )


def _document(
    path: Path,
    header: FileHeader,
    each: _Participant,
    duration: float,
    *,
    road: str,
    catalogs: dict[str, str],
    version: Version,
) -> Document:
    """The scenario of one participant that ends after a duration (s); other arguments as in
    `scenario`."""
    name = each.names["name"]
    init, events = _acts(each, maneuvers.reference("TrajectoryCatalog", name))
    return maneuvers.scenario(
        path,
        header,
        road=road,
        entities={name: maneuvers.reference(each.names["catalog"], each.names["entry"])},
        init={name: init} if init else {},
        maneuvers=[(name, maneuvers.maneuver("replay", events))],
        catalogs=catalogs,
        stop=maneuvers.simulation_time(round(duration, _DIGITS) - _EARLY),
        version=version,
    )


def _acts(each: _Participant, path: Any, mode: str = "follow") -> tuple[list[Any], list[Any]]:
    """The actions of a participant at the beginning, and its events; `path` is its trajectory, or a
    reference to it."""
    name, numbers = each.names["name"], each.numbers
    place = maneuvers.world_position(numbers["x"], numbers["y"], h=numbers["h"])
    speed = maneuvers.speed(numbers["speed"])
    begins, ends = (maneuvers.simulation_time(numbers[when]) for when in ("begins", "ends"))
    follow = maneuvers.follow_trajectory(path, mode, domain="absolute")
    events = [maneuvers.event("follow", [follow], begins, "parallel")]
    if each.appears:
        events.insert(
            0,
            maneuvers.event(
                "appear", [maneuvers.add_entity(name, place), speed], begins, "parallel"
            ),
        )
    if each.leaves:
        events.append(maneuvers.event("leave", [maneuvers.delete_entity(name)], ends, "parallel"))
    return [] if each.appears else [maneuvers.teleport(place), speed], events


def _capable(entry: Entry, track: Track) -> Any:
    """Content of an entry with limits that allow the recorded motion."""
    if entry.kind != "Vehicle":
        return entry.built
    built, columns = deepcopy(entry.built), track.columns
    limits = built.dynamics
    limits.max_speed = max(limits.max_speed, _ceiling(np.abs(columns["speed"])))
    limits.max_acceleration = max(limits.max_acceleration, _ceiling(columns["acceleration"]))
    limits.max_deceleration = max(limits.max_deceleration, _ceiling(-columns["acceleration"]))
    return built


def _ceiling(values: np.ndarray) -> float:
    """The next whole number above all values."""
    return float(np.floor(values.max())) + 1.0


def whole(
    path: Path,
    header: FileHeader,
    scene: Excerpt,
    *,
    road: str | None,
    version: Version,
    exact: bool = False,
) -> Document:
    """The scenario that replays a scene without catalogues: everything is in one file, but the
    road.

    Args:
        path: the file that it is to become.
        header: what it says about itself.
        road: the OpenDRIVE file, relative to `path`; None for a plane.
        version: of the standard.
        exact: have everyone at each vertex at its time, whatever speeds that takes.
    """
    # `follow` observes the Performance, `position` does not (FollowTrajectoryAction).
    mode = "position" if exact else "follow"
    entities, init, acts = dict[str, Any](), dict[str, list[Any]](), list[tuple[str, Any]]()
    for part, followed in zip(scene.parts, trajectories(scene), strict=True):
        built = entry(part.track)
        begins, events = _acts(_participant(part, scene, built), followed, mode)
        entities[part.name] = _capable(built, part.track)
        init |= {part.name: begins} if begins else {}
        acts.append((part.name, maneuvers.maneuver("replay", events)))
    end = maneuvers.simulation_time(round(scene.end - scene.start, _DIGITS) - _EARLY)
    return maneuvers.scenario(
        path,
        header,
        road=road,
        entities=entities,
        init=init,
        maneuvers=acts,
        stop=end,
        version=version,
    )
