"""Changes of lane: when a track goes from one lane to the one beside it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from recognition.labels.scene.rows import SceneRows
from recognition.labels.scene.stays import held, stays
from recognition.labels.scene.turning import along_road
from recognition.sites.lanes import NOWHERE, LaneGraph
from xodr.array_types import BoolArray, FloatArray, IntArray


class Changes(NamedTuple):
    """Changes of lane: the first row in the new lane, whether it is to the left, and the lateral displacement towards it, m."""

    row: IntArray
    left: BoolArray
    shift: FloatArray


@dataclass(frozen=True, eq=False)
class LaneChanges:
    """All changes of lane that are held, and the lanes that they lead through.

    Attributes:
        lane: number of each row's lane within its course, counted to the left, short stays left out.
        step: how many lanes to the left each row is of the one before, short stays included.
        course: number of the course of each row: a part of a track that goes on along connected lanes without missing frames.
        side: distance of each row to the left of where its course begins, m, following the lanes.
        row: the first row in the new lane, one for each change; `row - 1` is the last one in the old lane.
        left: whether the change is to the left.
        shift: lateral displacement towards the new lane about the change, m.
        partial: changes of which only a part may have been recorded: the track begins or ends within `rules.shift_time`.
    """

    lane: IntArray
    step: IntArray
    course: IntArray
    side: FloatArray
    row: IntArray
    left: BoolArray
    shift: FloatArray
    partial: Changes


def lane_changes(scene: SceneRows) -> LaneChanges:
    """The lane changes of all tracks: one lane to the side, with both lanes held for `rules.hold`; partial ones apart.

    Borders that are crossed in a turn are none.
    """
    steps, related = _steps(scene.site.lanes, scene.strip)
    begins = np.ones(len(scene.track), bool)
    begins[1:] = (scene.first[1:] != scene.first[:-1]) | ~related
    course = np.cumsum(begins) - 1
    steps = np.where(begins, 0, np.concatenate([[0], steps]))
    raw = np.cumsum(steps)
    raw -= raw[_first(begins)]
    hold, side = scene.rows(scene.rules.hold), _side(scene, steps, begins)
    lane = held(raw, course, hold)
    row, left = _sideways(lane, begins)
    kept = _is_held(lane, course, row, hold) & along_road(scene, row)
    row, left = row[kept], left[kept]
    shift = _shifts(scene, lane, course, side, row, left)
    return LaneChanges(lane, steps, course, side, row, left, shift, _partial(scene, raw, course, side, begins))


def _sideways(lane: IntArray, begins: BoolArray) -> tuple[IntArray, BoolArray]:
    """Rows with which a stay in the lane beside begins, and whether that is the left one."""
    row = np.flatnonzero((np.abs(np.diff(lane)) == 1) & ~begins[1:]) + 1
    return row, lane[row] > lane[row - 1]


def _partial(scene: SceneRows, raw: IntArray, course: IntArray, side: FloatArray, begins: BoolArray) -> Changes:
    """Changes about which not all is recorded that their displacement is measured in."""
    lane = _held_at_ends(scene, raw, course)
    row, left = _sideways(lane, begins)
    reach = scene.rows(scene.rules.shift_time)
    near = (row - scene.first[row] < reach) | (scene.last[row] - row < reach)
    row, left = row[near], left[near]
    kept = along_road(scene, row)
    row, left = row[kept], left[kept]
    return Changes(row, left, _shifts(scene, lane, course, side, row, left))


def _held_at_ends(scene: SceneRows, raw: IntArray, course: IntArray) -> IntArray:
    """Lanes, of which those in which a track begins or ends need not be held for `rules.hold`: that may be cut."""
    start, size = stays(raw, course)
    last = start + size - 1
    at_end = (start == scene.first[start]) | (last == scene.last[last])
    return held(raw, course, np.where(at_end, scene.rows(scene.rules.partial_hold), scene.rows(scene.rules.hold)))


def _steps(lanes: LaneGraph, strip: IntArray) -> tuple[IntArray, BoolArray]:
    """How many lanes to the left each row but the first is of the row before, and whether these lanes are connected."""
    before, after = strip[:-1], strip[1:]
    steps, related = np.zeros(len(before), np.int64), np.ones(len(before), bool)
    moved = np.flatnonzero(before != after)
    pairs, which = np.unique(np.stack([before[moved], after[moved]], axis=1), axis=0, return_inverse=True)
    found = [lanes.lanes_left(a, b) if NOWHERE not in (a, b) else None for a, b in pairs.tolist()]
    steps[moved] = np.array([step or 0 for step in found], np.int64)[which.reshape(-1)]
    related[moved] = np.array([step is not None for step in found], bool)[which.reshape(-1)]
    return steps, related


def _first(begins: BoolArray) -> IntArray:
    """The first row of each row's course."""
    return np.maximum.accumulate(np.where(begins, np.arange(len(begins)), 0))


def _is_held(lane: IntArray, course: IntArray, row: IntArray, least: int) -> BoolArray:
    """Whether the stays before and after each of the rows, with which a stay begins, are long enough."""
    starts, sizes = stays(lane, course)
    place = np.searchsorted(starts, row)
    return (sizes[place] >= least) & (sizes[place - 1] >= least)


def _side(scene: SceneRows, steps: IntArray, begins: BoolArray) -> FloatArray:
    """Lateral way to the left since each course began: changes of the lane offset, or of t where the lane changes."""
    lanes, before, after = scene.site.lanes, scene.strip[:-1], scene.strip[1:]
    to_road = np.diff(scene.offset) + steps[1:] * 0.5 * (lanes.width[before] + lanes.width[after])
    to_lane = np.where(lanes.road[before] == lanes.road[after], np.diff(scene.aside), to_road)
    moved = np.concatenate([[0.0], np.where(steps[1:] == 0, np.diff(scene.offset), to_lane)])
    side = np.cumsum(np.where(begins, 0.0, moved))
    return side - side[_first(begins)]


def _shifts(scene: SceneRows, lane: IntArray, course: IntArray, side: FloatArray, rows: IntArray, left: BoolArray) -> FloatArray:
    """Displacement from the outermost place before to the outermost place after each change, within its two stays."""
    reach = scene.rows(scene.rules.shift_time)
    starts, sizes = stays(lane, course)
    place = np.searchsorted(starts, rows)
    earliest = np.maximum(rows - reach, starts[place - 1])
    latest = np.minimum(rows + reach, rows + sizes[place])
    towards = np.where(left, 1.0, -1.0)
    shifts = [
        (sign * side[row:end]).max() - (sign * side[start:row]).min()
        for row, start, end, sign in zip(rows.tolist(), earliest.tolist(), latest.tolist(), towards.tolist(), strict=True)
    ]
    return np.array(shifts, np.float64)
