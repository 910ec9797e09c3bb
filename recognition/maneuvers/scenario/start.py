"""How the participants of a scenario with a manoeuvre start, so that the gap is that of the parameter when the delay has passed.

In lanes, the other one starts as far ahead of the ego as the gap at the trigger, the speeds and the delay say. On recorded ways,
the ego starts as far before the place where its manoeuvre begins, and the other one as far before where the ways meet.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from recognition.catalogue.scenes.scenes import EGO
from recognition.maneuvers.events.maneuver import Maneuver
from recognition.maneuvers.parameters import EGO_SPEED, OTHER_SPEED
from recognition.maneuvers.scenario.declarations import BEGIN, GAP, START_SPEED, passive, values
from runner.positions.lane import travel_s
from runner.recording import Track
from schemas.errors import Unsupported
from xodr.model import RoadPoint
from xodr.network import RoadNetwork
from xosc import maneuvers

_SAME_TIME = 1e-6
"""Times (s) that are the same but for rounding"""


class Paths(NamedTuple):
    """Entries of the route and the trajectory catalogue that participants take, by participant."""

    routes: dict[str, Any]
    trajectories: dict[str, Any]


def paths(maneuver: Maneuver, network: RoadNetwork, name: str, other: str) -> Paths:
    """What the ego of a manoeuvre and the other one follow; none for the way straight on.

    Args:
        network: the roads that the tracks' road coordinates are on.
        name: of the scenario.
        other: name of the other participant.
    """
    route = _route(maneuver, network, name) if maneuver.kind != "passage" else None
    passage, followed = maneuver.passage, {}
    if passage is not None:
        followed = {EGO: passage.path} | ({other: passage.conflict.path} if passage.conflict is not None else {})
    trajectories = {who: path.trajectory(f"{who} way") for who, path in followed.items()}
    return Paths({EGO: route} if route is not None else {}, trajectories)


def init(maneuver: Maneuver, network: RoadNetwork, other: str, followed: Paths) -> dict[str, list[Any]]:
    """The actions at the beginning, by participant.

    Args:
        network: the roads that the tracks' road coordinates are on.
        other: name of the other participant.
        followed: `paths`.

    Raises:
        Unsupported: the road does not reach back to where the other one would have to begin.
    """
    started = {EGO: _ego(maneuver, followed)}
    if maneuver.passage is not None and maneuver.passage.conflict is not None:
        station = f"{maneuver.passage.conflict.reach:.3f} - ${GAP} - ${OTHER_SPEED} * ${BEGIN}"
        started[other] = _on_way(followed.trajectories[other], station, f"${OTHER_SPEED}", follow=True)
    elif maneuver.other is not None:
        started[other] = _beside(maneuver, maneuver.other, network)
    return started


def _ego(maneuver: Maneuver, followed: Paths) -> list[Any]:
    """Where it was recorded, or where it comes from there to the place of its manoeuvre, on its route or way."""
    passage = maneuver.passage
    if passage is None:
        actions = [_recorded(maneuver), maneuvers.speed(f"${START_SPEED if maneuver.ego_acts else EGO_SPEED}")]
    else:
        station = f"{passage.begin:.3f} - ${START_SPEED} * ${BEGIN}"
        actions = _on_way(followed.trajectories[EGO], station, f"${START_SPEED}", follow=maneuver.kind == "passage")
    if EGO in followed.routes:
        actions.append(maneuvers.assign_route(maneuvers.reference("RouteCatalog", followed.routes[EGO].name)))
    return actions


def _on_way(way: Any, station: str, speed: str, *, follow: bool) -> list[Any]:
    """At a distance (m) from the beginning of a recorded way, which is followed from there or not."""
    reference, start = maneuvers.reference("TrajectoryCatalog", way.name), f"${{{station}}}"
    actions = [maneuvers.teleport(maneuvers.trajectory_position(reference, start)), maneuvers.speed(speed)]
    return [*actions, maneuvers.follow_path(reference, start)] if follow else actions


def _row(track: Track, time: float) -> int:
    """The first row of a track at or after a time (s), else its last."""
    at = track.columns["time"]
    return min(int(np.searchsorted(at, time - _SAME_TIME)), len(at) - 1)


def _place(track: Track, time: float) -> RoadPoint:
    """Where a track is on the road at a time (s)."""
    columns, row = track.columns, _row(track, time)
    s, t, offset = (float(columns[name][row]) for name in ("s", "t", "lane_offset"))
    return RoadPoint(str(columns["road_id"][row]), s, t, int(columns["lane_id"][row]), offset)


def _facing(track: Track, time: float, network: RoadNetwork) -> int:
    """+1 where a track faces increasing s at a time (s), −1 else."""
    here, h = _place(track, time), float(track.columns["h"][_row(track, time)])
    return 1 if np.cos(h - network.road(here.road_id).heading(here.s)) >= 0.0 else -1


def _recorded(maneuver: Maneuver) -> Any:
    """The place of the ego when the scene begins."""
    here = _place(maneuver.ego, maneuver.start)
    return maneuvers.teleport(maneuvers.lane_position(here.road_id, here.lane_id, round(here.s, 3), round(here.offset, 3)))


def _beside(maneuver: Maneuver, other: Track, network: RoadNetwork) -> list[Any]:
    """Ahead of the ego (or, to cut in, beside its lane) by what gives the parameter's gap after the delay."""
    here = _place(maneuver.ego, maneuver.start)
    side = _facing(maneuver.ego, maneuver.start, network)
    own, mine = (OTHER_SPEED, START_SPEED) if maneuver.ego_acts else (START_SPEED, EGO_SPEED)
    boxes = round(maneuver.ego.box.x + maneuver.ego.box.length / 2 - other.box.x + other.box.length / 2, 3)
    known = values(maneuver) | {passive(maneuver): round(maneuver.speed, 3)}
    ahead = known[GAP] - (known[own] - known[mine]) * maneuver.delay + boxes
    there, aligned, beyond = travel_s(network, here, side * ahead, network.straightest)
    if beyond:
        raise Unsupported("the road is too short for the speeds before the manoeuvre")
    ds = f"${{{side} * (${GAP} - (${own} - ${mine}) * ${BEGIN} + {boxes})}}"
    lanes = side * (-1 if maneuver.left else 1) if maneuver.kind == "cut_in" else 0
    if network.road(there.road_id).lane_beside(there.s, there.lane_id, lanes if aligned else -lanes) is None:
        raise Unsupported("there is no lane beside the ego's where the other one would have to begin")
    return [maneuvers.teleport(maneuvers.relative_lane_position(EGO, lanes, ds)), maneuvers.speed(f"${own}")]


def _route(maneuver: Maneuver, network: RoadNetwork, name: str) -> Any | None:
    """The route of an ego that leaves its road, from where it is first to where it is last; None for one that needs none."""
    places = [_place(maneuver.ego, time) for time in (maneuver.start, maneuver.end)]
    if places[0].road_id == places[1].road_id or network.route(places) is None:
        return None
    return maneuvers.route(name, [maneuvers.lane_position(each.road_id, each.lane_id, round(each.s, 3)) for each in places])
