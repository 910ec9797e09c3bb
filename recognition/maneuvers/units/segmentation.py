"""Cutting a recording into units: braking, acceleration, lane change, cut in, cut out.

A unit's scene reaches from the end of what its actor did before to the beginning of what it does next, and no further than the
parameters do: lane changes are bounded by lane changes, phases of speed by both.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from recognition.labels import cuts
from recognition.labels.scene.leads import NOBODY
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


def segment(motion: LaneMotion, thresholds: Thresholds = Thresholds()) -> list[Unit]:
    """The units of a recording, by actor and time; a lane change is a unit for each one whom it concerns."""
    changes = lane_changes(motion)
    units = [*_lane_changes(motion, changes), *_phases(motion, changes, thresholds)]
    return sorted(units, key=lambda unit: (unit.start, unit.kind, unit.other))


def _lane_changes(motion: LaneMotion, changes: list[LaneChange]) -> Iterator[Unit]:
    scene = motion.scene
    concerned: dict[int, list[tuple[str, int]]] = {change.row: [] for change in changes}
    for kind, found in ((CUT_IN, cuts.cut_ins(scene)), (CUT_OUT, cuts.cut_outs(scene))):
        for ego, row in zip(found.ego.tolist(), found.other.tolist(), strict=True):
            concerned.get(row, []).append((kind, int(scene.track[ego])))
    for place, change in enumerate(changes):
        before, after = changes[place - 1] if place else None, changes[place + 1] if place + 1 < len(changes) else None
        first = before.end if before else 0
        last = after.start if after else len(motion.way)
        lead = int(scene.leads.row[change.start])
        own = [(LANE_CHANGE, int(scene.track[lead]))] if lead != NOBODY else []
        for kind, other in (*own, *concerned[change.row]):
            yield _unit(motion, kind, other, change.start, change.end, first, last, change.shift)


def _phases(motion: LaneMotion, changes: list[LaneChange], thresholds: Thresholds) -> Iterator[Unit]:
    """Braking and acceleration of whoever has a follower then, apart from lane changes."""
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
        if busy[row] == 2 or follower == NOBODY:
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
