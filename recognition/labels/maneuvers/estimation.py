"""Estimation of parameters from a recording: begin and end, gap, speeds; reconstruction; cutting
into units."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from recognition.labels import rules
from recognition.labels.changes import stays
from recognition.labels.maneuvers.parameters import (
    ACCELERATION,
    BRAKING,
    CUT_IN,
    CUT_OUT,
    LANE_CHANGE,
    PARAMETERS,
    Unit,
    Values,
)
from recognition.labels.scene import ABSENT, Scene
from schemas.common.array_types import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class LaneCoordinates:
    """Rows of a scene along and across their lanes.

    Attributes:
        scene: the rows.
        longitudinal: distance along the lanes, m, counted on from row to row; differences count
            within a course only.
        lateral: distance to the left, m, likewise.
        first, last: first and last row of each row's course, a part of a track along connected
            lanes without missing frames.
    """

    scene: Scene
    longitudinal: FloatArray
    lateral: FloatArray
    first: IntArray
    last: IntArray

    def gap(self, ego: int, other: int) -> float:
        """Distance (m) from the front of one row's vehicle to the rear of another's, as the former
        is headed."""
        scene = self.scene
        dx, dy, h = scene.x[other] - scene.x[ego], scene.y[other] - scene.y[ego], scene.h[ego]
        return float(dx * np.cos(h) + dy * np.sin(h) + scene.rear[other] - scene.front[ego])

    def row(self, track: int, frame: int) -> int | None:
        """The row of a track in a frame; None where it has none."""
        # Rows are sorted by track, then frame.
        lo, hi = np.searchsorted(self.scene.track, [track, track + 1])
        place = lo + int(np.searchsorted(self.scene.frame[lo:hi], frame))
        return place if place < hi and self.scene.frame[place] == frame else None

    def in_lane_since(self, row: int) -> int:
        """The first row from which on a track has been in the lane that it is in at a row."""
        lanes = self.scene.changes.lane[self.first[row] : row + 1]
        others = np.flatnonzero(lanes != lanes[-1])
        return int(self.first[row] + (others[-1] + 1 if len(others) else 0))


def lane_motion(scene: Scene) -> LaneCoordinates:
    """The motion along and across the lanes of all rows of a scene."""
    changes = scene.changes
    dx, dy = np.diff(scene.x, prepend=scene.x[:1]), np.diff(scene.y, prepend=scene.y[:1])
    across = np.diff(changes.side, prepend=changes.side[:1])
    ahead = dx * np.cos(scene.h) + dy * np.sin(scene.h)
    # Pythagoras: what a step covers beside its lateral part, with the sign of driving forwards.
    along = np.copysign(np.sqrt(np.maximum(dx**2 + dy**2 - across**2, 0.0)), ahead)
    begins = np.diff(changes.course, prepend=-1) != 0
    starts = np.flatnonzero(begins)
    ends = np.append(starts[1:], len(begins)) - 1
    return LaneCoordinates(
        scene,
        np.cumsum(np.where(begins, 0.0, along)),
        changes.side,
        starts[changes.course],
        ends[changes.course],
    )


_WEIGHT = 10.0
"""Weight (s) of 1 m/s of speed relative to 1 m of distance when speeds are fitted: they stay near
the speeds at the instants of their names (0.3 to 0.6 m/s on our motorways), and still follow the
distance"""
EVERY = 0.2
"""Resolution (s) of the motion that speeds are fitted to"""


def distance_model(time: FloatArray, duration: float, rest: float) -> FloatArray:
    """Return the distance per 1 m/s of start, end and final speed since the start of the manoeuvre
    (n, 3), s.

    Args:
        time: instants counted from the manoeuvre's beginning (n,), s.
        duration: of the manoeuvre, s. rest: from its end to the scene's, s.
    """
    # The speed is constant before, changes linearly during the manoeuvre and linearly over the
    # rest: the distance is linear in the three speeds, so that least squares fit them directly.
    during = np.clip(time, 0.0, duration)
    after = np.clip(time - duration, 0.0, None)
    gained, settled = (
        during**2 / (2.0 * duration),
        after**2 / (2.0 * rest) if rest > 0.0 else 0.0 * after,
    )
    return np.stack(
        [np.minimum(time, 0.0) + during - gained, gained + after - settled, settled], axis=1
    )


def fit_speeds(model: FloatArray, way: FloatArray, seen: FloatArray) -> FloatArray:
    """Start, end and final speed (3,), m/s, that follow a way best and stay near the speeds seen at
    their instants.

    Args:
        model: what each speed adds to the way (n, 3), s (`distance_model`).
        way: since the manoeuvre began (n,), m.
        seen: speeds at its beginning, its end, and the scene's end (3,), m/s.
    """
    # Rows of the identity pull each speed towards the one that was seen at its instant.
    target = np.concatenate([way, _WEIGHT * seen])
    found = np.linalg.lstsq(np.vstack([model, _WEIGHT * np.eye(3)]), target)[0]
    return np.maximum(found, 0.0)


ROLES = tuple(PARAMETERS)
RATE = 1.0
"""Samples a second by which motions are compared."""


class Errors(NamedTuple):
    """Root mean squares over one unit's scene, m: across the lane (RMSE_t) and
    along it (RMSE_s).
    """

    lateral: float
    longitudinal: float


def reconstruct(row: FloatArray, shift: float, time: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Way along the lane and to the left since the manoeuvre began.

    Args:
        row: the seven parameters (7,).
        shift: lateral way of the whole lane change, m, positive to the left; 0 for none.
        time: instants counted from the manoeuvre's beginning (n,), s.
    """
    values = dict(zip(ROLES, row.tolist(), strict=True))
    speeds = np.array([values["start_speed"], values["end_speed"], values["final_speed"]])
    share = np.clip(time / values["duration"], 0.0, 1.0)
    return distance_model(time, values["duration"], values["rest_time"]) @ speeds, shift * progress(
        share
    )


def progress(share: FloatArray) -> FloatArray:
    """Share of the lateral way by share of the time (DynamicsShape sinusoidal)."""
    return 0.5 - 0.5 * np.cos(np.pi * share)


def errors(motion: LaneCoordinates, unit: Unit, row: FloatArray) -> Errors:
    """Return the errors of the reconstruction at 1 Hz through the scene, aligned at the start of
    the manoeuvre.

    Source: METHOD.md §3, RMSE_t and RMSE_s, which are means of these over all units.
    """
    every = motion.scene.rows(1.0 / RATE)
    before = np.arange(unit.start, unit.first - 1, -every)[::-1]
    rows = np.concatenate([before, np.arange(unit.start + every, unit.last + 1, every)])
    time = motion.scene.time[rows] - motion.scene.time[unit.start]
    along, across = reconstruct(row, unit.shift, time)
    compared = (motion.lateral, across), (motion.longitudinal, along)
    return Errors(
        *(
            float(np.sqrt(np.mean((was[rows] - was[unit.start] - made) ** 2)))
            for was, made in compared
        )
    )


EVERY = 0.2
"""Resolution (s) of beginnings, durations and the motion that is compared."""
_SCENE = PARAMETERS["start_time"].high
"""Time (s) before and after the border is crossed in which the motion is compared, as far as it is
this lane change's"""

_MARGIN = 0.2
"""Time (s) for which there has to be a lane to change to before a lane change begins:
reconstructions are decimetres off"""


class LaneChange(NamedTuple):
    """A lane change.

    Attributes:
        start, end: rows of its first and last instant.
        row: first row beyond the border.
        shift: lateral distance, m, to the left.
    """

    start: int
    end: int
    row: int
    shift: float


def lane_changes(motion: LaneCoordinates) -> list[LaneChange]:
    """The lane changes of a scene in the order of rows, those whose border is crossed as the rules
    have it."""
    changes = motion.scene.changes
    rows, lacking, margin = changes.row.tolist(), _lacking(motion), motion.scene.rows(_MARGIN)
    found: list[LaneChange] = []
    for row, left, after in zip(
        rows, changes.left.tolist(), (*rows, len(motion.lateral))[1:], strict=True
    ):
        first, last = int(motion.first[row]), min(int(motion.last[row]), after - 1)
        if found and found[-1].end > first:
            first = found[-1].end
        # A lane change cannot begin where there is no lane to change to.
        alone = np.flatnonzero(lacking[left][first:row])
        earliest = min(first + int(alone[-1]) + 1 + margin, row - 1) if len(alone) else first
        change = _fitted(motion, row, first, last, earliest)
        if change is not None:
            found.append(change)
    return found


def _lacking(motion: LaneCoordinates) -> tuple[BoolArray, BoolArray]:
    """Rows without a lane to the right of their own, and those without one to the left; short stays
    in a lane don't count."""
    scene = motion.scene
    strips, steps = scene.site.lanes.strips, np.cumsum(scene.changes.step)
    own = steps - steps[motion.first] == scene.changes.lane
    places = {(strip.road, strip.section, strip.forward, strip.place) for strip in strips}
    right, left = (
        np.array(
            [
                (strip.road, strip.section, strip.forward, strip.place + side) in places
                for strip in strips
            ]
            + [False]
        )
        for side in (1, -1)
    )
    return own & ~right[scene.strip], own & ~left[scene.strip]


def _fitted(
    motion: LaneCoordinates, row: int, first: int, last: int, earliest: int
) -> LaneChange | None:
    """The lane change across the border at a row within two other rows; None where there is no room
    for one.

    Args:
        earliest: row at which it may begin.
    """
    scene, every = motion.scene, motion.scene.rows(EVERY)
    low, high = (PARAMETERS["duration"].low, PARAMETERS["duration"].high)
    compared = np.arange(
        max(first, row - scene.rows(_SCENE)), min(last, row + scene.rows(_SCENE)) + 1, every
    )
    starts = np.arange(max(earliest, row - scene.rows(high)), row, every)
    sizes = np.arange(scene.rows(low), scene.rows(high) + 1, every)
    start, size = (grid.ravel() for grid in np.meshgrid(starts, sizes, indexing="ij"))
    possible = (start + size > row) & (start + size <= last)
    start, size = start[possible, None], size[possible, None]
    if not len(start):
        return None
    centre = motion.lateral[row] - scene.offset[row]
    began = motion.lateral[start]
    # All beginnings and durations at once: the least squares of a sinusoidal path decide.
    model = began + (centre - began) * progress(np.clip((compared - start) / size, 0.0, 1.0))
    best = int(np.square(motion.lateral[compared] - model).sum(axis=1).argmin())
    return LaneChange(
        int(start[best, 0]),
        int(start[best, 0] + size[best, 0]),
        row,
        float(centre - began[best, 0]),
    )


WIDE = 0.5
"""Half the time (s) over which jerk is a difference of speeds: what is recorded is not smooth
enough for less"""
_LEAD_IN = 1.0
"""Time (s) before a unit in which its acceleration may begin: units begin where it is already there
"""


def onset_jerk(motion: LaneCoordinates, unit: Unit, change: float) -> float:
    """Greatest jerk (m/s³) towards the greatest acceleration of a unit, from a second before it on.

    It is the second difference of the speed over twice `WIDE`: the mean of the jerk in that time,
    by a triangular window. NaN where the speed does not change, or its acceleration does not build
    up in what was recorded.

    Args:
        change: of the speed in the unit, m/s; its sign says which way counts.
    """
    scene, half = motion.scene, motion.scene.rows(WIDE)
    begin = max(unit.start - scene.rows(_LEAD_IN), int(motion.first[unit.start]))
    peak = begin + int(np.argmax(np.sign(change) * scene.acceleration[begin : unit.end + 1]))
    first, last = (
        max(begin - half, int(motion.first[unit.start])),
        min(peak + half, int(motion.last[unit.start])),
    )
    speed = scene.speed[first : last + 1]
    if change == 0.0 or len(speed) <= 2 * half:
        return np.nan
    jerk = (
        np.sign(change)
        * (speed[2 * half :] - 2.0 * speed[half:-half] + speed[: -2 * half])
        / (half * scene.step) ** 2
    )
    greatest = float(jerk.max())
    return greatest if greatest > 0.0 else np.nan


class UnitEstimate(NamedTuple):
    """Estimated parameters of a unit.

    Attributes:
        values: of its parameters.
        other_speed: initial speed of the other vehicle, m/s; 0 without one.
        jerk: how suddenly the acceleration of the manoeuvre builds up, m/s³; NaN where that can't
            be said.
    """

    values: Values
    other_speed: float
    jerk: float


def estimate(motion: LaneCoordinates, unit: Unit) -> UnitEstimate | None:
    """The values of a unit's parameters.

    The gap is that when the manoeuvre begins. The speeds are those with which the reconstruction
    comes closest to the recorded distance and to the speeds recorded at the manoeuvre's beginning
    and end and at the scene's end.

    Returns:
        None where the two are not one ahead of the other, or the other was not recorded when the
        manoeuvre begins.
    """
    scene, gap, other_speed = motion.scene, None, 0.0
    if not unit.alone:
        other = motion.row(unit.other, int(scene.frame[unit.start]))
        if other is None:
            return None
        gap = (
            motion.gap(unit.start, other)
            if unit.kind == LANE_CHANGE
            else motion.gap(other, unit.start)
        )
        if gap <= 0.0:
            return None
        other_speed = float(scene.speed[other])
    start_time, duration, rest_time = np.diff(
        scene.time[[unit.first, unit.start, unit.end, unit.last]]
    ).tolist()
    start, end, final = _speeds(motion, unit, duration, rest_time).tolist()
    jerk = onset_jerk(motion, unit, end - start)
    return UnitEstimate(
        Values(gap, start, start_time, end, duration, final, rest_time), other_speed, jerk
    )


def _speeds(motion: LaneCoordinates, unit: Unit, duration: float, rest_time: float) -> FloatArray:
    """Start, end and final speed (3,), m/s."""
    scene = motion.scene
    rows = np.arange(unit.first, unit.last + 1, scene.rows(EVERY))
    distance = motion.longitudinal[rows] - motion.longitudinal[unit.start]
    model = distance_model(scene.time[rows] - scene.time[unit.start], duration, rest_time)
    return fit_speeds(model, distance, scene.speed[[unit.start, unit.end, unit.last]])


@dataclass(frozen=True)
class Thresholds:
    """acceleration: m/s², beyond which a vehicle brakes or accelerates. least: s, for which it does
    so at least."""

    acceleration: float = 0.5
    least: float = 1.0


class Segmentation:
    """The lane changes of a recording, and units of them and between them.

    Attributes:
        motion: of the recording.
        changes: its lane changes in the order of rows.
    """

    def __init__(self, motion: LaneCoordinates) -> None:
        self.motion, self.changes = motion, lane_changes(motion)
        self._starts = np.array([change.start for change in self.changes], np.int64)
        self._ends = np.array([change.end for change in self.changes], np.int64)

    def nearest_change(self, actor: int, time: float, reach: float) -> int | None:
        """Index of the lane change of a track that crosses the border nearest to a time (s), at
        most `reach` (s) from it."""
        scene = self.motion.scene
        own = [
            index for index, change in enumerate(self.changes) if scene.track[change.row] == actor
        ]
        index = min(
            own,
            key=lambda index: abs(float(scene.time[self.changes[index].row]) - time),
            default=None,
        )
        return (
            index
            if index is not None and abs(scene.time[self.changes[index].row] - time) <= reach
            else None
        )

    def leader(self, index: int) -> int:
        """Track ahead of the lane-changing vehicle in its lane, at the start of the change; ABSENT
        for none in sight."""
        scene = self.motion.scene
        lead = int(scene.leads.row[self.changes[index].start])
        return int(scene.track[lead]) if lead != ABSENT else ABSENT

    def of_change(self, index: int, kind: str, other: int) -> Unit:
        """Return the unit of a lane change, by index, for one affected vehicle."""
        change = self.changes[index]
        return self.between(kind, other, change.start, change.end, change.shift)

    def between(self, kind: str, other: int, start: int, end: int, shift: float = 0.0) -> Unit:
        """The unit from one row of a track to another; its scene is bounded by the lane changes
        before and after it."""
        before, after = self._ends[self._ends <= start], self._starts[self._starts >= end]
        first = int(before[-1]) if len(before) else 0
        last = int(after[0]) if len(after) else len(self.motion.lateral)
        return _unit(self.motion, kind, other, start, end, first, last, shift)


def segment(motion: LaneCoordinates, thresholds: Thresholds = Thresholds()) -> list[Unit]:
    """Return the units of a recording, by actor and time; a lane change is a unit for each affected
    vehicle."""
    segmentation = Segmentation(motion)
    units = [*_lane_changes(segmentation), *_phases(motion, segmentation.changes, thresholds)]
    return sorted(units, key=lambda unit: (unit.start, unit.kind, unit.other))


def _lane_changes(segmentation: Segmentation) -> Iterator[Unit]:
    scene, changes = segmentation.motion.scene, segmentation.changes
    concerned: dict[int, list[tuple[str, int]]] = {change.row: [] for change in changes}
    for kind, found in ((CUT_IN, rules.cut_ins(scene)), (CUT_OUT, rules.cut_outs(scene))):
        for ego, row in zip(found.ego.tolist(), found.other.tolist(), strict=True):
            concerned.get(row, []).append((kind, int(scene.track[ego])))
    for index, change in enumerate(changes):
        leader = segmentation.leader(index)
        # One change, several units: for its own leader, and for each vehicle that it cuts in on or
        # leaves.
        own = [(LANE_CHANGE, leader)] if leader != ABSENT else []
        for kind, other in (*own, *concerned[change.row]):
            yield segmentation.of_change(index, kind, other)


def _phases(
    motion: LaneCoordinates, changes: list[LaneChange], thresholds: Thresholds
) -> Iterator[Unit]:
    """Braking and acceleration of vehicles that have a follower then, apart from lane changes."""
    scene = motion.scene
    sign = np.where(
        np.abs(scene.acceleration) > thresholds.acceleration, np.sign(scene.acceleration), 0.0
    ).astype(np.int64)
    # +1 where a change begins, -1 where it ends: the running sum is positive within changes.
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
        yield _unit(
            motion,
            BRAKING if busy[row] < 0 else ACCELERATION,
            int(scene.track[follower]),
            row,
            end,
            first,
            last,
        )


def _unit(
    motion: LaneCoordinates,
    kind: str,
    other: int,
    start: int,
    end: int,
    first: int,
    last: int,
    shift: float = 0.0,
) -> Unit:
    """A unit whose scene is cut to the actor's course and to what the parameters reach."""
    scene = motion.scene
    first = max(first, int(motion.first[start]), start - scene.rows(PARAMETERS["start_time"].high))
    last = min(last, int(motion.last[start]), end + scene.rows(PARAMETERS["rest_time"].high))
    return Unit(kind, int(scene.track[start]), other, start, end, first, last, shift)
