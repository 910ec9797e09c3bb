"""Manoeuvres as scenarios for variation: conditions and actions with the seven parameters, declared with recorded values.

The manoeuvre comes from a catalogue. It begins when the delay has passed and the gap is no longer than the one wanted; the
participants start where both come at once.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from recognition.catalogue.scenes.entities import entry
from recognition.catalogue.scenes.scenes import EGO
from recognition.maneuvers.events.maneuver import Maneuver
from recognition.maneuvers.scenario import start as starting
from recognition.maneuvers.scenario.declarations import (
    BEGIN,
    DURATION,
    END_SPEED,
    FINAL_SPEED,
    GAP,
    ONWARDS,
    RANGES,
    REST_TIME,
    START_TIME,
    declarations,
    values,
)
from recognition.maneuvers.scenario.start import Paths
from xodr.network import RoadNetwork
from xosc import maneuvers
from xosc.document import Document
from xosc.files import Header
from xosc.maneuvers import Condition, Dynamics, Number
from xosc.versions import Version

CONTROLLER = maneuvers.controller("system_under_test", {"role": "drives the ego; which system that is, is up to the simulator"})

_GO_ON = "go_on"
"""Name of the entry by which the other one goes on"""
_CONFLICT_POINT = maneuvers.world_position("$MeetingX", "$MeetingY")
_REACHED = 0.5
"""How much longer than wanted the gap (m) may be when the manoeuvre begins: it is looked at once a step."""
_PATIENCE = 10.0
"""Time (s) after which a scenario ends whose gap never came, beyond the time that it would have taken"""


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
    """The entries of the manoeuvre catalogue, whoever the participants are: the actor's, and the other one's in a passage."""
    return [_change(maneuver), *([_go_on()] if _conflict(maneuver) else [])]


def _change(maneuver: Maneuver) -> Any:
    """The actor's parameters, trigger and actions."""
    over_time = Dynamics("linear", "time", f"${DURATION}")
    change = [maneuvers.speed(f"${END_SPEED}", over_time)]
    if maneuver.left is not None:
        lanes = 1 if maneuver.left else -1
        change.insert(0, maneuvers.lane_change(lanes, over_time._replace(shape="sinusoidal"), relative_to="$Actor"))
    start = [replace(maneuvers.simulation_time(-1.0), delay=f"${START_TIME}")]
    if maneuver.other is not None:
        start.insert(0, _gap_is_there(maneuver))
    settle = maneuvers.speed(f"${FINAL_SPEED}", over_time._replace(value=f"${REST_TIME}"))
    events = [
        maneuvers.event("change", change, start),
        maneuvers.event("settle", [settle], maneuvers.element_state("event", "change", "completeState")),
    ]
    declared = [maneuvers.parameter(name, "string", text) for name, text in _roles(maneuver, "Other").items()]
    declared += [maneuvers.parameter(name, "double", 0.0) for name in _conflict(maneuver)]
    declared += [maneuvers.parameter(name, "double", RANGES[name][0]) for name in values(maneuver)]
    return maneuvers.maneuver(entry_name(maneuver), events, declared)


def _go_on() -> Any:
    """The other one's change of speed from where the ways meet."""
    change = maneuvers.speed(f"${ONWARDS}", Dynamics("linear", "time", f"${DURATION}"))
    there = maneuvers.distance("$Other", _CONFLICT_POINT, _REACHED)
    numbers = {"MeetingX": 0.0, "MeetingY": 0.0, ONWARDS: 0.0, DURATION: 1.0}
    declared = [maneuvers.parameter("Other", "string", "Other")]
    declared += [maneuvers.parameter(name, "double", value) for name, value in numbers.items()]
    return maneuvers.maneuver(_GO_ON, [maneuvers.event("go on", [change], there)], declared)


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
    assigned[START_TIME] = f"${BEGIN}"
    done = replace(maneuvers.element_state("event", "change", "completeState"), delay=f"${REST_TIME}")
    limit = maneuvers.simulation_time(f"${{${START_TIME} + ${DURATION} + ${REST_TIME} + {_PATIENCE}}}")
    participants = {name: entry(track) for name, track in tracks.items()}
    return maneuvers.scenario(
        stage.path,
        header,
        road=stage.road,
        entities={name: maneuvers.reference(f"{each.kind}Catalog", each.name) for name, each in participants.items()},
        init=starting.init(maneuver, network, other, followed),
        maneuvers=[(actor, maneuvers.reference("ManeuverCatalog", entry_name(maneuver), assigned)), *_others(maneuver, other)],
        parameters=declarations(maneuver),
        catalogs=stage.catalogs,
        stop=[[done], [limit]],
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
    return [(other, maneuvers.reference("ManeuverCatalog", _GO_ON, assigned))]


def _gap_is_there(maneuver: Maneuver) -> Condition:
    """That the gap is no longer than the one wanted: of the two in lanes, or of the other one's front to where the ways meet."""
    wanted = f"${{${GAP} + {_REACHED}}}"
    if maneuver.passage is not None:
        return maneuvers.distance("$Other", _CONFLICT_POINT, wanted)
    return maneuvers.relative_distance("$Follower", "$Leader", wanted, coordinates="lane")


def _roles(maneuver: Maneuver, other: str) -> dict[str, str]:
    """The parameters of the entry that name participants, with the names for an ego that acts."""
    if maneuver.other is None:
        return {"Actor": EGO}
    return {"Actor": EGO} | ({"Other": other} if maneuver.passage is not None else {"Follower": EGO, "Leader": other})


def _conflict(maneuver: Maneuver) -> dict[str, float]:
    """The parameters of the entry for the conflict point, m."""
    conflict = maneuver.passage.conflict if maneuver.passage is not None else None
    return {"MeetingX": conflict.x, "MeetingY": conflict.y} if conflict is not None else {}
