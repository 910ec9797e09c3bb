"""When a follower is where on its path: vertices of (time, s), and the speed between them.

The standard gives times at vertices and does not say how one moves between them; with times, a trajectory "completely
specifies the motion of the entity, including its speed" (OpenSCENARIO XML 1.3, 6.9). followingMode `position` asks for the
shape exactly, so times are interpolated as the lines are: the speed is steady between vertices and jumps there. `follow`
observes what the entity can do, so the speed is continuous, and changes by constant accelerations.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Collection, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from xodr.array_types import BoolArray, FloatArray

_SAME_TIME = 1e-9
"""Times (s) that are one but for rounding."""


class Piece(NamedTuple):
    """From a time (s) and station (m) on: a speed (m/s) that changes by a constant acceleration (m/s²)."""

    time: float
    station: float
    speed: float
    acceleration: float = 0.0


class Schedule:
    """When a follower is where on its path; before the first and after the last vertex it stands.

    Args:
        times: of the vertices in seconds, not decreasing.
        stations: places of the vertices on the path (s, in m), not decreasing.
        pieces: the motion from the first vertex to the last.
        final_speed: at the last vertex, m/s.
    """

    def __init__(self, times: Sequence[float], stations: Sequence[float], pieces: Sequence[Piece], final_speed: float) -> None:
        self.times, self.stations, self.final_speed = times, stations, final_speed
        self.pieces = pieces
        self._times, self._stations = [piece.time for piece in pieces], [piece.station for piece in pieces]

    def station(self, time: float) -> float:
        """s (m) at a time (s)."""
        if time <= self.times[0]:
            return self.stations[0]
        if time >= self.times[-1]:
            return self.stations[-1]
        piece = self.pieces[bisect_right(self._times, time) - 1]
        past = time - piece.time
        return piece.station + past * (piece.speed + 0.5 * past * piece.acceleration)

    def time(self, station: float) -> float:
        """The time (s) at which s (m) is reached."""
        if station <= self.stations[0]:
            return self.times[0]
        if station >= self.stations[-1]:
            return self.times[-1]
        piece = self.pieces[bisect_right(self._stations, station) - 1]
        way = station - piece.station
        reached = math.sqrt(max(piece.speed * piece.speed + 2.0 * piece.acceleration * way, 0.0))
        return piece.time + (2.0 * way / (piece.speed + reached) if way > 0.0 else 0.0)


def steady(times: Sequence[float], stations: Sequence[float]) -> Schedule:
    """A schedule whose speed is constant between vertices; in no time, it jumps."""
    speeds = [
        (there - here) / (after - before) if after > before else 0.0
        for (before, after), (here, there) in zip(pairwise(times), pairwise(stations), strict=True)
    ]
    pieces = [Piece(*piece) for piece in zip(times, stations, speeds, strict=False)]
    return Schedule(times, stations, pieces, speeds[-1] if speeds else 0.0)


def smooth(
    times: Sequence[float], stations: Sequence[float], start: float | None = None, rests: Collection[float] = ()
) -> Schedule:
    """A schedule with continuous speed: a quadratic spline after L. L. Schumaker (SIAM J. Numer. Anal. 20, 1983).

    One acceleration in each interval would not do: speeds v, v' at its ends would have to alternate about its mean speed c
    (v' = 2c - v), and no error would ever fade. So an interval has two, before and after its middle, where the speed is
    2c - (v + v') / 2; they are one wherever the vertices allow it. The speed at a vertex is the mean of the intervals at both
    sides, weighted by their durations squared: in a long one a wrong speed leads far off. It is 2c at most, so that no
    speed is negative, and who stands stands still.

    Args:
        start: speed at the first vertex, m/s; by default that of a constant acceleration in the first interval.
        rests: stations (m) of vertices at which the follower has to stop, because its way turns back there.
    """
    at, places = np.array(times, np.float64), np.array(stations, np.float64)
    pieces, final = quadratic(at, places, start, np.isin(places, list(rests)))
    return Schedule(times, stations, [Piece(*piece) for piece in pieces.tolist()], final)


def quadratic(times: FloatArray, stations: FloatArray, start: float | None, rests: BoolArray) -> tuple[FloatArray, float]:
    """The pieces of a `smooth` schedule, a row each (k, 4), and the speed at its last vertex.

    Args:
        times, stations: of the vertices (n,).
        start: as of `smooth`.
        rests: whether the follower has to stop at a vertex (n,).
    """
    kept = np.append(np.diff(times) > _SAME_TIME, True)
    times, stations, rests = times[kept], stations[kept], rests[kept]
    spans = np.diff(times)
    if not len(spans):
        return np.empty((0, 4)), 0.0
    means = np.diff(stations) / spans
    speeds = _vertex_speeds(spans, means, start, rests)
    half, before, after = 0.5 * spans, speeds[:-1], speeds[1:]
    middle = 2.0 * means - 0.5 * (before + after)
    first = times[:-1], stations[:-1], before, (middle - before) / half
    second = times[:-1] + half, stations[:-1] + 0.5 * half * (before + middle), middle, (after - middle) / half
    return np.stack([np.stack(first, axis=1), np.stack(second, axis=1)], axis=1).reshape(-1, 4), float(speeds[-1])


def _vertex_speeds(spans: FloatArray, means: FloatArray, start: float | None, rests: BoolArray) -> FloatArray:
    """Speeds (m/s) at vertices, from the intervals' durations (s) and mean speeds."""
    if len(spans) == 1:
        first = means[0] if start is None else min(start, 2.0 * means[0])
        return np.array([first, 2.0 * means[0] - first])
    weights = spans * spans
    inner = (weights[:-1] * means[:-1] + weights[1:] * means[1:]) / (weights[:-1] + weights[1:])
    inner = np.minimum(inner, 2.0 * np.minimum(means[:-1], means[1:]))
    inner[rests[1:-1]] = 0.0
    first = 2.0 * means[0] - inner[0] if start is None else min(start, 4.0 * means[0] - inner[0])
    return np.concatenate([[first], inner, [2.0 * means[-1] - inner[-1]]])
