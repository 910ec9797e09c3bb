"""Rules 7 and 8: from a ramp onto the through lanes of a motorway, and off them.

The way leads from lane to lane by a change of lane (from an acceleration lane) or along lanes that follow each other (where a
ramp becomes a lane). Only the first has a lateral shift that can be compared: lanes that follow each other shift by themselves.
"""

from __future__ import annotations

import numpy as np

from recognition.labels.classes import Label
from recognition.labels.hits import Hits, alone
from recognition.labels.scene.scene import Scene
from recognition.sites import Role
from xodr.array_types import BoolArray, FloatArray, IntArray


def ramp_entering(scene: Scene) -> Hits:
    """7: from a ramp, along which ego drove `rules.ramp_length` or more, onto a main lane."""
    ramp = scene.has_role(Role.ON_RAMP, Role.WEAVING)
    row, shift = _transitions(scene, ramp, scene.has_role(Role.MAIN))
    way, begin = _way_on(scene, ramp), _course_ends(scene)[0][row]
    return _hits(scene, Label.RAMP_ENTERING, row, way[row] - way[begin], shift, cut=ramp[begin])


def ramp_exiting(scene: Scene) -> Hits:
    """8: from a main lane onto a ramp, along which ego drives `rules.ramp_length` or more."""
    ramp = scene.has_role(Role.OFF_RAMP, Role.WEAVING)
    row, shift = _transitions(scene, scene.has_role(Role.MAIN), ramp)
    way, end = _way_on(scene, ramp), _course_ends(scene)[1][row]
    return _hits(scene, Label.RAMP_EXITING, row, way[end] - way[row], shift, cut=ramp[end])


def _hits(scene: Scene, label: Label, row: IntArray, length: FloatArray, shift: FloatArray, cut: BoolArray) -> Hits:
    """Transitions with enough way on the ramp, and enough shift; less of both where the recording is cut on the ramp."""
    rules = scene.rules
    whole = (length >= rules.ramp_length) & (shift >= rules.ramp_shift)
    width = scene.site.lanes.width[scene.strip[row]]
    partial = cut & (length >= rules.partial_ramp) & (shift >= rules.partial_shift * width) & ~whole
    good = scene.complete[row] & (whole | partial)
    return alone(label, row[good], ramp_way=length[good], partial=partial[good])


def _transitions(scene: Scene, before: BoolArray, after: BoolArray) -> tuple[IntArray, FloatArray]:
    """First rows after each transition, and the lateral shift of those by a change of lane; infinite for the others."""
    changes = scene.changes
    onwards = np.flatnonzero((changes.step[1:] == 0) & (changes.course[1:] == changes.course[:-1])) + 1
    rows, shifts = np.append(changes.row, onwards), np.append(changes.shift, np.full(len(onwards), np.inf))
    good = before[rows - 1] & after[rows]
    return rows[good], shifts[good]


def _way_on(scene: Scene, flags: BoolArray) -> FloatArray:
    """Distance driven so far on rows with a flag, m, summed over all rows."""
    step = np.hypot(np.diff(scene.x, prepend=scene.x[:1]), np.diff(scene.y, prepend=scene.y[:1]))
    inside = np.zeros(len(step), bool)
    inside[1:] = scene.changes.course[1:] == scene.changes.course[:-1]
    return np.cumsum(np.where(inside & flags, step, 0.0))


def _course_ends(scene: Scene) -> tuple[IntArray, IntArray]:
    """First and last row of the course that each row is in."""
    course = scene.changes.course
    return np.searchsorted(course, course, side="left"), np.searchsorted(course, course, side="right") - 1
