"""When lane changes begin and end: by the half cosine to the new lane's centre that comes closest to the recorded motion.

They begin where there is a lane to change to: beside a ramp that is not before the acceleration lane does.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from recognition.maneuvers.estimation.motion import LaneMotion
from recognition.maneuvers.estimation.reconstruction import progress
from recognition.maneuvers.parameters import PARAMETERS
from xodr.array_types import BoolArray

EVERY = 0.2
"""Resolution (s) of beginnings, durations and the motion that is compared."""
_SCENE = PARAMETERS["start_time"].high
"""Time (s) before and after the border is crossed in which the motion is compared, as far as it is this lane change's"""

_MARGIN = 0.2
"""Time (s) for which there has to be a lane to change to before a lane change begins: reconstructions are decimetres off"""


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


def lane_changes(motion: LaneMotion) -> list[LaneChange]:
    """The lane changes of a scene in the order of rows, those whose border is crossed as the rules have it."""
    changes = motion.scene.changes
    rows, lacking, margin = changes.row.tolist(), _lacking(motion), motion.scene.rows(_MARGIN)
    found: list[LaneChange] = []
    for row, left, after in zip(rows, changes.left.tolist(), (*rows, len(motion.lateral))[1:], strict=True):
        first, last = int(motion.first[row]), min(int(motion.last[row]), after - 1)
        if found and found[-1].end > first:
            first = found[-1].end
        alone = np.flatnonzero(lacking[left][first:row])
        earliest = min(first + int(alone[-1]) + 1 + margin, row - 1) if len(alone) else first
        change = _fitted(motion, row, first, last, earliest)
        if change is not None:
            found.append(change)
    return found


def _lacking(motion: LaneMotion) -> tuple[BoolArray, BoolArray]:
    """Rows without a lane to the right of their own, and those without one to the left; short stays in a lane don't count."""
    scene = motion.scene
    strips, steps = scene.site.lanes.strips, np.cumsum(scene.changes.step)
    own = steps - steps[motion.first] == scene.changes.lane
    places = {(strip.road, strip.section, strip.forward, strip.place) for strip in strips}
    right, left = (
        np.array([(each.road, each.section, each.forward, each.place + side) in places for each in strips] + [False])
        for side in (1, -1)
    )
    return own & ~right[scene.strip], own & ~left[scene.strip]


def _fitted(motion: LaneMotion, row: int, first: int, last: int, earliest: int) -> LaneChange | None:
    """The lane change across the border at a row within two other rows; None where there is no room for one.

    Args:
        earliest: row at which it may begin.
    """
    scene, every = motion.scene, motion.scene.rows(EVERY)
    low, high = (PARAMETERS["duration"].low, PARAMETERS["duration"].high)
    compared = np.arange(max(first, row - scene.rows(_SCENE)), min(last, row + scene.rows(_SCENE)) + 1, every)
    starts = np.arange(max(earliest, row - scene.rows(high)), row, every)
    sizes = np.arange(scene.rows(low), scene.rows(high) + 1, every)
    start, size = (each.ravel() for each in np.meshgrid(starts, sizes, indexing="ij"))
    possible = (start + size > row) & (start + size <= last)
    start, size = start[possible, None], size[possible, None]
    if not len(start):
        return None
    centre = motion.lateral[row] - scene.offset[row]
    began = motion.lateral[start]
    model = began + (centre - began) * progress(np.clip((compared - start) / size, 0.0, 1.0))
    best = int(np.square(motion.lateral[compared] - model).sum(axis=1).argmin())
    return LaneChange(int(start[best, 0]), int(start[best, 0] + size[best, 0]), row, float(centre - began[best, 0]))
