"""Criteria of signals: red lights and stop signs, and where a drive passes their lines.

A signal holds at its s, on the lanes of its validity. On the connecting roads of a junction, to
which signal references point that stand for the whole junction, it holds where the junction is
entered.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from runner.engine.worlds.sumo_translation import RED, RED_YELLOW, link_state
from runner.judging.criteria.criterion import CriterionFinding, Drive, criterion
from xodr.model import Signal
from xodr.model.road import Road


class LineCrossing(NamedTuple):
    """The reference point passes a signal's line: when (s), and the row of the drive."""

    time: float
    row: int
    signal: Signal


class _Line(NamedTuple):
    signal: Signal
    s: float
    orientation: str
    validity: tuple[tuple[int, int], ...]

    def holds(self, lane_id: int, forwards: bool) -> bool:
        """Whether it is for traffic on a lane in a direction; lanes that a file names say more than an orientation."""
        if self.validity:
            return any(
                low <= lane_id <= high or high <= lane_id <= low for low, high in self.validity
            )
        return self.orientation not in ("+", "-") or (self.orientation == "+") == forwards


def crossings(drive: Drive, wanted: Callable[[Signal], bool]) -> list[LineCrossing]:
    """All lines of certain signals that a drive passes in the direction of its lane, in ascending time."""
    lines: dict[str, list[_Line]] = {}
    found: list[LineCrossing] = []
    columns = drive.columns
    for row in range(1, len(columns["time"])):
        for road_id, lane_id, low, high, forwards, entered in _ways(drive, row):
            road = drive.network.roads[road_id]
            if (road.direction(lane_id, min(max(low, 0.0), road.length)) > 0) != forwards:
                continue
            if road_id not in lines:
                lines[road_id] = list(_lines(drive, road, wanted))
            for line in lines[road_id]:
                passed = (
                    entered
                    if road.junction_id is not None
                    else (low < line.s <= high if forwards else low <= line.s < high)
                )
                if passed and line.holds(lane_id, forwards):
                    found.append(LineCrossing(float(columns["time"][row]), row, line.signal))
    return found


def _lines(drive: Drive, road: Road, wanted: Callable[[Signal], bool]) -> Iterator[_Line]:
    """Signals and references to signals of a road."""
    for signal in road.signals:
        if wanted(signal):
            yield _Line(signal, signal.s, signal.orientation, signal.validity)
    for reference in road.signal_references:
        referred = drive.network.signals.get(reference.signal_id)
        if referred is not None and wanted(referred):
            yield _Line(referred, reference.s, reference.orientation, reference.validity)


def _ways(drive: Drive, row: int) -> Iterator[tuple[str, int, float, float, bool, bool]]:
    """Stretches of road between a row and the one before: road, lane, least and greatest s, whether to +s, whether entered."""
    columns = drive.columns
    (road_a, road_b), (lane_a, lane_b), (a, b) = (
        columns[name][row - 1 : row + 1].tolist() for name in ("road_id", "lane_id", "s")
    )
    if road_a == road_b:
        if a != b:
            yield road_a, lane_b, min(a, b), max(a, b), b > a, False
        return
    roads = drive.network.roads
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


_FOR_WALKERS = "1000002"
"""OpenDRIVE's type of lights for pedestrians."""


@criterion(
    "RunningRedLightTest",
    unit="red lights",
    summary="it crosses no stop line of a traffic light that is red",
    on_roads=True,
)
def running_red_light(drive: Drive) -> CriterionFinding:
    """Look up the state of each light in the moment in which the reference point passes its line."""
    found = crossings(drive, _is_light)
    states = [_state(drive, crossing) for crossing in found]
    red = [
        c
        for c, state in zip(found, states, strict=True)
        if state is not None and link_state(state) in (RED, RED_YELLOW)
    ]
    if red:
        return CriterionFinding(
            False,
            float(len({c.row for c in red})),
            f"ran the red light {red[0].signal.id} at {red[0].time:.2f} s",
        )
    dark = [c for c, state in zip(found, states, strict=True) if state is None]
    if dark:
        reason = f"passed the light {dark[0].signal.id} at {dark[0].time:.2f} s, to which the scenario gives no state"
        return CriterionFinding(None, None, reason)
    return CriterionFinding(
        True,
        0.0,
        f"traffic lights passed: {len(found)}, none of them red"
        if found
        else "came past no traffic light",
    )


def _is_light(signal: Signal) -> bool:
    return signal.dynamic and signal.type != _FOR_WALKERS


def _state(drive: Drive, crossing: LineCrossing) -> str | None:
    """The state of a crossing's light at that time; None where it has none."""
    history = drive.lights.get(crossing.signal.id, [])
    index = bisect_right(history, crossing.time, key=itemgetter(0)) - 1
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
    """Look for a standstill with the front close to each line, up to the moment in which the reference point passes it."""
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
    before = np.concatenate([[0.0], np.cumsum(drive.steps)])[: crossing.row + 1]
    front = drive.track.box.x + drive.track.box.length / 2
    near = before >= before[-1] - front - _NEAR
    return bool((np.abs(drive.columns["speed"][: crossing.row + 1][near]) < _STANDING).any())
