"""Where a drive passes the lines of traffic lights and signs.

A signal holds at its s, on the lanes of its validity. On the connecting roads of a junction, to which signal references point
that stand for the whole junction, it holds where the junction is entered.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

from runner.criteria.criterion import Drive
from xodr.model import Signal
from xodr.road import Road


class Crossing(NamedTuple):
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
            return any(low <= lane_id <= high or high <= lane_id <= low for low, high in self.validity)
        return self.orientation not in ("+", "-") or (self.orientation == "+") == forwards


def crossings(drive: Drive, wanted: Callable[[Signal], bool]) -> list[Crossing]:
    """All lines of certain signals that a drive passes in the direction of its lane, in ascending time."""
    lines: dict[str, list[_Line]] = {}
    found: list[Crossing] = []
    columns = drive.columns
    for row in range(1, len(columns["time"])):
        for road_id, lane_id, low, high, forwards, entered in _ways(drive, row):
            road = drive.network.roads[road_id]
            if (road.direction(lane_id, min(max(low, 0.0), road.length)) > 0) != forwards:
                continue
            if road_id not in lines:
                lines[road_id] = list(_lines(drive, road, wanted))
            for line in lines[road_id]:
                passed = entered if road.junction_id is not None else (low < line.s <= high if forwards else low <= line.s < high)
                if passed and line.holds(lane_id, forwards):
                    found.append(Crossing(float(columns["time"][row]), row, line.signal))
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
    yield (road_a, lane_a, a, roads[road_a].length, True, False) if to_end else (road_a, lane_a, 0.0, a, False, False)
    beyond = roads[road_b].length + 1.0  # so that a line at the very border counts
    yield (road_b, lane_b, -1.0, b, True, True) if from_start else (road_b, lane_b, b, beyond, False, True)
