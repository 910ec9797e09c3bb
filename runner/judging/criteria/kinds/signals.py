"""Criteria of signals: red lights and stop signs, and where a drive passes their lines.

`runner.engine.worlds.signals_ahead` says where a signal holds, `runner.engine.worlds.aspects` what
its states mean.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Iterator
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from runner.engine.worlds.aspects import STOPS, aspect_of
from runner.engine.worlds.signals_ahead import SignalLine, is_light, signal_lines
from runner.judging.criteria.criterion import CriterionFinding, Drive, criterion
from schemas.common.array_types import FloatArray
from xodr.model import Signal


class LineCrossing(NamedTuple):
    """The reference point passes a signal's line: when (s), and the row of the drive."""

    time: float
    row: int
    signal: Signal


def crossings(drive: Drive, wanted: Callable[[Signal], bool]) -> list[LineCrossing]:
    """All lines of certain signals that a drive passes in the direction of its lane, in ascending
    time."""
    lines: dict[str, list[SignalLine]] = {}
    crossed: list[LineCrossing] = []
    columns = drive.columns
    for row in range(1, len(columns["time"])):
        for road_id, lane_id, low, high, forwards, entered in _ways(drive, row):
            road = drive.network.roads[road_id]
            # Against the traffic of its lane a drive passes signals that are for the others.
            if (road.direction(lane_id, min(max(low, 0.0), road.length)) > 0) != forwards:
                continue
            if road_id not in lines:
                lines[road_id] = list(signal_lines(drive.network, road, wanted))
            for line in lines[road_id]:
                # Within a junction a signal holds where its road is entered (`signals_ahead`).
                passed = (
                    entered
                    if road.junction_id is not None
                    else (low < line.s <= high if forwards else low <= line.s < high)
                )
                if passed and line.holds(lane_id, forwards):
                    crossed.append(LineCrossing(float(columns["time"][row]), row, line.signal))
    return crossed


def _ways(drive: Drive, row: int) -> Iterator[tuple[str, int, float, float, bool, bool]]:
    """Stretches of road between a row and the one before: road, lane, least and greatest s, whether
    to +s, whether entered."""
    columns = drive.columns
    (road_a, road_b), (lane_a, lane_b), (a, b) = (
        columns[name][row - 1 : row + 1].tolist() for name in ("road_id", "lane_id", "s")
    )
    if road_a == road_b:
        if a != b:
            yield road_a, lane_b, min(a, b), max(a, b), b > a, False
        return
    roads = drive.network.roads
    # Roads join at either end: the nearer one is where it has left or entered.
    to_end, from_start = a > roads[road_a].length / 2, b < roads[road_b].length / 2
    yield (
        (road_a, lane_a, a, roads[road_a].length, True, False)
        if to_end
        else (road_a, lane_a, 0.0, a, False, False)
    )
    beyond = roads[road_b].length + 1.0  # so that a line at the very border counts
    yield (
        (road_b, lane_b, -1.0, b, True, True)
        if from_start
        else (road_b, lane_b, b, beyond, False, True)
    )


@criterion(
    "RunningRedLightTest",
    unit="red lights",
    summary="it crosses no stop line of a traffic light that is red",
    on_roads=True,
)
def running_red_light(drive: Drive) -> CriterionFinding:
    """Look up the state of each light at the instant at which the front passes its line.

    A light counts once the reference point has passed it, too: a car that stands a little beyond
    the line has not run it.
    """
    found = crossings(drive, is_light)
    states = [_state(drive, crossing) for crossing in found]
    red = [
        c
        for c, state in zip(found, states, strict=True)
        if state is not None and aspect_of(state) in STOPS
    ]
    if red:
        return CriterionFinding(
            False,
            # Several lights over one line are one red light.
            float(len({c.row for c in red})),
            f"ran the red light {red[0].signal.id} at {red[0].time:.2f} s",
        )
    dark = [c for c, state in zip(found, states, strict=True) if state is None]
    if dark:
        reason = (
            f"passed the light {dark[0].signal.id} at {dark[0].time:.2f} s, to which the scenario "
            "gives no state"
        )
        return CriterionFinding(None, None, reason)
    return CriterionFinding(
        True,
        0.0,
        f"traffic lights passed: {len(found)}, none of them red"
        if found
        else "came past no traffic light",
        min((_to_red(drive, crossing) for crossing in found), default=None),
    )


def _to_red(drive: Drive, crossing: LineCrossing) -> float:
    """Time (s) from a crossing by the front to the nearest instant at which its light is red;
    infinite where it never is."""
    history = drive.lights.get(crossing.signal.id, [])
    before = _way_to(drive, crossing)
    row = int(np.searchsorted(before, before[-1] - _front(drive)))
    when = float(drive.columns["time"][row])
    ends = [*(since for since, _ in history[1:]), math.inf]
    return min(
        (
            max(since - when, when - end, 0.0)
            for (since, state), end in zip(history, ends, strict=True)
            if aspect_of(state) in STOPS
        ),
        default=math.inf,
    )


def _state(drive: Drive, crossing: LineCrossing) -> str | None:
    """The state of a crossing's light when the front passed its line; None where it had none."""
    history = drive.lights.get(crossing.signal.id, [])
    before = _way_to(drive, crossing)
    row = int(np.searchsorted(before, before[-1] - _front(drive)))
    index = bisect_right(history, float(drive.columns["time"][row]), key=itemgetter(0)) - 1
    return history[index][1] if index >= 0 else None


_TYPES = {"206", "R1-1"}
"""Types of the stop sign: OpenDRIVE's own and Germany's, and North America's."""
_NEAR, _STANDING = 4.0, 0.1
"""m before the line, and m/s, of a stop."""


@criterion(
    "RunningStopTest",
    unit="stop signs",
    summary="it stops (slower than 0.1 m/s) within the last 4 m before each stop sign",
    on_roads=True,
)
def running_stop(drive: Drive) -> CriterionFinding:
    """Look for a standstill with the front close to each line, up to the instant at which the
    reference point passes it."""
    found = crossings(drive, _is_stop_sign)
    ran = [crossing for crossing in found if not _stopped(drive, crossing)]
    if ran:
        return CriterionFinding(
            False, float(len(ran)), f"ran the stop sign {ran[0].signal.id} at {ran[0].time:.2f} s"
        )
    return CriterionFinding(
        True,
        0.0,
        f"stop signs passed: {len(found)}, all after a stop" if found else "came past no stop sign",
    )


def _is_stop_sign(signal: Signal) -> bool:
    return not signal.dynamic and signal.type in _TYPES


def _stopped(drive: Drive, crossing: LineCrossing) -> bool:
    """Whether it stood shortly before a crossing."""
    before = _way_to(drive, crossing)
    near = before >= before[-1] - _front(drive) - _NEAR
    return bool((np.abs(drive.columns["speed"][: crossing.row + 1][near]) < _STANDING).any())


def _way_to(drive: Drive, crossing: LineCrossing) -> FloatArray:
    """Way (m) at each row up to a crossing."""
    return np.concatenate([[0.0], np.cumsum(drive.steps)])[: crossing.row + 1]


def _front(drive: Drive) -> float:
    """x (m) of the front in the entity's own frame."""
    return drive.track.box.x + drive.track.box.length / 2
