"""Who else comes to the ego's way, and where."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from recognition.maneuvers.events.maneuver import Conflict
from recognition.maneuvers.events.paths import RecordedPath
from runner.recording import Recording, Track
from xodr.array_types import FloatArray

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

_SAME = 1.0
"""Ways that come closer than this meet, m"""
_BESIDE = 2.0
"""Who is nearer than this (m) to the ego's way when the passage begins drives along with it"""
_SOON = 5.0
"""Time (s) between two at one place that is too long for either to mind the other"""
_STEP = 0.25
"""Distance (m) of the points of the ego's way that others are compared with"""


def nearest_conflict(recording: Recording, ego: Track, path: RecordedPath, time: float, partner: str | None) -> Conflict | None:
    """The conflict with whom the ego has least time between them, of those whose path meets its own from the side.

    Args:
        path: the ego's.
        time: when its passage begins, s; the other one has not reached it yet then.
        partner: whom the event is about; None for any participant at the same place up to `_SOON` s earlier or later.
    """
    from scipy.spatial import cKDTree

    station = np.arange(0.0, float(path.station[-1]), _STEP)
    points = np.column_stack([np.interp(station, path.station, values) for values in (path.x, path.y)])
    then = np.interp(station, path.station, path.time)
    own = _EgoPath(cKDTree(points), then, time)
    tracks = [recording.tracks[partner]] if partner is not None else list(recording.tracks.values())
    found = [one for track in tracks if track is not ego and track.kind != "miscellaneous" and (one := own.conflict_with(track))]
    least, best = min(found, key=lambda one: (one[0], one[1].other.name), default=(np.inf, None))
    return best if partner is not None or least <= _SOON else None


class _EgoPath:
    """The ego's path, with the times (s) at which it was at its points; and when its passage begins."""

    def __init__(self, tree: cKDTree, then: FloatArray, begins: float) -> None:
        self._tree, self._then, self._begins = tree, then, begins

    def conflict_with(self, track: Track) -> tuple[float, Conflict] | None:
        """Where a track comes to the path, and the time between its and the ego's visit (s); None where it does not."""
        columns = track.columns
        time = columns["time"]
        row = int(np.searchsorted(time, self._begins))
        if self._begins < time[0] or row == len(time):
            return None
        places = np.column_stack([columns["x"][row:], columns["y"][row:]])
        apart, nearest = map(np.asarray, self._tree.query(places, distance_upper_bound=_BESIDE))
        near = np.flatnonzero((apart < _SAME) & (self._then[np.minimum(nearest, len(self._then) - 1)] > self._begins))
        if not len(near) or apart[0] < _BESIDE:
            return None
        first = int(near[0])
        place = row + first
        path = RecordedPath.of(track)
        reach = float(path.at(time[place])) - track.box.x - 0.5 * track.box.length
        if reach <= path.at(self._begins):
            return None
        x, y = (round(float(columns[axis][place]), 3) for axis in ("x", "y"))
        found = Conflict(track, path, x, y, reach, float(np.interp(reach, path.station, path.time)))
        return abs(float(time[place] - self._then[nearest[first]])), found
