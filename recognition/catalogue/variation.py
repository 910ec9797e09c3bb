"""Manoeuvres as scenarios for variation: conditions and actions with the seven parameters, declared with recorded values.

The manoeuvre comes from a catalogue. It begins when the delay has passed and the gap is no longer than the one wanted. The
initial gap follows from the gap at the trigger, the speeds and the delay, so that both come at once.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from recognition.catalogue.entities import Entry, entry
from recognition.catalogue.maneuvers import Maneuver, facing
from recognition.catalogue.scenes import EGO
from runner.positions.lane import travel_s
from runner.recording import Track
from schemas.errors import Unsupported
from xodr.model import RoadPoint
from xodr.network import RoadNetwork
from xosc import maneuvers
from xosc.document import Document
from xosc.files import Header
from xosc.maneuvers import Dynamics, Number
from xosc.versions import Version

GAP, START_SPEED, DELAY = "Gap_m", "StartSpeed_mps", "StartDelay_s"
END_SPEED, DURATION, FINAL_SPEED, REST = "EndSpeed_mps", "Duration_s", "FinalSpeed_mps", "EndDelay_s"
RANGES: dict[str, tuple[float, float]] = {
    GAP: (5.0, 80.0),
    START_SPEED: (10.0, 40.0),
    DELAY: (0.0, 10.0),
    END_SPEED: (10.0, 40.0),
    DURATION: (1.0, 8.0),
    FINAL_SPEED: (10.0, 40.0),
    REST: (0.0, 10.0),
}
"""The seven parameters and their ranges (m, m/s, s), as in `maneuvers.Seven`; a recorded value beyond widens its range"""
EGO_SPEED, OTHER_SPEED = "EgoSpeed_mps", "OtherSpeed_mps"
"""Speed of the one who is not the actor, by who that is"""
CONTROLLER = maneuvers.controller("system_under_test", {"role": "drives the ego; which system that is, is up to the simulator"})

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
    kind = "speed_change" if maneuver.left is None else "lane_change_left" if maneuver.left else "lane_change_right"
    return kind if maneuver.other else f"{kind}_without_lead"


def catalogue_entry(maneuver: Maneuver) -> Any:
    """The entry of the manoeuvre catalogue: parameters, trigger and actions, whoever the participants are."""
    over_time = Dynamics("linear", "time", f"${DURATION}")
    change = [maneuvers.speed(f"${END_SPEED}", over_time)]
    if maneuver.left is not None:
        lanes = 1 if maneuver.left else -1
        change.insert(0, maneuvers.lane_change(lanes, over_time._replace(shape="sinusoidal"), relative_to="$Actor"))
    start = [replace(maneuvers.simulation_time(-1.0), delay=f"${DELAY}")]
    names = {"Actor": EGO}
    if maneuver.other is not None:
        wanted = f"${{${GAP} + {_REACHED}}}"
        start.insert(0, maneuvers.relative_distance("$Follower", "$Leader", wanted, coordinates="lane"))
        names |= {"Follower": EGO, "Leader": "Other"}
    settle = maneuvers.speed(f"${FINAL_SPEED}", over_time._replace(value=f"${REST}"))
    events = [
        maneuvers.event("change", change, start),
        maneuvers.event("settle", [settle], maneuvers.element_state("event", "change", "completeState")),
    ]
    declared = [maneuvers.parameter(name, "string", text) for name, text in names.items()]
    declared += [maneuvers.parameter(name, "double", RANGES[name][0]) for name in _values(maneuver)]
    return maneuvers.maneuver(entry_name(maneuver), events, declared)


def scenario(
    stage: Stage, header: Header, maneuver: Maneuver, network: RoadNetwork, other: str, route: str | None, version: Version
) -> Document:
    """The scenario with a manoeuvre.

    Args:
        network: the roads that the tracks' road coordinates are on.
        other: name of the other participant, where there is one.
        route: entry of the route catalogue for the ego, None for the way straight on.
        version: of the standard.

    Raises:
        Unsupported: the road does not reach back to where the other one would have to begin, or the version has no expressions.
    """
    values = _values(maneuver)
    tracks = {EGO: maneuver.ego} | ({other: maneuver.other} if maneuver.other is not None else {})
    init = {EGO: _init_ego(maneuver, route)}
    assigned: dict[str, Number] = {"Actor": EGO if maneuver.ego_acts else other, **{name: f"${name}" for name in values}}
    if maneuver.other is not None:
        init[other] = _init_other(maneuver, maneuver.other, network)
        assigned |= {"Follower": EGO, "Leader": other}
    done = replace(maneuvers.element_state("event", "change", "completeState"), delay=f"${REST}")
    limit = maneuvers.simulation_time(f"${{${DELAY} + ${DURATION} + ${REST} + {_PATIENCE}}}")
    return maneuvers.scenario(
        stage.path,
        header,
        road=stage.road,
        entities={name: _reference(entry(track)) for name, track in tracks.items()},
        init=init,
        maneuvers=[(EGO if maneuver.ego_acts else other, maneuvers.reference("ManeuverCatalog", entry_name(maneuver), assigned))],
        parameters=_parameters(values, maneuver),
        catalogs=stage.catalogs,
        stop=[[done], [limit]],
        controllers={EGO: maneuvers.reference("ControllerCatalog", CONTROLLER.name)},
        version=version,
    )


def _values(maneuver: Maneuver) -> dict[str, float]:
    """The parameters that the manoeuvre has, with their recorded values."""
    values = dict(zip(RANGES, maneuver.values, strict=True))
    return {name: round(value, 3) for name, value in values.items() if value is not None}


def _passive(maneuver: Maneuver) -> str:
    return OTHER_SPEED if maneuver.ego_acts else EGO_SPEED


def _parameters(values: dict[str, float], maneuver: Maneuver) -> list[Any]:
    """Declarations of the seven, with their ranges, and of the speed of the one who is not the actor."""
    declared = []
    for name, value in values.items():
        low, high = RANGES[name]
        limits = ("greaterOrEqual", min(low, value)), ("lessOrEqual", max(high, value))
        declared.append(maneuvers.parameter(name, "double", value, [limits]))
    if maneuver.other is not None:
        declared.append(maneuvers.parameter(_passive(maneuver), "double", round(maneuver.speed, 3)))
    return declared


def _reference(each: Entry) -> Any:
    return maneuvers.reference(f"{each.kind}Catalog", each.name)


def _place(track: Track, time: float) -> RoadPoint:
    """Where a track is on the road at a time (s)."""
    columns = track.columns
    row = min(int(np.searchsorted(columns["time"], time)), len(columns["time"]) - 1)
    s, t, offset = (float(columns[name][row]) for name in ("s", "t", "lane_offset"))
    return RoadPoint(str(columns["road_id"][row]), s, t, int(columns["lane_id"][row]), offset)


def _init_ego(maneuver: Maneuver, route: str | None) -> list[Any]:
    here = _place(maneuver.ego, maneuver.start)
    position = maneuvers.lane_position(here.road_id, here.lane_id, round(here.s, 3), round(here.offset, 3))
    actions = [maneuvers.teleport(position), maneuvers.speed(f"${START_SPEED if maneuver.ego_acts else EGO_SPEED}")]
    if route is not None:
        actions.append(maneuvers.assign_route(maneuvers.reference("RouteCatalog", route)))
    return actions


def _init_other(maneuver: Maneuver, other: Track, network: RoadNetwork) -> list[Any]:
    """Ahead of the ego (or, to cut in, beside its lane) by what gives the wanted gap after the delay."""
    here = _place(maneuver.ego, maneuver.start)
    side = int(facing(maneuver.ego, network)[np.searchsorted(maneuver.ego.columns["time"], maneuver.start)])
    own, mine = (OTHER_SPEED, START_SPEED) if maneuver.ego_acts else (START_SPEED, EGO_SPEED)
    boxes = round(maneuver.ego.box.x + maneuver.ego.box.length / 2 - other.box.x + other.box.length / 2, 3)
    values = _values(maneuver) | {_passive(maneuver): round(maneuver.speed, 3)}
    ahead = values[GAP] - (values[own] - values[mine]) * values[DELAY] + boxes
    if travel_s(network, here, side * ahead, network.straightest) is None:
        raise Unsupported("the road is too short for the speeds before the manoeuvre")
    ds = f"${{{side} * (${GAP} - (${own} - ${mine}) * ${DELAY} + {boxes})}}"
    lanes = side * (-1 if maneuver.left else 1) if maneuver.kind == "cut_in" else 0
    return [maneuvers.teleport(maneuvers.relative_lane_position(EGO, lanes, ds)), maneuvers.speed(f"${own}")]


def route(maneuver: Maneuver, network: RoadNetwork, name: str) -> Any | None:
    """The route of an ego that leaves its road, from where it is first to where it is last; None for one that needs none."""
    places = [_place(maneuver.ego, time) for time in (maneuver.start, maneuver.end)]
    if places[0].road_id == places[1].road_id or network.route(places) is None:
        return None
    return maneuvers.route(name, [maneuvers.lane_position(each.road_id, each.lane_id, round(each.s, 3)) for each in places])
