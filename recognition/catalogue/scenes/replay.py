"""Scenes as scenarios that replay them: everyone follows the recorded trajectory, at the recorded times and speeds.

Participants that are there from the beginning start in Init; later ones are added when they come; those that leave are deleted.
Times are those of the scenario from its start, so that an event that begins a step late makes no one late.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from recognition.catalogue.scenes.entities import Entry
from recognition.catalogue.scenes.scenes import EGO, Part, Scene
from xosc import maneuvers
from xosc.document import Document
from xosc.files import Header
from xosc.versions import Version

_EARLY = 1e-3
"""Times that are to be reached are passed this much (s) earlier: every version of the standard has `greaterThan`."""
_DIGITS = 4
"""Decimals of positions and headings"""


def trajectories(scene: Scene) -> list[Any]:
    """Entries of a trajectory catalogue: one for each participant, under its name, at times from the scene's start."""
    return [_trajectory(part, scene.start) for part in scene.parts]


def _trajectory(part: Part, start: float) -> Any:
    columns = np.stack([part.time - start, *(part.column(name) for name in ("x", "y", "h"))])
    time, x, y, h = np.round(columns, _DIGITS) + 0.0
    return maneuvers.trajectory(part.name, time, x, y, h=h)


def _rounded(value: float) -> float:
    return round(float(value), _DIGITS) + 0.0


def scenario(
    path: Path,
    header: Header,
    scene: Scene,
    *,
    road: str,
    entries: dict[str, Entry],
    catalogs: dict[str, str],
    version: Version,
) -> Document:
    """The scenario that replays a scene.

    Args:
        path: the file that it is to become.
        header: what it says about itself.
        road: the OpenDRIVE file, relative to `path`.
        entries: catalogue entry of each participant.
        catalogs: folder of each kind of catalogue, relative to `path`; a catalogue is called like its kind.
        version: of the standard.
    """
    later = [part for part in scene.parts if not _from_start(part, scene)]
    return maneuvers.scenario(
        path,
        header,
        road=road,
        entities={name: maneuvers.reference(f"{entry.kind}Catalog", entry.name) for name, entry in entries.items()},
        init={part.name: _init(part) for part in scene.parts if part not in later},
        maneuvers=[(part.name, maneuvers.maneuver("replay", _events(part, scene))) for part in scene.parts],
        catalogs=catalogs,
        stop=maneuvers.simulation_time(round(scene.end - scene.start, _DIGITS) - _EARLY),
        version=version,
    )


def _from_start(part: Part, scene: Scene) -> bool:
    return part.time[0] <= scene.start + _EARLY


def _place(part: Part) -> Any:
    """Where a participant's trajectory begins."""
    x, y, h = (_first(part, name) for name in ("x", "y", "h"))
    return maneuvers.world_position(x, y, h=h)


def _first(part: Part, name: str) -> float:
    """The value that a participant's trajectory begins with."""
    return _rounded(part.track.columns[name][part.rows[0]])


def _init(part: Part) -> list[Any]:
    return [maneuvers.teleport(_place(part)), _speed(part)]


def _speed(part: Part) -> Any:
    """The speed that its trajectory begins with."""
    return maneuvers.speed(_first(part, "speed"))


def _events(part: Part, scene: Scene) -> list[Any]:
    begins, ends = (_rounded(time - scene.start) for time in part.track.columns["time"][part.rows[[0, -1]]])
    start = maneuvers.simulation_time(begins - _EARLY)
    follow = maneuvers.follow_trajectory(maneuvers.reference("TrajectoryCatalog", part.name), "follow", domain="absolute")
    events = [maneuvers.event("follow", [follow], start, "parallel")]
    if not _from_start(part, scene):
        appear = [maneuvers.add_entity(part.name, _place(part)), _speed(part)]
        events.insert(0, maneuvers.event("appear", appear, start, "parallel"))
    if part.name != EGO and part.time[-1] < scene.end - _EARLY:
        events.append(
            maneuvers.event("leave", [maneuvers.delete_entity(part.name)], maneuvers.simulation_time(ends - _EARLY), "parallel")
        )
    return events
