"""Schedules of followers: vertices of (time, station on the path), and the speed between them.

The standard gives times at vertices and does not say how one moves between them; with times, a
trajectory "completely specifies the motion of the entity, including its speed" (OpenSCENARIO XML
1.3, 6.9). followingMode `position` asks for the shape exactly, so times are interpolated as the
lines are: the speed is steady between vertices and jumps there. `follow` observes what the entity
can do, so the speed is continuous, and changes by constant accelerations.

Since 1.4 a vertex may give speed and acceleration (`VertexMotion`). With times both hold
(`prescribed`); without them the speed follows from the place (`paced`).
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Collection, Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from schemas.common.array_types import BoolArray, FloatArray

_SAME_TIME = 1e-9
"""Times (s) that are one but for rounding."""
_STANDS = 1e-6
"""Speed (m/s) below which a follower stands."""
_SLOWEST = 1.0
"""Sum of the speeds (m/s) at the ends of a way to a trajectory that is assumed at least."""
_FINE = 0.25
"""Length (m) of the stretches over which an acceleration that changes is taken for constant."""


class PathPiece(NamedTuple):
    """Motion from a time (s) and station (m) on: a speed (m/s) that changes by a constant
    acceleration (m/s²)."""

    time: float
    station: float
    speed: float
    acceleration: float = 0.0


class VertexMotion(NamedTuple):
    """Prescribed motion at a vertex: speed (m/s) and acceleration (m/s²) along the path; None if
    absent."""

    speed: float | None = None
    acceleration: float | None = None


class Schedule:
    """Stations of a follower on its path by time; it stands before the first and after the last
    vertex.

    Args:
        times: of the vertices in seconds, not decreasing.
        stations: places of the vertices on the path (s, in m), not decreasing.
        pieces: the motion from the first vertex to the last.
        final_speed: at the last vertex, m/s.
    """

    def __init__(
        self,
        times: Sequence[float],
        stations: Sequence[float],
        pieces: Sequence[PathPiece],
        final_speed: float,
    ) -> None:
        self.times, self.stations, self.final_speed = times, stations, final_speed
        self.pieces = pieces
        self._times, self._stations = (
            [piece.time for piece in pieces],
            [piece.station for piece in pieces],
        )

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
        # 2·way / (v + v') is the time under constant acceleration, without a division by an
        # acceleration that may be 0.
        reached = math.sqrt(max(piece.speed * piece.speed + 2.0 * piece.acceleration * way, 0.0))
        return piece.time + (2.0 * way / (piece.speed + reached) if way > 0.0 else 0.0)


def steady(times: Sequence[float], stations: Sequence[float]) -> Schedule:
    """A schedule whose speed is constant between vertices; in no time, it jumps."""
    speeds = [
        (there - here) / (after - before) if after > before else 0.0
        for (before, after), (here, there) in zip(pairwise(times), pairwise(stations), strict=True)
    ]
    pieces = [PathPiece(*piece) for piece in zip(times, stations, speeds, strict=False)]
    return Schedule(times, stations, pieces, speeds[-1] if speeds else 0.0)


def smooth(
    times: Sequence[float],
    stations: Sequence[float],
    start: float | None = None,
    rests: Collection[float] = (),
) -> Schedule:
    """A schedule with continuous speed: a quadratic spline after L. L. Schumaker (SIAM J. Numer.
    Anal. 20, 1983).

    One acceleration in each interval would not do: speeds v, v' at its ends would have to alternate
    about its mean speed c (v' = 2c - v), and no error would ever fade. So an interval has two,
    before and after its middle, where the speed is 2c - (v + v') / 2; they are one wherever the
    vertices allow it. The speed at a vertex is the mean of the intervals at both sides, weighted by
    their durations squared: in a long one a wrong speed leads far off. It is 2c at most, so that no
    speed is negative, and a standing entity stays in place.

    Args:
        start: speed at the first vertex, m/s; by default that of a constant acceleration in the
            first interval.
        rests: stations (m) of vertices at which the follower has to stop, because its way turns
            back there.
    """
    at, places = np.array(times, np.float64), np.array(stations, np.float64)
    pieces, final = quadratic(at, places, start, np.isin(places, list(rests)))
    return Schedule(times, stations, [PathPiece(*piece) for piece in pieces.tolist()], final)


def prescribed(
    times: Sequence[float],
    stations: Sequence[float],
    motions: Sequence[VertexMotion],
    usual: Schedule,
) -> Schedule:
    """A schedule by times that keeps the speeds and accelerations at vertices; other intervals are
    those of the usual one.

    An interval with a prescribed speed at one end has a constant acceleration. With both speeds it
    has two accelerations, before and after its middle; where the time is too long for that, the
    follower brakes to a stop, waits and accelerates. A prescribed acceleration holds for a quarter
    of the interval.

    Args:
        usual: the schedule without prescriptions.

    Raises:
        ValueError: times, speeds and accelerations contradict each other.
    """
    pieces: list[PathPiece] = []
    for index, (before, after) in enumerate(pairwise(times)):
        begin, end = motions[index], motions[index + 1]
        # Vertices at one time are one place, or were refused (`Trajectory.timetable`).
        if after - before <= _SAME_TIME:
            continue
        if begin == end == VertexMotion():
            pieces += [
                piece
                for piece in usual.pieces
                if before - _SAME_TIME <= piece.time < after - _SAME_TIME
            ]
            continue
        span, way = after - before, stations[index + 1] - stations[index]
        first, last = _end_speeds(begin.speed, end.speed, way / span)
        if begin.acceleration is None and end.acceleration is None:
            steps = _by_speeds(first, last, span, way)
        else:
            steps = _by_accelerations(first, last, begin.acceleration, end.acceleration, span, way)
        time, station, speed = before, stations[index], first
        for duration, acceleration in steps:
            pieces.append(PathPiece(time, station, speed, acceleration))
            station += duration * (speed + 0.5 * duration * acceleration)
            time, speed = time + duration, speed + duration * acceleration
            if speed < -_STANDS:
                raise ValueError(
                    "speeds and accelerations would lead backwards between "
                    f"{before:g} s and {after:g} s"
                )
    final = motions[-1].speed
    return Schedule(
        times, stations, pieces, final if final is not None else _end_speed(pieces, times[-1])
    )


def _end_speed(pieces: Sequence[PathPiece], time: float) -> float:
    return (
        max(pieces[-1].speed + (time - pieces[-1].time) * pieces[-1].acceleration, 0.0)
        if pieces
        else 0.0
    )


def _end_speeds(first: float | None, last: float | None, mean: float) -> tuple[float, float]:
    """Speeds at the ends of an interval; an unknown one by a constant acceleration, or 0 where that
    would lead below."""
    if first is None:
        first = mean if last is None else max(2.0 * mean - last, 0.0)
    return first, max(2.0 * mean - first, 0.0) if last is None else last


def _by_speeds(first: float, last: float, span: float, way: float) -> list[tuple[float, float]]:
    """Durations (s) and accelerations (m/s²) from one speed (m/s) to another on a way (m) in a time
    (s)."""
    # Two constant accelerations, each for half of the time, cover the way with this speed in the
    # middle.
    middle = 2.0 * way / span - 0.5 * (first + last)
    if middle >= 0.0:
        half = 0.5 * span
        return [(half, (middle - first) / half), (half, (last - middle) / half)]
    # The middle would have to be negative: it brakes to 0, waits, and starts. Both ramps take the
    # time in which their ways add up to the whole.
    ramp = 2.0 * way / (first + last)
    if ramp <= 0.0:
        raise ValueError(
            f"a speed of {max(first, last):g} m/s is prescribed where the times ask to stand"
        )
    return [(ramp, -first / ramp), (span - 2.0 * ramp, 0.0), (ramp, last / ramp)]


def _by_accelerations(
    first: float, last: float, begin: float | None, end: float | None, span: float, way: float
) -> list[tuple[float, float]]:
    """Same as `_by_speeds`, with prescribed accelerations in the first and last quarter and two
    others between them."""
    quarter = 0.25 * span
    fixed = [(0.0, quarter, begin)] if begin is not None else []
    fixed += [(span - quarter, quarter, end)] if end is not None else []
    low = quarter if begin is not None else 0.0
    half = 0.5 * ((span - quarter if end is not None else span) - low)
    # Two unknown accelerations, two equations: what is left of the change of speed, and of the way.
    gained = last - first - sum(duration * value for _, duration, value in fixed)
    left = (
        way
        - first * span
        - sum(
            duration * value * (span - start - 0.5 * duration) for start, duration, value in fixed
        )
    )
    arms = [half * (span - low - (0.5 + index) * half) for index in (0, 1)]
    # accelerations b, c: half·(b + c) = gained, arms·(b, c) = left
    b = (left - arms[1] * gained / half) / (arms[0] - arms[1])
    inner = [(half, b), (half, gained / half - b)]
    return [
        *([(quarter, begin)] if begin is not None else []),
        *inner,
        *([(quarter, end)] if end is not None else []),
    ]


def paced(stations: Sequence[float], motions: Sequence[VertexMotion], start: float) -> Schedule:
    """A schedule without given times, by the speeds and accelerations at vertices; its first vertex
    is at time 0.

    Between vertices half the square of the speed is a cubic of the way, with the accelerations as
    slopes: a constant acceleration where only speeds are given.

    Args:
        start: speed at the first vertex where that gives none, m/s.

    Raises:
        ValueError: the speeds or accelerations lead to no motion to the end.
    """
    known = [
        index
        for index, motion in enumerate(motions)
        if motion != VertexMotion() or index in (0, len(motions) - 1)
    ]
    times, pieces = {0: 0.0}, list[PathPiece]()
    speed = motions[0].speed
    energy, time = 0.5 * (start if speed is None else speed) ** 2, 0.0
    for here, there in pairwise(known):
        begin, end, way = motions[here], motions[there], stations[there] - stations[here]
        if way <= 0.0:
            continue
        # Half the squared speed changes with the way as speed does with time under a constant
        # acceleration.
        reached = (
            0.5 * end.speed**2
            if end.speed is not None
            else energy + way * _mean(begin.acceleration, end.acceleration)
        )
        for low, high, mark in _cuts(stations, here, there):
            v, w = (
                math.sqrt(2.0 * _energy(energy, reached, begin, end, way, s - stations[here]))
                for s in (low, high)
            )
            # By way alone a standing follower never gets on: time would be infinite.
            if v + w <= _STANDS:
                raise ValueError(f"the follower stands at {low:.2f} m, and nothing accelerates it")
            pieces.append(PathPiece(time, low, v, 0.5 * (w * w - v * v) / (high - low)))
            time += 2.0 * (high - low) / (v + w)
            if mark is not None:
                times[mark] = time
        energy = reached
    last = 0.0
    filled = [last := max(times.get(index, last), last) for index in range(len(stations))]
    return Schedule(filled, stations, pieces, math.sqrt(2.0 * energy))


def delayed(schedule: Schedule, length: float, station: float, speed: float) -> Schedule:
    """Schedule that begins with a way of some length (m), at a speed (m/s), and continues the given
    one from a station (m)."""
    begin = schedule.time(station)
    index = max(bisect_right([piece.time for piece in schedule.pieces], begin) - 1, 0)
    joined = schedule.pieces[index]
    reached = joined.speed + (begin - joined.time) * joined.acceleration
    # From standstill to standstill there would be no end: at least half a metre a second is
    # assumed.
    duration = 2.0 * length / max(speed + reached, _SLOWEST)
    later, further = duration - begin, length - station
    rest = [
        PathPiece(p.time + later, p.station + further, p.speed, p.acceleration)
        for p in schedule.pieces[index + 1 :]
    ]
    pieces = [
        PathPiece(0.0, 0.0, speed, (reached - speed) / duration),
        PathPiece(duration, length, reached, joined.acceleration),
        *rest,
    ]
    vertices = [
        (t + later, s + further)
        for t, s in zip(schedule.times, schedule.stations, strict=True)
        if s > station
    ]
    times, stations = (
        [0.0, duration, *(t for t, _ in vertices)],
        [0.0, length, *(s for _, s in vertices)],
    )
    return Schedule(times, stations, pieces, schedule.final_speed)


def _mean(begin: float | None, end: float | None) -> float:
    """Mean acceleration between two vertices, the second without a speed."""
    if begin is not None and end is not None:
        return 0.5 * (begin + end)
    return begin if begin is not None else 0.5 * (end or 0.0)


def _cuts(
    stations: Sequence[float], here: int, there: int
) -> Iterator[tuple[float, float, int | None]]:
    """Short stretches between two vertices, and the vertex at the end of each, if any."""
    for index in range(here, there):
        low, high = stations[index], stations[index + 1]
        count = max(math.ceil((high - low) / _FINE), 1)
        cuts = [low + (high - low) * number / count for number in range(count + 1)]
        ends = [None] * (count - 1) + [index + 1]
        yield from (cut for cut in zip(cuts, cuts[1:], ends, strict=False) if cut[1] > cut[0])


def _energy(
    low: float, high: float, begin: VertexMotion, end: VertexMotion, way: float, u: float
) -> float:
    """Half the square of the speed (m²/s²) after u of a way (m), between its values at the ends."""
    secant = (high - low) / way
    first, last = begin.acceleration, end.acceleration
    left = first if first is not None else secant if last is None else 2.0 * secant - last
    right = last if last is not None else secant if first is None else 2.0 * secant - first
    p = u / way
    q = 1.0 - p
    value = (
        low * q * q * (1.0 + 2.0 * p)
        + high * p * p * (3.0 - 2.0 * p)
        + way * p * q * (left * q - right * p)
    )
    if value < -_STANDS:
        raise ValueError(f"the accelerations bring the follower to a stop {u:.2f} m after a vertex")
    return max(value, 0.0)


def quadratic(
    times: FloatArray, stations: FloatArray, start: float | None, rests: BoolArray
) -> tuple[FloatArray, float]:
    """The pieces of a `smooth` schedule, a row each (k, 4), and the speed at its last vertex.

    Args:
        times, stations: of the vertices (n,).
        start: as of `smooth`.
        rests: whether the follower has to stop at a vertex (n,).
    """
    # Of vertices at one time the last counts; the place jumps there.
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
    second = (
        times[:-1] + half,
        stations[:-1] + 0.5 * half * (before + middle),
        middle,
        (after - middle) / half,
    )
    return np.stack([np.stack(first, axis=1), np.stack(second, axis=1)], axis=1).reshape(
        -1, 4
    ), float(speeds[-1])


def _vertex_speeds(
    spans: FloatArray, means: FloatArray, start: float | None, rests: BoolArray
) -> FloatArray:
    """Speeds (m/s) at vertices, from the intervals' durations (s) and mean speeds."""
    if len(spans) == 1:
        first = means[0] if start is None else min(start, 2.0 * means[0])
        return np.array([first, 2.0 * means[0] - first])
    # Squares of the durations, see `smooth`; the minimum keeps the speed in the middle of either
    # interval from being negative.
    weights = spans * spans
    inner = (weights[:-1] * means[:-1] + weights[1:] * means[1:]) / (weights[:-1] + weights[1:])
    inner = np.minimum(inner, 2.0 * np.minimum(means[:-1], means[1:]))
    inner[rests[1:-1]] = 0.0
    # By a constant acceleration in the first interval; a given speed is bounded so that the speed
    # in the middle is not negative.
    first = 2.0 * means[0] - inner[0] if start is None else min(start, 4.0 * means[0] - inner[0])
    return np.concatenate([[first], inner, [2.0 * means[-1] - inner[-1]]])
