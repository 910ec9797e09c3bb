"""Scenes as scenarios that replay them: everyone follows the recorded trajectory, at the recorded times and speeds.

Participants that are there from the beginning start in Init; later ones are added when they come; those that leave are deleted.
Times are those of the scenario from its start, so that an event that begins a step late makes no one late.
"""

from __future__ import annotations

from datetime import datetime
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from recognition.catalogue.scenes.entities import Entry
from recognition.catalogue.scenes.scenes import EGO, Part, Scene
from xosc import maneuvers
from xosc.document import Document
from xosc.files import Header
from xosc.maneuvers import Number
from xosc.versions import Version

_EARLY = 1e-3
"""Times that are to be reached are passed this much (s) earlier: every version of the standard has `greaterThan`."""
_DIGITS = 4
"""Decimals of positions and headings"""
_OF_EACH = ("ScenarioObject", "Private", "ManeuverGroup")
"""Elements of which a scenario has one for each participant"""


def trajectories(scene: Scene) -> list[Any]:
    """Entries of a trajectory catalogue: one for each participant, under its name, at times from the scene's start."""
    return [_trajectory(part, scene.start) for part in scene.parts]


def _trajectory(part: Part, start: float) -> Any:
    columns = np.stack([part.time - start, *(part.column(name) for name in ("x", "y", "h"))])
    time, x, y, h = np.round(columns, _DIGITS) + 0.0
    return maneuvers.trajectory(part.name, time, x, y, h=h)


def scenario(
    path: Path,
    header: Header,
    scene: Scene,
    *,
    road: str,
    entries: dict[str, Entry],
    catalogs: dict[str, str],
    version: Version,
) -> bytes:
    """The content of the scenario that replays a scene.

    The document of the ego alone has everything once; what it says of a participant is repeated as text for the others.

    Args:
        path: the file that it is to become.
        header: what it says about itself.
        road: the OpenDRIVE file, relative to `path`.
        entries: catalogue entry of each participant.
        catalogs: folder of each kind of catalogue, relative to `path`; a catalogue is called like its kind.
        version: of the standard.
    """
    ego, *others = (_participant(part, scene, entries[part.name]) for part in scene.parts)
    alone = _document(path, header, ego, scene.end - scene.start, road=road, catalogs=catalogs, version=version)
    more = [_form(each.appears, each.leaves, version).filled(each.names, each.numbers) for each in others]
    return maneuvers.extended(alone, more)


class _Participant(NamedTuple):
    """What a replay says of a participant.

    names: of itself, its catalogue and its entry there. numbers: where its trajectory begins and at what speed (m, rad, m/s), and
    when it begins and ends, from the scene's start (s). appears: it is not there from the beginning. leaves: before the end.
    """

    names: dict[str, str]
    numbers: dict[str, Number]
    appears: bool
    leaves: bool


def _participant(part: Part, scene: Scene, entry: Entry) -> _Participant:
    first, last = part.rows[0], part.rows[-1]
    columns = part.track.columns
    begins, ends = float(columns["time"][first]), float(columns["time"][last])
    numbers: dict[str, Number] = {name: _rounded(columns[name][first]) for name in ("x", "y", "h", "speed")}
    numbers |= {"begins": _rounded(begins - scene.start) - _EARLY, "ends": _rounded(ends - scene.start) - _EARLY}
    names = {"name": part.name, "catalog": f"{entry.kind}Catalog", "entry": entry.name}
    leaves = part.name != EGO and ends < scene.end - _EARLY
    return _Participant(names, numbers, begins > scene.start + _EARLY, leaves)


def _rounded(value: float) -> float:
    return round(float(value), _DIGITS) + 0.0


@lru_cache
def _form(appears: bool, leaves: bool, version: Version) -> maneuvers.Form:
    """What a scenario of this version says of a participant that appears or leaves."""
    names = {name: f"${name}" for name in ("name", "catalog", "entry")}
    numbers: dict[str, Number] = {name: f"${name}" for name in ("x", "y", "h", "speed", "begins", "ends")}
    header = Header("form", "", datetime(2000, 1, 1))
    alone = _Participant(names, numbers, appears, leaves)
    return maneuvers.Form(_document(Path(), header, alone, 0.0, road="", catalogs={}, version=version), _OF_EACH)


def _document(
    path: Path,
    header: Header,
    each: _Participant,
    duration: float,
    *,
    road: str,
    catalogs: dict[str, str],
    version: Version,
) -> Document:
    """The scenario of one participant that ends after a duration (s); other arguments as in `scenario`."""
    name, numbers = each.names["name"], each.numbers
    place = maneuvers.world_position(numbers["x"], numbers["y"], h=numbers["h"])
    speed = maneuvers.speed(numbers["speed"])
    begins, ends = (maneuvers.simulation_time(numbers[when]) for when in ("begins", "ends"))
    follow = maneuvers.follow_trajectory(maneuvers.reference("TrajectoryCatalog", name), "follow", domain="absolute")
    events = [maneuvers.event("follow", [follow], begins, "parallel")]
    if each.appears:
        events.insert(0, maneuvers.event("appear", [maneuvers.add_entity(name, place), speed], begins, "parallel"))
    if each.leaves:
        events.append(maneuvers.event("leave", [maneuvers.delete_entity(name)], ends, "parallel"))
    return maneuvers.scenario(
        path,
        header,
        road=road,
        entities={name: maneuvers.reference(each.names["catalog"], each.names["entry"])},
        init={} if each.appears else {name: [maneuvers.teleport(place), speed]},
        maneuvers=[(name, maneuvers.maneuver("replay", events))],
        catalogs=catalogs,
        stop=maneuvers.simulation_time(round(duration, _DIGITS) - _EARLY),
        version=version,
    )
