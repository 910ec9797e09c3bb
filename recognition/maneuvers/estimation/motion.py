"""The recorded motion of all vehicles along and across their lanes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recognition.labels.scene.scene import Scene
from xodr.array_types import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class LaneMotion:
    """Rows of a scene along and across their lanes.

    Attributes:
        scene: the rows.
        longitudinal: distance along the lanes, m, counted on from row to row; differences count within a course only.
        lateral: distance to the left, m, likewise.
        first, last: first and last row of each row's course, a part of a track along connected lanes without missing frames.
    """

    scene: Scene
    longitudinal: FloatArray
    lateral: FloatArray
    first: IntArray
    last: IntArray

    def gap(self, ego: int, other: int) -> float:
        """Distance (m) from the front of one row's vehicle to the rear of another's, as the former is headed."""
        scene = self.scene
        dx, dy, h = scene.x[other] - scene.x[ego], scene.y[other] - scene.y[ego], scene.h[ego]
        return float(dx * np.cos(h) + dy * np.sin(h) + scene.rear[other] - scene.front[ego])

    def row(self, track: int, frame: int) -> int | None:
        """The row of a track in a frame; None where it has none."""
        lo, hi = np.searchsorted(self.scene.track, [track, track + 1])
        place = lo + int(np.searchsorted(self.scene.frame[lo:hi], frame))
        return place if place < hi and self.scene.frame[place] == frame else None

    def in_lane_since(self, row: int) -> int:
        """The first row from which on a track has been in the lane that it is in at a row."""
        lanes = self.scene.changes.lane[self.first[row] : row + 1]
        others = np.flatnonzero(lanes != lanes[-1])
        return int(self.first[row] + (others[-1] + 1 if len(others) else 0))


def lane_motion(scene: Scene) -> LaneMotion:
    """The motion along and across the lanes of all rows of a scene."""
    changes = scene.changes
    dx, dy = np.diff(scene.x, prepend=scene.x[:1]), np.diff(scene.y, prepend=scene.y[:1])
    across = np.diff(changes.side, prepend=changes.side[:1])
    ahead = dx * np.cos(scene.h) + dy * np.sin(scene.h)
    along = np.copysign(np.sqrt(np.maximum(dx**2 + dy**2 - across**2, 0.0)), ahead)
    begins = np.diff(changes.course, prepend=-1) != 0
    starts = np.flatnonzero(begins)
    ends = np.append(starts[1:], len(begins)) - 1
    return LaneMotion(scene, np.cumsum(np.where(begins, 0.0, along)), changes.side, starts[changes.course], ends[changes.course])
