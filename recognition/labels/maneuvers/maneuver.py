"""Manoeuvre of a recognised event: entities, parameter values, recorded paths."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from recognition.labels.maneuvers.estimation import EVERY, distance_model, fit_speeds
from recognition.labels.maneuvers.parameters import APART, PARAMETERS, STILL, Values
from recognition.scenes.cut import needed
from runner.recording import Track
from schemas.common.array_types import FloatArray, IntArray
from xosc.writing import maneuvers

LONGEST = PARAMETERS["start_time"].high
"""Time (s) from the scene's start to the manoeuvre, and from its end to the scene's, at most."""
SHORTEST = PARAMETERS["duration"].low
"""Duration (s) of a manoeuvre, at least"""
EGO_ACTS = ("lane_change", "cruise", "ramp", "passage")
"""Kinds of manoeuvres whose actor is the ego"""


class ConflictPoint(NamedTuple):
    """Conflict point of another path with the ego's.

    Attributes:
        other: its track.
        path: its path.
        x, y: the place, m.
        reach: how far along its path the reference point of the other one is when its front is
            there, m.
        time: when that was, s.
    """

    other: Track
    path: RecordedPath
    x: float
    y: float
    reach: float
    time: float


class SpeedChange(NamedTuple):
    """Change to a speed (m/s), at a constant rate within a time (s)."""

    speed: float
    duration: float


class Passage(NamedTuple):
    """A manoeuvre that has its place.

    Attributes:
        path: the ego's.
        begin: how far along it the manoeuvre begins, m.
        conflict: with the path of another one, and `continuation` how that one goes on from there;
            None without another one.
    """

    path: RecordedPath
    begin: float
    conflict: ConflictPoint | None = None
    continuation: SpeedChange | None = None

    @classmethod
    def of(cls, path: RecordedPath, time: float) -> Passage:
        """Build the passage of an ego whose manoeuvre begins at its place at a time (s), without
        another participant."""
        return cls(path, float(path.at(time)))

    def longest(self, speed: float) -> float:
        """Return the time (s) of the ego at a speed (m/s) from the start of its path to the
        manoeuvre, at most `LONGEST`."""
        return min(LONGEST, self.begin / speed) if speed > 0.0 else LONGEST


@dataclass(frozen=True)
class RecordedManeuver:
    """A manoeuvre.

    Attributes:
        kind: cut_in, cut_out, lane_change, following, cruise, ramp (a lane change at one) or
            passage.
        ego: its track.
        other: vehicle ahead of the ego at the start, in a passage the one whose path the ego's
            meets; None without one.
        left: whether the lane change is to the left; None without a lane change.
        values: of the parameters.
        speed: of the other vehicle before the manoeuvre, m/s.
        begin: when it begins, in the recording, s.
        approach: time before that in which the other vehicle was recorded in its lane, s, at most
            `LONGEST`.
        passage: the place, in a passage and at ramps; None for a manoeuvre that may be anywhere on
            its road. In a passage the vehicles keep to their recorded paths, elsewhere to lanes.
        speeds: range of its speeds by road kind and limit, m/s.
    """

    kind: str
    ego: Track
    other: Track | None
    left: bool | None
    values: Values
    speed: float
    begin: float
    approach: float = LONGEST
    passage: Passage | None = None
    speeds: tuple[float, float] = (PARAMETERS["start_speed"].low, PARAMETERS["start_speed"].high)

    @property
    def ego_acts(self) -> bool:
        """Whether the ego is the actor."""
        return self.kind in EGO_ACTS

    @property
    def in_one_lane(self) -> bool:
        """Whether the other one is ahead in the ego's own lane before the manoeuvre begins."""
        return self.other is not None and self.kind not in ("cut_in", "passage")

    @property
    def delay(self) -> float:
        """Time from the scene's start to the manoeuvre, s: the start time, as far as everyone can
        keep a speed until then."""
        delay = min(self.values.start_time, self.approach)
        if self.passage is not None:
            delay = min(delay, self.passage.longest(self.values.start_speed))
        # Two in one lane that keep their speeds until the start must not have been closer than
        # `APART`.
        if self.in_one_lane and self.values.gap is not None:
            opening = (self.speed - self.values.start_speed) * (1.0 if self.ego_acts else -1.0)
            delay = min(delay, max(self.values.gap - APART, 0.0) / max(opening, STILL))
        return delay

    @property
    def start(self) -> float:
        """Start of the scene in the recording, s."""
        return self.begin - self.delay

    @property
    def end(self) -> float:
        """End of the scene in the recording, s."""
        return self.begin + self.values.duration + self.values.rest_time


class Span(NamedTuple):
    """An event's start, middle and end, s."""

    start: float
    middle: float
    end: float


SMOOTHING = 0.5
"""Window (s) over which speeds are averaged"""
_PLACE, _HEADING = 0.02, 0.01
"""Largest deviation of a trajectory from recorded positions (m) and headings (rad) that saves
vertices."""
_SPACING = 0.5
"""Distance (m) from point to point above the apparent motion of a standing vehicle"""


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
        """Return the distance along the path at times (s), m."""
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
    return (
        float(columns["speed"][near].mean())
        if near.any()
        else float(np.interp(time, columns["time"], columns["speed"]))
    )


def recorded_speeds(
    track: Track, path: RecordedPath, first: float, start: float, duration: float, rest: float
) -> list[float]:
    """Start, end and final speed (m/s) of a manoeuvre with which a track covers the way that it was
    recorded on.

    Args:
        path: that way.
        first: from when on its way counts, s.
        start: of the manoeuvre, s; duration and rest as in `distance_model`.
    """
    # Half a step beyond, so that rounding does not drop the last instant.
    time = np.arange(first - start, duration + rest + EVERY / 2, EVERY)
    seen = np.array([speed_at(track, start + after) for after in (0.0, duration, duration + rest)])
    distance = path.at(start + time) - path.at(start)
    speeds: list[float] = fit_speeds(distance_model(time, duration, rest), distance, seen).tolist()
    return speeds
