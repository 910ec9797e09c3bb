"""The recorded way of a participant as a path on which it may drive at other speeds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from recognition.catalogue.scenes.vertices import needed
from recognition.maneuvers.estimation.speeds import EVERY, distance_model, fit_speeds
from runner.recording import Track
from xodr.array_types import FloatArray, IntArray
from xosc import maneuvers

SMOOTHING = 0.5
"""Window (s) over which speeds are averaged"""
_PLACE, _HEADING = 0.02, 0.01
"""How far a trajectory may leave the recorded positions (m) and headings (rad), where that saves vertices."""
_SPACING = 0.5
"""Way (m) from point to point: more than who stands still seems to move about"""


@dataclass(frozen=True, eq=False)
class RecordedPath:
    """Points of a way.

    Attributes:
        time: when they were passed, s.
        x, y, h: position of the reference point (m) and heading (rad).
        station: distance from the first point along the others, m.
    """

    time: FloatArray
    x: FloatArray
    y: FloatArray
    h: FloatArray
    station: FloatArray

    @classmethod
    def of(cls, track: Track) -> RecordedPath:
        """The way of a track, from its first row on."""
        columns = track.columns
        x, y = columns["x"], columns["y"]
        rows = _spaced(x, y)
        x, y = x[rows], y[rows]
        station = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
        return cls(columns["time"][rows], x, y, np.unwrap(columns["h"][rows]), station)

    def at(self, time: float | FloatArray) -> Any:
        """How far along the way the participant was at times (s), m."""
        return np.interp(time, self.time, self.station)

    def trajectory(self, name: str) -> Any:
        """The entry of a trajectory catalogue."""
        values = np.column_stack([self.x / _PLACE, self.y / _PLACE, self.h / _HEADING])
        rows = needed(self.station, values)
        columns = (self.time - self.time[0], self.x, self.y, self.h)
        time, x, y, h = (np.round(values[rows], 4).tolist() for values in columns)
        return maneuvers.trajectory(name, time, x, y, h=h)


def _spaced(x: FloatArray, y: FloatArray) -> IntArray:
    """The first row, and each that is `_SPACING` away from the one taken before it."""
    taken = [0]
    for row, (here, there) in enumerate(zip(x.tolist(), y.tolist(), strict=True)):
        if np.hypot(here - x[taken[-1]], there - y[taken[-1]]) >= _SPACING:
            taken.append(row)
    return np.array(taken, np.int64)


def speed_at(track: Track, time: float) -> float:
    """Speed (m/s) about a time (s)."""
    columns = track.columns
    near = np.abs(columns["time"] - time) <= 0.5 * SMOOTHING
    return float(columns["speed"][near].mean()) if near.any() else float(np.interp(time, columns["time"], columns["speed"]))


def recorded_speeds(track: Track, path: RecordedPath, first: float, start: float, duration: float, rest: float) -> list[float]:
    """Start, end and final speed (m/s) of a manoeuvre with which a track covers the way that it was recorded on.

    Args:
        path: that way.
        first: from when on its way counts, s.
        start: of the manoeuvre, s; duration and rest as in `distance_model`.
    """
    time = np.arange(first - start, duration + rest + EVERY / 2, EVERY)
    seen = np.array([speed_at(track, start + after) for after in (0.0, duration, duration + rest)])
    distance = path.at(start + time) - path.at(start)
    found: list[float] = fit_speeds(distance_model(time, duration, rest), distance, seen).tolist()
    return found
