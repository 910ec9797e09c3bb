"""Manoeuvres as scenarios: initial states, storyboards, catalogue entries and documents."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from recognition.catalogue.writing.replay import entry
from recognition.labels.maneuvers.maneuver import LONGEST, RecordedManeuver, RecordedPath
from recognition.labels.maneuvers.parameters import (
    APART,
    EGO_SPEED,
    JERK,
    OTHER_SPEED,
    PARAMETERS,
    STILL,
)
from recognition.scenes.cut import EGO
from runner.engine.positions.lane import travel_s
from runner.recording import Track
from schemas.common.errors import Unsupported
from xodr.graph.network import RoadNetwork
from xodr.model import RoadPoint
from xosc.document import Document
from xosc.writing import maneuvers
from xosc.writing.files import FileHeader
from xosc.writing.maneuvers import Conditions, Dynamics, Number, TriggerCondition
from xosc.writing.versions import Version

GAP, START_SPEED, START_TIME, END_SPEED, DURATION, FINAL_SPEED, REST_TIME = (
    parameter.name for parameter in PARAMETERS.values()
)
RANGES = {parameter.name: (parameter.low, parameter.high) for parameter in PARAMETERS.values()}
"""Ranges of the parameters (m, m/s, s); a recorded value beyond widens its range"""
ONWARDS = "OtherFinalSpeed_mps"
"""Speed of the other one in a passage at the end of the scene"""
BEGIN = "Begin_s"
"""Begin of a manoeuvre: the start time, or an earlier one where some entity could not keep its
speed until then"""
TRIGGER_GAP = "TriggerGap_m"
"""The longest gap at which the manoeuvre begins"""

_BESIDE = 0.1
"""Share of a recorded value by which its range goes beyond it on both sides, at least"""


def values(maneuver: RecordedManeuver) -> dict[str, float]:
    """The parameters that the manoeuvre has, with their recorded values."""
    return {name: round(value, 3) for name, value in maneuver.values.named.items()}


def passive(maneuver: RecordedManeuver) -> str:
    """Name of the other vehicle's speed."""
    return OTHER_SPEED if maneuver.ego_acts else EGO_SPEED


def declarations(maneuver: RecordedManeuver, version: Version) -> list[Any]:
    """Declarations of the seven, with their ranges, and of what else the scenario uses."""
    declared = []
    for name, value in values(maneuver).items():
        low, high = _range(name, value, maneuver)
        limits = ("greaterOrEqual", low), ("lessOrEqual", high)
        declared.append(maneuvers.parameter(name, "double", value, [limits]))
    # The passive vehicle's speed has no range: it is a condition of the scene, not of the
    # manoeuvre.
    if maneuver.other is not None:
        declared.append(maneuvers.parameter(passive(maneuver), "double", round(maneuver.speed, 3)))
    if maneuver.passage is not None and maneuver.passage.continuation is not None:
        declared.append(
            maneuvers.parameter(ONWARDS, "double", round(maneuver.passage.continuation.speed, 3))
        )
    if maneuver.other is not None:
        opening = _opening(maneuver) if maneuver.kind != "passage" else None
        longest = trigger_gap(f"${GAP}", opening, version)
        declared.append(maneuvers.parameter(TRIGGER_GAP, "double", f"${{{longest}}}"))
    return [*declared, maneuvers.parameter(BEGIN, "double", f"${{{_begin(maneuver, version)}}}")]


def _range(name: str, value: float, maneuver: RecordedManeuver) -> tuple[float, float]:
    """Range of a parameter: the usual one, widened to both sides of the recorded value."""
    passage = maneuver.passage
    low, high = maneuver.speeds if name in (START_SPEED, END_SPEED, FINAL_SPEED) else RANGES[name]
    # A recorded value is never at the edge of its range: searches go beyond it on both sides.
    low, high = (
        round(limit, 3)
        for limit in (min(low, (1.0 - _BESIDE) * value), max(high, (1.0 + _BESIDE) * value))
    )
    if (
        passage is not None and passage.conflict is not None and name == GAP
    ):  # no farther than where its way begins
        return low, max(min(high, math.floor(passage.conflict.reach * 1e3) / 1e3), value)
    return low, high


def _begin(maneuver: RecordedManeuver, version: Version) -> str:
    """The start time, no longer than everyone can keep a speed until the manoeuvre: the same as
    `RecordedManeuver.delay`."""
    begin, passage = f"${START_TIME}", maneuver.passage
    if maneuver.approach < LONGEST:
        begin = lesser(begin, f"{maneuver.approach:.3f}", version)
    if maneuver.in_one_lane:
        begin = approach(begin, f"${GAP}", _opening(maneuver), version)
    if passage is not None:
        # The path begins where the recording did: at that speed it reaches back so far and no
        # further.
        begin = lesser(begin, f"{passage.begin:.3f} / (${START_SPEED} + {STILL})", version)
        if passage.conflict is not None:
            reached = f"({passage.conflict.reach:.3f} - ${GAP}) / (${OTHER_SPEED} + {STILL})"
            begin = lesser(begin, reached, version)
    return begin


def _opening(maneuver: RecordedManeuver) -> str:
    """Speed by which leader and ego move apart."""
    return (
        f"(${OTHER_SPEED} - ${START_SPEED})"
        if maneuver.ego_acts
        else f"(${START_SPEED} - ${EGO_SPEED})"
    )


_REACHED = 0.5
"""Tolerance (m) of the gap at the start of the manoeuvre: it is checked once per step"""
_ANY = 1000.0
"""A gap (m) that is never exceeded"""
_MIN_MAX = (1, 3)
"""First version of the standard with min(), max() and sign() in expressions"""


def approach(start_time: str, gap: str, opening: str, version: Version = _MIN_MAX) -> str:
    """Time until the manoeuvre begins, of two in one lane that move apart by a speed: the start
    time, cut as said above."""
    return lesser(
        start_time,
        f"{greater(f'{gap} - {APART}', '0', version)} / {greater(opening, str(STILL), version)}",
        version,
    )


def trigger_gap(gap: str, opening: str | None = None, version: Version = _MIN_MAX) -> str:
    """The longest gap at which the manoeuvre begins; any, where the gap grows: it has been reached
    if the ego was late."""
    # Vehicles from the side close in on the conflict point: the gap only shrinks.
    if opening is None:
        return f"{gap} + {_REACHED}"
    sign = (
        f"sign({opening})"
        if version >= _MIN_MAX
        else f"{opening} / (sqrt(pow({opening}, 2)) + {STILL})"
    )
    return f"{gap} + {_REACHED} + {_ANY} * {greater(sign, '0', version)}"


def lesser(a: str, b: str, version: Version = _MIN_MAX) -> str:
    """The lesser of two"""
    return (
        # Before 1.3 expressions have no min(): (a + b - |a - b|) / 2, with the absolute value as a
        # root.
        f"min({a}, {b})"
        if version >= _MIN_MAX
        else f"((({a}) + ({b}) - sqrt(pow(({a}) - ({b}), 2))) / 2)"
    )


def greater(a: str, b: str, version: Version = _MIN_MAX) -> str:
    """The greater of two"""
    return (
        f"max({a}, {b})"
        if version >= _MIN_MAX
        else f"((({a}) + ({b}) + sqrt(pow(({a}) - ({b}), 2))) / 2)"
    )


_SHAPE = "sinusoidal"
"""Shape of lane changes over time"""
_COMFORT = 2.5
"""Jerk (m/s³) of comfortable changes of speed: that of adaptive cruise control above 20 m/s
(ISO 15622:2018)"""
_PATIENCE = 10.0
"""Time (s), beyond the expected one, after which a scenario without its gap ends"""


def started(delay: str) -> TriggerCondition:
    """Condition: the time until the manoeuvre is over.

    Args:
        delay: the time, s; a parameter, or an expression in ${ }.
    """
    return replace(maneuvers.simulation_time(0.0, "greaterOrEqual"), delay=delay)


def gap_reached(follower: str, leader: str, gap: str) -> TriggerCondition:
    """Condition: the gap between two entities is at most one (m), along the lane."""
    return maneuvers.relative_distance(follower, leader, gap, "lessOrEqual", coordinates="lane")


def events(
    change: str,
    settle: str,
    parameters: Mapping[str, str],
    actor: str,
    lanes: int,
    start: Conditions | list[TriggerCondition],
    shape: str = "linear",
) -> list[Any]:
    """The events of the actor: its change of speed and lane over the duration, then the change to
    the final speed.

    Args:
        change, settle: names of the two.
        parameters: terms by role (`recognition.labels.maneuvers.parameters.DECLARED`). Where there
            is a jerk, the acceleration of the change builds up and ends by it, which takes the
            change over the duration that much longer.
        lanes: how many lanes to the left; 0 for none.
        start: the trigger.
        shape: of the changes of speed. A line has an infinite jerk at its ends; what is fitted to
            recordings is one.
    """
    over_time = Dynamics(shape, "time", parameters["duration"])
    actions = [_sped(parameters, over_time)]
    if lanes:
        actions.append(
            maneuvers.lane_change(lanes, over_time._replace(shape=_SHAPE), relative_to=actor)
        )
    settled = maneuvers.speed(
        parameters["final_speed"], over_time._replace(value=_value(parameters["rest_time"]))
    )
    # The second change begins in the step after the first one has ended, with the speed reached.
    changed = maneuvers.element_state("event", change, "completeState")
    return [maneuvers.event(change, actions, start), maneuvers.event(settle, [settled], changed)]


def settling(parameters: Mapping[str, str]) -> str:
    """Term of the time from the end of the change to the scene's: the rest time, or so long that a
    sinusoidal change to the final speed is comfortable.

    Args:
        parameters: terms by role.
    """
    end, final, rest = (parameters[role] for role in ("end_speed", "final_speed", "rest_time"))
    # Greatest second derivative of the shape: π²/2 · |change| / time² (`dynamics.SHAPES`).
    needed = round(math.pi / math.sqrt(2.0 * _COMFORT), 4)
    return f"max({rest}, {needed} * sqrt(abs({final} - {end})))"


def _value(term: str) -> str:
    """A term as the value of an attribute: a parameter alone, or an expression."""
    return term if term.removeprefix("$").isidentifier() else f"${{{term}}}"


def _sped(parameters: Mapping[str, str], over_time: Dynamics) -> Any:
    """The change to the end speed."""
    if JERK not in parameters:
        return maneuvers.speed(parameters["end_speed"], over_time)
    end, start, duration, jerk = (
        parameters[role] for role in ("end_speed", "start_speed", "duration", JERK)
    )
    # so long that the acceleration between its building up and its end is that of the change over
    # the duration
    time = f"${{{duration} + abs({end} - {start}) / ({duration} * {jerk})}}"
    return maneuvers.speed_profile([(end, time)], "follow", jerk)


def changed(change: str, after: str) -> TriggerCondition:
    """Condition: an event has been complete for a time.

    Args:
        change: its name. after: the time, s; a parameter, or an expression in ${ }.
    """
    return replace(maneuvers.element_state("event", change, "completeState"), delay=after)


def ends(change: str, parameters: Mapping[str, str]) -> list[list[TriggerCondition]]:
    """The scene's ends: the rest time after the change, or when the gap never came.

    Args:
        change: name of the event.
        parameters: terms by role.
    """
    times = " + ".join(parameters[role] for role in ("start_time", "duration", "rest_time"))
    return [
        [changed(change, _value(parameters["rest_time"]))],
        [maneuvers.simulation_time(f"${{{times} + {_PATIENCE}}}")],
    ]


_SAME_TIME = 1e-6
"""Times (s) that are the same but for rounding"""


class Paths(NamedTuple):
    """Entries of the route and the trajectory catalogue that participants take, by participant."""

    routes: dict[str, Any]
    trajectories: dict[str, Any]


def paths(maneuver: RecordedManeuver, network: RoadNetwork, name: str, other: str) -> Paths:
    """Return the paths of the ego and the other vehicle; none for straight on.

    Args:
        network: the roads that the tracks' road coordinates are on.
        name: of the scenario.
        other: name of the other participant.
    """
    route = _route(maneuver, network, name) if maneuver.kind != "passage" else None
    passage, followed = maneuver.passage, {}
    if passage is not None:
        followed = {EGO: passage.path} | (
            {other: passage.conflict.path} if passage.conflict is not None else {}
        )
    trajectories = {who: path.trajectory(f"{who} way") for who, path in followed.items()}
    return Paths({EGO: route} if route is not None else {}, trajectories)


def init(
    maneuver: RecordedManeuver, network: RoadNetwork, other: str, followed: Paths
) -> dict[str, list[Any]]:
    """The actions at the beginning, by participant.

    Args:
        network: the roads that the tracks' road coordinates are on.
        other: name of the other participant.
        followed: `paths`.

    Raises:
        Unsupported: the road does not reach back to where the other one would have to begin.
    """
    started = {EGO: _ego(maneuver, followed, network)}
    if maneuver.passage is not None and maneuver.passage.conflict is not None:
        station = f"{maneuver.passage.conflict.reach:.3f} - ${GAP} - ${OTHER_SPEED} * ${BEGIN}"
        started[other] = _on_way(
            followed.trajectories[other], station, f"${OTHER_SPEED}", follow=True
        )
    elif maneuver.other is not None:
        started[other] = _beside(maneuver, maneuver.other, network)
    return started


def _ego(maneuver: RecordedManeuver, followed: Paths, network: RoadNetwork) -> list[Any]:
    """Return the ego's actions: its recorded start, or the approach to its manoeuvre on its route
    or path."""
    passage = maneuver.passage
    if passage is None:
        actions = [
            _recorded(maneuver, network),
            maneuvers.speed(f"${START_SPEED if maneuver.ego_acts else EGO_SPEED}"),
        ]
    else:
        station = f"{passage.begin:.3f} - ${START_SPEED} * ${BEGIN}"
        actions = _on_way(
            followed.trajectories[EGO],
            station,
            f"${START_SPEED}",
            follow=maneuver.kind == "passage",
        )
    if EGO in followed.routes:
        actions.append(
            maneuvers.assign_route(maneuvers.reference("RouteCatalog", followed.routes[EGO].name))
        )
    return actions


def _on_way(way: Any, station: str, speed: str, *, follow: bool) -> list[Any]:
    """Actions that put a vehicle at a distance (m) from the beginning of a recorded way, which is
    followed from there or not."""
    reference, start = maneuvers.reference("TrajectoryCatalog", way.name), f"${{{station}}}"
    actions = [
        maneuvers.teleport(maneuvers.trajectory_position(reference, start)),
        maneuvers.speed(speed),
    ]
    return [*actions, maneuvers.follow_path(reference, start)] if follow else actions


def _row(track: Track, time: float) -> int:
    """The first row of a track at or after a time (s), else its last."""
    at = track.columns["time"]
    return min(int(np.searchsorted(at, time - _SAME_TIME)), len(at) - 1)


def _place(track: Track, time: float) -> RoadPoint:
    """Return the road position of a track at a time (s)."""
    columns, row = track.columns, _row(track, time)
    s, t, offset = (float(columns[name][row]) for name in ("s", "t", "lane_offset"))
    return RoadPoint(str(columns["road_id"][row]), s, t, int(columns["lane_id"][row]), offset)


def _facing(track: Track, time: float, network: RoadNetwork) -> int:
    """+1 where a track faces increasing s at a time (s), −1 else."""
    here, h = _place(track, time), float(track.columns["h"][_row(track, time)])
    return 1 if np.cos(h - network.road(here.road_id).heading(here.s)) >= 0.0 else -1


def _recorded(maneuver: RecordedManeuver, network: RoadNetwork) -> Any:
    """The place of the ego when the scene begins.

    Raises:
        Unsupported: it is beyond the ends of the road.
    """
    here = _place(maneuver.ego, maneuver.start)
    # Tracks may begin before the map does; a place there is none of the standard's.
    if not 0.0 <= here.s <= network.road(here.road_id).length:
        raise Unsupported("the road begins after the manoeuvre does")
    return maneuvers.teleport(
        maneuvers.lane_position(here.road_id, here.lane_id, round(here.s, 3), round(here.offset, 3))
    )


def _beside(maneuver: RecordedManeuver, other: Track, network: RoadNetwork) -> list[Any]:
    """Ahead of the ego (or, to cut in, beside its lane) by what gives the parameter's gap after the
    delay."""
    here = _place(maneuver.ego, maneuver.start)
    side = _facing(maneuver.ego, maneuver.start, network)
    own, ahead = OTHER_SPEED if maneuver.ego_acts else START_SPEED, _ahead(maneuver, other)
    there, aligned, beyond = travel_s(network, here, side * ahead.value, network.straightest)
    if beyond:
        raise Unsupported("the road is too short for the speeds before the manoeuvre")
    ds = f"${{{side} * ({ahead.text})}}"
    lanes = side * (-1 if maneuver.left else 1) if maneuver.kind == "cut_in" else 0
    if (
        network.road(there.road_id).lane_beside(
            there.s, there.lane_id, lanes if aligned else -lanes
        )
        is None
    ):
        raise Unsupported(
            "there is no lane beside the ego's where the other one would have to begin"
        )
    return [
        maneuvers.teleport(maneuvers.relative_lane_position(EGO, lanes, ds)),
        maneuvers.speed(f"${own}"),
    ]


class _Left(NamedTuple):
    """Distance (m) as an expression of the parameters, and its value by the recorded ones."""

    text: str
    value: float


def _ahead(maneuver: RecordedManeuver, other: Track) -> _Left:
    """Return the distance (m) ahead of the ego at which the other one begins."""
    own, mine = (OTHER_SPEED, START_SPEED) if maneuver.ego_acts else (START_SPEED, EGO_SPEED)
    boxes = round(
        maneuver.ego.box.x + maneuver.ego.box.length / 2 - other.box.x + other.box.length / 2, 3
    )
    known = values(maneuver) | {passive(maneuver): round(maneuver.speed, 3)}
    ahead = known[GAP] - (known[own] - known[mine]) * maneuver.delay + boxes
    return _Left(f"${GAP} - (${own} - ${mine}) * ${BEGIN} + {boxes}", ahead)


_FAR = 1e5
"""Distance (m) that no scene covers"""
_MARGIN = 5.0
"""Distance (m) of a front from the road's end at which the scene ends"""


def _road_ends(
    maneuver: RecordedManeuver, network: RoadNetwork, other: str, followed: Paths
) -> list[list[TriggerCondition]]:
    """Stop conditions for participants near the end of their roads, where they could only stop
    dead.

    Raises:
        Unsupported: by the recorded values the road ends before the manoeuvre does.
    """
    delay, duration, known = maneuver.delay, maneuver.values.duration, maneuver.values
    acting = known.start_speed * delay + 0.5 * (known.start_speed + known.end_speed) * duration
    ways = {EGO: (_ego_left(maneuver, network, followed), maneuver.ego, maneuver.ego_acts)}
    if maneuver.other is not None:
        ways[other] = (_other_left(maneuver, network), maneuver.other, not maneuver.ego_acts)
    road_ends = []
    for who, (left, track, acts) in ways.items():
        if left.value >= _FAR / 2.0:
            continue
        room = left.value - track.box.x - 0.5 * track.box.length - _MARGIN
        if room < (acting if acts else maneuver.speed * (delay + duration)):
            raise Unsupported(f"the road of {who} ends before the manoeuvre does")
        road_ends.append(
            [maneuvers.traveled_distance(who, f"${{{left.text} - {left.value - room:.3f}}}")]
        )
    return road_ends


def _ego_left(maneuver: RecordedManeuver, network: RoadNetwork, followed: Paths) -> _Left:
    """Distance left to the ego, along its path or route, else along its lane."""
    passage, known = maneuver.passage, maneuver.values
    if passage is not None:
        whole = float(passage.path.station[-1]) + _onwards(
            maneuver.ego, float(maneuver.ego.columns["time"][-1]), network
        )
        start = f"{passage.begin:.3f} - ${START_SPEED} * ${BEGIN}"
        return _Left(
            f"{whole:.3f} - ({start})", whole - passage.begin + known.start_speed * maneuver.delay
        )
    if EGO in followed.routes:
        path, last = RecordedPath.of(maneuver.ego), float(maneuver.ego.columns["time"][-1])
        left = float(path.station[-1] - path.at(maneuver.start)) + _onwards(
            maneuver.ego, last, network
        )
    else:
        left = _onwards(maneuver.ego, maneuver.start, network)
    return _Left(f"{left:.3f}", left)


def _other_left(maneuver: RecordedManeuver, network: RoadNetwork) -> _Left:
    """Distance left to the other one, on its path beyond the conflict point, else along the lane of
    the ego."""
    assert maneuver.other is not None and maneuver.values.gap is not None, "there is another one"
    gap, passage = maneuver.values.gap, maneuver.passage
    if passage is not None and passage.conflict is not None:
        conflict = passage.conflict
        whole = float(conflict.path.station[-1]) + _onwards(
            conflict.other, float(conflict.other.columns["time"][-1]), network
        )
        start = f"{conflict.reach:.3f} - ${GAP} - ${OTHER_SPEED} * ${BEGIN}"
        return _Left(
            f"{whole:.3f} - ({start})",
            whole - conflict.reach + gap + maneuver.speed * maneuver.delay,
        )
    left, ahead = _onwards(maneuver.ego, maneuver.start, network), _ahead(maneuver, maneuver.other)
    return _Left(f"{left:.3f} - ({ahead.text})", left - ahead.value)


def _onwards(track: Track, time: float, network: RoadNetwork) -> float:
    """Return the distance (m) from a track at a time (s) to the end of its road, straight on;
    `_FAR` for a circle."""
    _, _, beyond = travel_s(
        network, _place(track, time), _facing(track, time, network) * _FAR, network.straightest
    )
    return _FAR - beyond


def _route(maneuver: RecordedManeuver, network: RoadNetwork, name: str) -> Any | None:
    """The route of an ego that leaves its road, from where it is first to where it is last; None
    for one that needs none."""
    places = [_place(maneuver.ego, time) for time in (maneuver.start, maneuver.end)]
    # On one road the lane leads there anyway.
    if places[0].road_id == places[1].road_id or network.route(places) is None:
        return None
    return maneuvers.route(
        name,
        [
            maneuvers.lane_position(place.road_id, place.lane_id, round(place.s, 3))
            for place in places
        ],
    )


CONTROLLER = maneuvers.controller(
    "system_under_test", {"role": "drives the ego; which system that is, is up to the simulator"}
)

_CHANGE = "change"
"""Name of the event in which the manoeuvre happens"""
_RESUME = "resume_speed"
"""Name of the entry by which the other participant changes its speed after the conflict point"""
_CONFLICT_POINT = maneuvers.world_position("$ConflictX_m", "$ConflictY_m")
_THERE = 0.5
"""Distance (m) from the conflict point within which the other one is there"""


class ScenarioFiles(NamedTuple):
    """Surroundings of a scenario: its file, the relative road file, and the folders of its
    catalogues by kind."""

    path: Path
    road: str
    catalogs: dict[str, str]


def entry_name(maneuver: RecordedManeuver) -> str:
    """Name of the entry of the manoeuvre catalogue."""
    if maneuver.passage is not None and maneuver.other is not None:
        return "passage"
    kind = (
        "speed_change"
        if maneuver.left is None
        else "lane_change_left"
        if maneuver.left
        else "lane_change_right"
    )
    return kind if maneuver.other else f"{kind}_without_lead"


def catalogue_entries(maneuver: RecordedManeuver) -> list[Any]:
    """The entries of the manoeuvre catalogue, for any participants: the actor's, and the other
    one's in a passage."""
    return [_change(maneuver), *([_resume()] if _conflict(maneuver) else [])]


def _change(maneuver: RecordedManeuver) -> Any:
    """The actor's parameters, trigger and actions."""
    roles = {role: f"${parameter.name}" for role, parameter in PARAMETERS.items()}
    lanes = 0 if maneuver.left is None else 1 if maneuver.left else -1
    start = [started(roles["start_time"])]
    if maneuver.passage is not None and maneuver.other is not None:
        start.append(maneuvers.distance("$Other", _CONFLICT_POINT, roles["gap"], "lessOrEqual"))
    elif maneuver.other is not None:
        start.append(gap_reached("$Follower", "$Leader", roles["gap"]))
    acts = events(_CHANGE, "settle", roles, "$Actor", lanes, start)
    declared = [
        maneuvers.parameter(name, "string", text)
        for name, text in _roles(maneuver, "Other").items()
    ]
    declared += [maneuvers.parameter(name, "double", 0.0) for name in _conflict(maneuver)]
    declared += [maneuvers.parameter(name, "double", RANGES[name][0]) for name in values(maneuver)]
    return maneuvers.maneuver(entry_name(maneuver), acts, declared)


def _resume() -> Any:
    """The other one's change of speed from the conflict point on."""
    change = maneuvers.speed(f"${ONWARDS}", Dynamics("linear", "time", f"${DURATION}"))
    there = maneuvers.distance("$Other", _CONFLICT_POINT, _THERE)
    numbers = {"ConflictX_m": 0.0, "ConflictY_m": 0.0, ONWARDS: 0.0, DURATION: 1.0}
    declared = [maneuvers.parameter("Other", "string", "Other")]
    declared += [maneuvers.parameter(name, "double", value) for name, value in numbers.items()]
    return maneuvers.maneuver(_RESUME, [maneuvers.event("resume speed", [change], there)], declared)


def scenario(
    stage: ScenarioFiles,
    header: FileHeader,
    maneuver: RecordedManeuver,
    network: RoadNetwork,
    other: str,
    followed: Paths,
    version: Version,
) -> Document:
    """The scenario with a manoeuvre.

    Args:
        network: the roads that the tracks' road coordinates are on.
        other: name of the other participant, where there is one.
        followed: what the participants follow (`paths`).
        version: of the standard.

    Raises:
        Unsupported: the road does not reach back to where the other one would have to begin, or the
            version has no expressions.
    """
    tracks = {EGO: maneuver.ego} | ({other: maneuver.other} if maneuver.other is not None else {})
    actor = EGO if maneuver.ego_acts else other
    roles = _roles(maneuver, other) | {"Actor": actor}
    assigned: dict[str, Number] = {
        **roles,
        **_conflict(maneuver),
        **{name: f"${name}" for name in values(maneuver)},
    }
    assigned |= {START_TIME: f"${BEGIN}"} | (
        {GAP: f"${TRIGGER_GAP}"} if maneuver.other is not None else {}
    )
    participants = {name: entry(track) for name, track in tracks.items()}
    by_role = {role: f"${parameter.name}" for role, parameter in PARAMETERS.items()}
    return maneuvers.scenario(
        stage.path,
        header,
        road=stage.road,
        entities={
            name: maneuvers.reference(f"{participant.kind}Catalog", participant.name)
            for name, participant in participants.items()
        },
        init=init(maneuver, network, other, followed),
        maneuvers=[
            (actor, maneuvers.reference("ManeuverCatalog", entry_name(maneuver), assigned)),
            *_others(maneuver, other),
        ],
        parameters=declarations(maneuver, version),
        catalogs=stage.catalogs,
        stop=[*ends(_CHANGE, by_role), *_road_ends(maneuver, network, other, followed)],
        controllers={EGO: maneuvers.reference("ControllerCatalog", CONTROLLER.name)},
        version=version,
    )


def _others(maneuver: RecordedManeuver, other: str) -> list[tuple[str, Any]]:
    """Return the actions of the vehicle in a passage that is not the actor."""
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


def _roles(maneuver: RecordedManeuver, other: str) -> dict[str, str]:
    """The parameters of the entry that name participants, with the names for an ego that acts."""
    if maneuver.other is None:
        return {"Actor": EGO}
    return {"Actor": EGO} | (
        {"Other": other} if maneuver.passage is not None else {"Follower": EGO, "Leader": other}
    )


def _conflict(maneuver: RecordedManeuver) -> dict[str, float]:
    """The parameters of the entry for the conflict point, m."""
    conflict = maneuver.passage.conflict if maneuver.passage is not None else None
    return {"ConflictX_m": conflict.x, "ConflictY_m": conflict.y} if conflict is not None else {}
