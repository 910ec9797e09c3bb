"""When lane changes begin and end: by the half cosine to the new lane's centre that comes closest to the recorded motion."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from recognition.maneuvers.estimation.motion import LaneMotion
from recognition.maneuvers.estimation.reconstruction import progress
from recognition.maneuvers.parameters import PARAMETERS

EVERY = 0.2
"""Resolution (s) of beginnings, durations and the motion that is compared."""
_SCENE = PARAMETERS["start_time"].high
"""Time (s) before and after the border is crossed in which the motion is compared, as far as it is this lane change's"""


class LaneChange(NamedTuple):
    """A lane change: rows of its first and last instant and of its crossing of the border, its lateral way (m, to the left)."""

    start: int
    end: int
    row: int
    shift: float


def lane_changes(motion: LaneMotion) -> list[LaneChange]:
    """The lane changes of a scene in the order of rows, those whose border is crossed as the rules have it."""
    rows = motion.scene.changes.row.tolist()
    found: list[LaneChange] = []
    for row, after in zip(rows, (*rows, len(motion.way))[1:], strict=True):
        first, last = int(motion.first[row]), min(int(motion.last[row]), after - 1)
        if found and found[-1].end > first:
            first = found[-1].end
        change = _fitted(motion, row, first, last)
        if change is not None:
            found.append(change)
    return found


def _fitted(motion: LaneMotion, row: int, first: int, last: int) -> LaneChange | None:
    """The lane change across the border at a row within two other rows; None where there is no room for one."""
    scene, every = motion.scene, motion.scene.rows(EVERY)
    low, high = (PARAMETERS["duration"].low, PARAMETERS["duration"].high)
    compared = np.arange(max(first, row - scene.rows(_SCENE)), min(last, row + scene.rows(_SCENE)) + 1, every)
    starts = np.arange(max(first, row - scene.rows(high)), row, every)
    sizes = np.arange(scene.rows(low), scene.rows(high) + 1, every)
    start, size = (each.ravel() for each in np.meshgrid(starts, sizes, indexing="ij"))
    possible = (start + size > row) & (start + size <= last)
    start, size = start[possible, None], size[possible, None]
    if not len(start):
        return None
    centre = motion.aside[row] - scene.offset[row]
    began = motion.aside[start]
    model = began + (centre - began) * progress(np.clip((compared - start) / size, 0.0, 1.0))
    best = int(np.square(motion.aside[compared] - model).sum(axis=1).argmin())
    return LaneChange(int(start[best, 0]), int(start[best, 0] + size[best, 0]), row, float(centre - began[best, 0]))
