"""Manoeuvres as scenarios for variation: conditions and actions with the seven parameters, declared with recorded values.

The manoeuvre comes from a catalogue. It begins when the delay has passed and the gap is at most that of the parameter; the
participants start where both come at once.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

from recognition.catalogue.scenes.entities import entry
from recognition.catalogue.scenes.scenes import EGO
from recognition.maneuvers.events.maneuver import Maneuver
from recognition.maneuvers.parameters import PARAMETERS
from recognition.maneuvers.scenario import start as starting
from recognition.maneuvers.scenario import storyboard
from recognition.maneuvers.scenario.declarations import (
    BEGIN,
    DURATION,
    GAP,
    ONWARDS,
    RANGES,
    START_TIME,
    TRIGGER_GAP,
    declarations,
    values,
)
from recognition.maneuvers.scenario.start import Paths
from xodr.network import RoadNetwork
from xosc import maneuvers
from xosc.document import Document
from xosc.files import Header
from xosc.maneuvers import Dynamics, Number
from xosc.versions import Version

CONTROLLER = maneuvers.controller("system_under_test", {"role": "drives the ego; which system that is, is up to the simulator"})

_CHANGE = "change"
"""Name of the event in which the manoeuvre happens"""
_RESUME = "resume_speed"
"""Name of the entry by which the other participant changes its speed after the conflict point"""
_CONFLICT_POINT = maneuvers.world_position("$ConflictX_m", "$ConflictY_m")
_THERE = 0.5
"""Distance (m) from the conflict point within which the other one is there"""


class Stage(NamedTuple):
    """What a scenario stands on: its file, the road file relative to it, and the folders of its catalogues by kind."""

    path: Path
    road: str
    catalogs: dict[str, str]


def entry_name(maneuver: Maneuver) -> str:
    """Name of the entry of the manoeuvre catalogue."""
    if maneuver.passage is not None and maneuver.other is not None:
        return "passage"
    kind = "speed_change" if maneuver.left is None else "lane_change_left" if maneuver.left else "lane_change_right"
    return kind if maneuver.other else f"{kind}_without_lead"


def catalogue_entries(maneuver: Maneuver) -> list[Any]:
    """The entries of the manoeuvre catalogue, for any participants: the actor's, and the other one's in a passage."""
    return [_change(maneuver), *([_resume()] if _conflict(maneuver) else [])]


def _change(maneuver: Maneuver) -> Any:
    """The actor's parameters, trigger and actions."""
    roles = {role: f"${each.name}" for role, each in PARAMETERS.items()}
    lanes = 0 if maneuver.left is None else 1 if maneuver.left else -1
    start = [storyboard.started(roles["start_time"])]
    if maneuver.passage is not None and maneuver.other is not None:
        start.append(maneuvers.distance("$Other", _CONFLICT_POINT, roles["gap"], "lessOrEqual"))
    elif maneuver.other is not None:
        start.append(storyboard.gap_reached("$Follower", "$Leader", roles["gap"]))
    events = storyboard.events(_CHANGE, "settle", roles, "$Actor", lanes, start)
    declared = [maneuvers.parameter(name, "string", text) for name, text in _roles(maneuver, "Other").items()]
    declared += [maneuvers.parameter(name, "double", 0.0) for name in _conflict(maneuver)]
    declared += [maneuvers.parameter(name, "double", RANGES[name][0]) for name in values(maneuver)]
    return maneuvers.maneuver(entry_name(maneuver), events, declared)


def _resume() -> Any:
    """The other one's change of speed from the conflict point on."""
    change = maneuvers.speed(f"${ONWARDS}", Dynamics("linear", "time", f"${DURATION}"))
    there = maneuvers.distance("$Other", _CONFLICT_POINT, _THERE)
    numbers = {"ConflictX_m": 0.0, "ConflictY_m": 0.0, ONWARDS: 0.0, DURATION: 1.0}
    declared = [maneuvers.parameter("Other", "string", "Other")]
    declared += [maneuvers.parameter(name, "double", value) for name, value in numbers.items()]
    return maneuvers.maneuver(_RESUME, [maneuvers.event("resume speed", [change], there)], declared)


def scenario(
    stage: Stage, header: Header, maneuver: Maneuver, network: RoadNetwork, other: str, followed: Paths, version: Version
) -> Document:
    """The scenario with a manoeuvre.

    Args:
        network: the roads that the tracks' road coordinates are on.
        other: name of the other participant, where there is one.
        followed: what the participants follow (`starting.paths`).
        version: of the standard.

    Raises:
        Unsupported: the road does not reach back to where the other one would have to begin, or the version has no expressions.
    """
    tracks = {EGO: maneuver.ego} | ({other: maneuver.other} if maneuver.other is not None else {})
    actor = EGO if maneuver.ego_acts else other
    roles = _roles(maneuver, other) | {"Actor": actor}
    assigned: dict[str, Number] = {**roles, **_conflict(maneuver), **{name: f"${name}" for name in values(maneuver)}}
    assigned |= {START_TIME: f"${BEGIN}"} | ({GAP: f"${TRIGGER_GAP}"} if maneuver.other is not None else {})
    participants = {name: entry(track) for name, track in tracks.items()}
    return maneuvers.scenario(
        stage.path,
        header,
        road=stage.road,
        entities={name: maneuvers.reference(f"{each.kind}Catalog", each.name) for name, each in participants.items()},
        init=starting.init(maneuver, network, other, followed),
        maneuvers=[(actor, maneuvers.reference("ManeuverCatalog", entry_name(maneuver), assigned)), *_others(maneuver, other)],
        parameters=declarations(maneuver, version),
        catalogs=stage.catalogs,
        stop=storyboard.ends(_CHANGE, {role: f"${each.name}" for role, each in PARAMETERS.items()}),
        controllers={EGO: maneuvers.reference("ControllerCatalog", CONTROLLER.name)},
        version=version,
    )


def _others(maneuver: Maneuver, other: str) -> list[tuple[str, Any]]:
    """What the one who is not the actor does in a passage."""
    continuation = maneuver.passage.continuation if maneuver.passage is not None else None
    if continuation is None:
        return []
    assigned: dict[str, Number] = {
        "Other": other,
        **_conflict(maneuver),
        ONWARDS: f"${ONWARDS}",
        DURATION: round(continuation.duration, 3),
    }
    return [(other, maneuvers.reference("ManeuverCatalog", _RESUME, assigned))]


def _roles(maneuver: Maneuver, other: str) -> dict[str, str]:
    """The parameters of the entry that name participants, with the names for an ego that acts."""
    if maneuver.other is None:
        return {"Actor": EGO}
    return {"Actor": EGO} | ({"Other": other} if maneuver.passage is not None else {"Follower": EGO, "Leader": other})


def _conflict(maneuver: Maneuver) -> dict[str, float]:
    """The parameters of the entry for the conflict point, m."""
    conflict = maneuver.passage.conflict if maneuver.passage is not None else None
    return {"ConflictX_m": conflict.x, "ConflictY_m": conflict.y} if conflict is not None else {}
