"""Which rows of a track become vertices of its trajectory: as few as a run needs to repeat the recorded motion.

In mode `follow` a run passes vertices at their times, with a speed that is continuous and changes by constant accelerations in
between (`runner.motion.schedules.smooth`). So places, headings and speeds between vertices follow from them; where they differ
from what was recorded, there is another vertex.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from runner.motion.schedules import quadratic
from xodr.array_types import BoolArray, FloatArray, IntArray

_FIRST = 1.6
"""Time (s) between vertices to begin with; halved as often as needed."""


class Tolerance(NamedTuple):
    """How far a run may be from the recording: m, rad, m/s, m/s²."""

    place: float = 0.03
    heading: float = 0.01
    speed: float = 0.05
    acceleration: float = 0.6


def needed(time: FloatArray, values: FloatArray) -> IntArray:
    """Rows between which values (n, k) are linear in time but for less than 1, ends included (Douglas and Peucker, 1973)."""
    kept = {0, len(time) - 1}
    pending = [(0, len(time) - 1)]
    while pending:
        a, b = pending.pop()
        if b - a < 2:
            continue
        share = (time[a : b + 1] - time[a]) / (time[b] - time[a])
        line = values[a] + share[:, None] * (values[b] - values[a])
        off = np.abs(values[a : b + 1] - line).max(axis=1)
        worst = int(off.argmax())
        if off[worst] > 1.0:
            kept.add(a + worst)
            pending += [(a, a + worst), (a + worst, b)]
    return np.array(sorted(kept), np.int64)


def vertices(columns: Mapping[str, np.ndarray], tolerance: Tolerance) -> IntArray:
    """Rows of a track that its trajectory has vertices at, ends included, ascending."""
    time, last = columns["time"], len(columns["time"]) - 1
    recorded = _Motion.of(columns)
    marks = np.arange(time[0], time[-1], _FIRST)
    chosen = np.unique(np.append(np.searchsorted(time, marks - 1e-6), last))
    while True:
        bad = _off(recorded, chosen, tolerance)
        split = np.add.reduceat(bad[:-1] | bad[1:], chosen[:-1]) > 0 if last > 0 else np.zeros(0, bool)
        split &= np.diff(chosen) > 1
        if not split.any():
            return chosen
        chosen = np.union1d(chosen, (chosen[:-1] + chosen[1:])[split] // 2)


class _Motion(NamedTuple):
    """What was recorded of a track (n,) each: s; m; rad, without jumps; m/s and m/s² along its way, forward or back."""

    time: FloatArray
    x: FloatArray
    y: FloatArray
    h: FloatArray
    speed: FloatArray
    acceleration: FloatArray

    @classmethod
    def of(cls, columns: Mapping[str, np.ndarray]) -> _Motion:
        """From the columns of a track."""
        time, x, y, h, speed, acceleration = (columns[name] for name in ("time", "x", "y", "h", "speed", "acceleration"))
        sign = np.where(speed < 0.0, -1.0, 1.0)
        return cls(time, x, y, np.unwrap(h), sign * speed, sign * acceleration)


def _off(recorded: _Motion, chosen: IntArray, tolerance: Tolerance) -> BoolArray:
    """Rows at which a run by the chosen vertices is further than tolerated from the recording."""
    time, x, y, h, speed, acceleration = recorded
    dx, dy = np.diff(x[chosen]), np.diff(y[chosen])
    chord = np.hypot(dx, dy)
    stations = np.append(0.0, np.cumsum(chord))
    rests = np.isin(stations, stations[1:-1][dx[1:] * dx[:-1] + dy[1:] * dy[:-1] < 0.0])
    pieces, _ = quadratic(time[chosen], stations, float(speed[0]), rests)
    if not len(pieces):
        return np.zeros(len(time), bool)
    piece = pieces[np.maximum(np.searchsorted(pieces[:, 0], time, side="right") - 1, 0)]
    past = time - piece[:, 0]
    station = piece[:, 1] + past * (piece[:, 2] + 0.5 * past * piece[:, 3])
    driven = piece[:, 2] + past * piece[:, 3]
    away = np.hypot(np.interp(station, stations, x[chosen]) - x, np.interp(station, stations, y[chosen]) - y)
    turn = np.abs(np.interp(station, stations, h[chosen]) - h)
    faster, harder = np.abs(driven - speed), np.abs(piece[:, 3] - acceleration)
    wrong = (away > tolerance.place) | (turn > tolerance.heading)
    return wrong | (faster > tolerance.speed) | (harder > tolerance.acceleration)
