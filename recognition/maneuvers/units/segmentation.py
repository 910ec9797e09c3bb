"""Cutting a recording into units: braking, acceleration, lane change, cut in, cut out.

A unit's scene reaches from the end of what its actor did before to the beginning of what it does next, and no further than the
parameters do: lane changes are bounded by lane changes, phases of speed by both.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from recognition.labels import cuts
from recognition.labels.scene.leads import ABSENT
from recognition.labels.scene.stays import stays
from recognition.maneuvers.estimation.lane_change import LaneChange, lane_changes
from recognition.maneuvers.estimation.motion import LaneMotion
from recognition.maneuvers.parameters import PARAMETERS
from recognition.maneuvers.unit import ACCELERATION, BRAKING, CUT_IN, CUT_OUT, LANE_CHANGE, Unit


@dataclass(frozen=True)
class Thresholds:
    """acceleration: m/s², beyond which a vehicle brakes or accelerates. least: s, for which it does so at least."""

    acceleration: float = 0.5
    least: float = 1.0


class Segmentation:
    """The lane changes of a recording, and units of them and between them.

    Attributes:
        motion: of the recording.
        changes: its lane changes in the order of rows.
    """

    def __init__(self, motion: LaneMotion) -> None:
        self.motion, self.changes = motion, lane_changes(motion)
        self._starts = np.array([change.start for change in self.changes], np.int64)
        self._ends = np.array([change.end for change in self.changes], np.int64)

    def nearest_change(self, actor: int, time: float, reach: float) -> int | None:
        """Index of the lane change of a track that crosses the border nearest to a time (s), at most `reach` (s) from it."""
        scene = self.motion.scene
        own = [index for index, change in enumerate(self.changes) if scene.track[change.row] == actor]
        index = min(own, key=lambda index: abs(float(scene.time[self.changes[index].row]) - time), default=None)
        return index if index is not None and abs(scene.time[self.changes[index].row] - time) <= reach else None

    def leader(self, index: int) -> int:
        """Track ahead in the lane of who changes it, when the change begins; ABSENT for none in sight."""
        scene = self.motion.scene
        lead = int(scene.leads.row[self.changes[index].start])
        return int(scene.track[lead]) if lead != ABSENT else ABSENT

    def of_change(self, index: int, kind: str, other: int) -> Unit:
        """The unit of a lane change, by index, for one whom it concerns."""
        change = self.changes[index]
        return self.between(kind, other, change.start, change.end, change.shift)

    def between(self, kind: str, other: int, start: int, end: int, shift: float = 0.0) -> Unit:
        """The unit from one row of a track to another; its scene is bounded by the lane changes before and after it."""
        before, after = self._ends[self._ends <= start], self._starts[self._starts >= end]
        first = int(before[-1]) if len(before) else 0
        last = int(after[0]) if len(after) else len(self.motion.lateral)
        return _unit(self.motion, kind, other, start, end, first, last, shift)


def segment(motion: LaneMotion, thresholds: Thresholds = Thresholds()) -> list[Unit]:
    """The units of a recording, by actor and time; a lane change is a unit for each one whom it concerns."""
    segmentation = Segmentation(motion)
    units = [*_lane_changes(segmentation), *_phases(motion, segmentation.changes, thresholds)]
    return sorted(units, key=lambda unit: (unit.start, unit.kind, unit.other))


def _lane_changes(segmentation: Segmentation) -> Iterator[Unit]:
    scene, changes = segmentation.motion.scene, segmentation.changes
    concerned: dict[int, list[tuple[str, int]]] = {change.row: [] for change in changes}
    for kind, found in ((CUT_IN, cuts.cut_ins(scene)), (CUT_OUT, cuts.cut_outs(scene))):
        for ego, row in zip(found.ego.tolist(), found.other.tolist(), strict=True):
            concerned.get(row, []).append((kind, int(scene.track[ego])))
    for index, change in enumerate(changes):
        leader = segmentation.leader(index)
        own = [(LANE_CHANGE, leader)] if leader != ABSENT else []
        for kind, other in (*own, *concerned[change.row]):
            yield segmentation.of_change(index, kind, other)


def _phases(motion: LaneMotion, changes: list[LaneChange], thresholds: Thresholds) -> Iterator[Unit]:
    """Braking and acceleration of vehicles that have a follower then, apart from lane changes."""
    scene = motion.scene
    sign = np.where(np.abs(scene.acceleration) > thresholds.acceleration, np.sign(scene.acceleration), 0.0).astype(np.int64)
    changing = np.zeros(len(sign) + 1, np.int64)
    np.add.at(changing, [change.start for change in changes], 1)
    np.add.at(changing, [change.end for change in changes], -1)
    busy = np.where(np.cumsum(changing)[:-1] > 0, 2, sign)
    start, size = stays(busy, scene.changes.course)
    long = size >= scene.rows(thresholds.least)
    bounds = np.flatnonzero(long & (busy[start] != 0) | (busy[start] == 2))
    for place, index in enumerate(bounds.tolist()):
        row, end = int(start[index]), int(start[index] + size[index] - 1)
        follower = int(scene.leads.follower[row])
        if busy[row] == 2 or follower == ABSENT:
            continue
        first = int(start[bounds[place - 1]] + size[bounds[place - 1]]) if place else 0
        last = int(start[bounds[place + 1]]) - 1 if place + 1 < len(bounds) else len(sign)
        yield _unit(motion, BRAKING if busy[row] < 0 else ACCELERATION, int(scene.track[follower]), row, end, first, last)


def _unit(motion: LaneMotion, kind: str, other: int, start: int, end: int, first: int, last: int, shift: float = 0.0) -> Unit:
    """A unit whose scene is cut to the actor's course and to what the parameters reach."""
    scene = motion.scene
    first = max(first, int(motion.first[start]), start - scene.rows(PARAMETERS["start_time"].high))
    last = min(last, int(motion.last[start]), end + scene.rows(PARAMETERS["rest_time"].high))
    return Unit(kind, int(scene.track[start]), other, start, end, first, last, shift)
