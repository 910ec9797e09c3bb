"""Plans of a speed over time within limits of acceleration and jerk: `follow` of speed actions and
profiles.

A change of speed is an S-curve: the acceleration moves to a plateau at the greatest jerk, holds it,
and moves on to its value at the end. It takes the time that was asked for, and more only where the
limits need more. Without a jerk limit the curve is a straight line.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from runner.engine.participants.declaration import Performance
from schemas.common.array_types import FloatArray

Numbers = FloatArray | float

_ROUNDING = 1e-9
"""Share of a limit, or time (s), within which rounding is at work"""


class ProfileEntry(NamedTuple):
    """A speed (m/s) to be reached `time` (s) after the entry before; None: as soon as the limits
    allow."""

    time: float | None
    speed: float


class ProfilePiece(NamedTuple):
    """A stretch of constant jerk: from `time` (s) on, speed (m/s), acceleration (m/s²), jerk
    (m/s³)."""

    time: float
    speed: float
    acceleration: float
    jerk: float

    def at(self, time: float) -> float:
        """Speed at a time (s) of the profile."""
        past = time - self.time
        return self.speed + past * (self.acceleration + 0.5 * self.jerk * past)


class _Segment(NamedTuple):
    """A way from one speed to another (m/s) in a time (s) at most as fast as an acceleration
    (m/s²)."""

    start: float
    reached: float
    duration: float
    limit: float
    timed: bool

    @property
    def slope(self) -> float:
        """Mean acceleration, m/s²."""
        return (self.reached - self.start) / self.duration if self.duration > 0.0 else 0.0


class _Rates(NamedTuple):
    """Time (s) that a rise, and a fall, of the acceleration by 1 m/s² takes; 0 without a jerk
    limit."""

    up: float
    down: float


class _Curve(NamedTuple):
    """An S-curve: accelerations at its ends and between them (m/s²), durations of its three parts
    (s)."""

    first: float
    plateau: float
    last: float
    rising: float
    holding: float
    falling: float


def plan(
    speed: float, entries: Iterable[ProfileEntry], limits: Performance, smooth: bool
) -> list[ProfilePiece]:
    """Plan a profile as pieces of constant jerk; the last one has no end.

    A smooth profile begins and ends without acceleration, and reaches each target in its time where
    that is possible for all of them. Where it is not, the corners of the straight profile are
    rounded, which keeps the times on the whole; where there is no time for that either, each change
    takes as long as the limits need.

    Args:
        speed: at the start, m/s.
        entries: the targets.
        limits: infinite where there are none.
        smooth: whether the jerk limits hold.
    """
    rates = (
        _Rates(_inverse(limits.max_acceleration_rate), _inverse(limits.max_deceleration_rate))
        if smooth
        else _Rates(0.0, 0.0)
    )
    segments = _segments(speed, entries, limits, rates)
    # Three attempts, from the most exact one: all times are met, the times on the whole, the limits
    # only.
    curves = _exact(segments, rates)
    if curves is None:
        rounded = _rounded(segments, rates) if len(segments) > 1 else None
        if rounded is not None:
            return rounded
        curves = [_unhurried(segment, rates) for segment in segments]
    pieces, time = [ProfilePiece(0.0, speed, 0.0, 0.0)], 0.0
    for segment, curve in zip(segments, curves, strict=True):
        pieces += _pieces(time, segment, curve)
        time = pieces[-1].time
    return pieces


def _inverse(rate: float) -> float:
    return 1.0 / rate if rate > 0.0 else 0.0


def _segments(
    speed: float, entries: Iterable[ProfileEntry], limits: Performance, rates: _Rates
) -> list[_Segment]:
    """Changes between the targets; an impossible one ends the profile."""
    segments: list[_Segment] = []
    for entry in entries:
        target = min(max(entry.speed, -limits.max_speed), limits.max_speed)
        change = target - speed
        # Away from standstill counts as acceleration, in either direction.
        limit = limits.max_acceleration if abs(target) > abs(speed) else limits.max_deceleration
        if change and limit == 0.0:
            return [*segments, _Segment(speed, speed, math.inf, limit, True)]
        least = abs(change) / limit if change else 0.0
        if entry.time is None:
            segments.append(
                _Segment(
                    speed,
                    target,
                    float(shortest(change, limit, rates.up, rates.down)),
                    limit,
                    False,
                )
            )
        elif change or entry.time > 0.0:
            segments.append(_Segment(speed, target, max(entry.time, least), limit, True))
        speed = target
    return segments


def shortest(
    change: FloatArray | float,
    limit: FloatArray | float,
    up: FloatArray | float,
    down: FloatArray | float,
) -> FloatArray:
    """Least durations (s) of changes of speed (m/s) without acceleration at their ends.

    Args:
        change: signed, m/s.
        limit: greatest acceleration, m/s².
        up, down: inverse of the greatest jerk at the beginning and at the end, s³/m.
    """
    size, both = np.abs(change), 0.5 * (np.asarray(up, float) + down)
    with np.errstate(divide="ignore", invalid="ignore"):
        # Without a plateau the acceleration would rise to `peak`: the triangle of that height has
        # the area of the change. If the limit is lower, it is a trapezoid.
        peak = np.where(both > 0.0, np.sqrt(size / np.where(both > 0.0, both, 1.0)), math.inf)
        held = size / limit + limit * both
        brief = 2.0 * np.sqrt(size * both)
    return np.where(size == 0.0, 0.0, np.where(peak <= limit, brief, held))


def pursued(
    speed: float, acceleration: float, target: float, limits: Performance, dt: float
) -> tuple[float, float]:
    """Return speed (m/s) and acceleration (m/s²) after dt (s) on the way to a target that may move.

    It is the S-curve of `plan` begun anew at every step: the acceleration grows at the greatest
    jerk, and is back at zero when the target is reached.

    Args:
        speed: now, m/s.
        acceleration: of the step before, m/s².
        target: speed to be reached, m/s.
        limits: infinite where there are none.
    """
    change = target - speed
    faster = abs(target) > abs(speed)
    limit = limits.max_acceleration if faster else limits.max_deceleration
    back = limits.max_deceleration_rate if change > 0.0 else limits.max_acceleration_rate
    size = min(abs(change) / dt, limit)
    if back < math.inf:
        # In steps of dt the area under a falling acceleration is a staircase: half a step of jerk
        # is the difference to the integral, and keeps it from going past the target.
        half = 0.5 * back * dt
        size = min(size, math.sqrt(half * half + 2.0 * back * abs(change)) - half)
    wanted = math.copysign(size, change)
    least = acceleration - limits.max_deceleration_rate * dt
    most = acceleration + limits.max_acceleration_rate * dt
    wanted = min(max(wanted, least), most)
    return speed + wanted * dt, wanted


def plateau(
    change: FloatArray | float,
    duration: FloatArray | float,
    up: FloatArray | float,
    down: FloatArray | float,
) -> FloatArray:
    """Accelerations (m/s²) between the ends of changes of speed (m/s) in times (s), arguments as in
    `shortest`."""
    # The smaller root of both·a² - duration·a + size = 0, in the form that does not cancel.
    size, both = np.abs(change), 0.5 * (np.asarray(up, float) + down)
    root = np.sqrt(np.maximum(np.square(duration) - 4.0 * both * size, 0.0))
    total = np.asarray(duration + root)
    return np.sign(change) * np.divide(
        2.0 * size, total, out=np.zeros_like(total), where=total > 0.0
    )


def _exact(segments: list[_Segment], rates: _Rates) -> list[_Curve] | None:
    """The curves that reach each target in its time; None where the limits forbid one."""
    # Accelerations at the targets, chosen first; each segment then is a problem of its own.
    knots = [0.0, *(_through(*pair) for pair in pairwise(segments)), 0.0]
    curves = [
        _curve(segment, *ends, rates)
        for segment, ends in zip(segments, pairwise(knots), strict=True)
    ]
    possible = [curve for curve in curves if curve is not None]
    return possible if len(possible) == len(curves) else None


def _through(before: _Segment, after: _Segment) -> float:
    """Acceleration at a target: none at an extreme of the speed, else that of the gentler way
    beside it."""
    if not (before.timed and after.timed) or before.slope * after.slope <= 0.0:
        return 0.0
    return min(before.slope, after.slope, key=abs)


def _curve(segment: _Segment, first: float, last: float, rates: _Rates) -> _Curve | None:
    """The curve of a segment between accelerations (m/s²) at its ends; None
    where it is impossible.
    """
    duration, change = segment.duration, segment.reached - segment.start
    if duration == math.inf or duration == 0.0:
        return (
            _Curve(first, 0.0, last, 0.0, duration, 0.0)
            if duration
            else _Curve(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        )
    low, high = sorted((first, last))
    # What the curve gains with its plateau at either end value: below, between and above decides
    # the signs of the jerks.
    middle = _gained(low, first, last, duration, rates), _gained(high, first, last, duration, rates)
    # the inverse jerks with which the acceleration comes to the plateau and leaves it, signed by
    # the direction
    come = rates.up if change > middle[first == high] else -rates.down
    leave = rates.down if change > middle[last == high] else -rates.up
    square, linear = -0.5 * (come + leave), duration + come * first + leave * last
    constant = -0.5 * (come * first * first + leave * last * last) - change
    # The change of speed is a quadratic in the height of the plateau; the root that tends to the
    # linear solution is the plateau.
    root = linear * linear - 4.0 * square * constant
    if root < -_ROUNDING * linear * linear:
        return None
    top = -2.0 * constant / (linear + math.copysign(math.sqrt(max(root, 0.0)), linear))
    rising, falling = (top - first) * come, (top - last) * leave
    holding = duration - rising - falling
    if holding < -_ROUNDING * duration or abs(top) > segment.limit * (1.0 + _ROUNDING):
        return None
    return _Curve(first, top, last, rising, max(holding, 0.0), falling)


def _gained(top: float, first: float, last: float, duration: float, rates: _Rates) -> float:
    """Change of speed (m/s) of a curve with a plateau (m/s²)."""
    come = rates.up if top > first else -rates.down
    leave = rates.down if top > last else -rates.up
    return top * duration - 0.5 * come * (top - first) ** 2 - 0.5 * leave * (top - last) ** 2


def _unhurried(segment: _Segment, rates: _Rates) -> _Curve:
    """The curve without acceleration at its ends in the time asked for, or in the least time that
    it needs."""
    change = segment.reached - segment.start
    up, down = rates if change > 0.0 else (rates.down, rates.up)
    duration = max(segment.duration, float(shortest(change, segment.limit, up, down)))
    if duration in (0.0, math.inf):
        return _Curve(0.0, 0.0, 0.0, 0.0, duration, 0.0)
    top = float(plateau(change, duration, up, down))
    rising, falling = abs(top) * up, abs(top) * down
    return _Curve(0.0, top, 0.0, rising, max(duration - rising - falling, 0.0), falling)


def _pieces(time: float, segment: _Segment, curve: _Curve) -> list[ProfilePiece]:
    """The pieces of a curve from a time (s) on, and the one after it."""
    speed, pieces = segment.start, list[ProfilePiece]()
    parts = (
        (curve.rising, curve.first, curve.plateau),
        (curve.holding, curve.plateau, curve.plateau),
        (curve.falling, curve.plateau, curve.last),
    )
    for duration, before, after in parts:
        if duration <= 0.0:
            continue
        pieces.append(
            ProfilePiece(
                time, speed, before, (after - before) / duration if duration < math.inf else 0.0
            )
        )
        time += duration
        speed += 0.5 * duration * (before + after) if duration < math.inf else 0.0
    return [*pieces, ProfilePiece(time, segment.reached, curve.last, 0.0)]


def _rounded(segments: list[_Segment], rates: _Rates) -> list[ProfilePiece] | None:
    """The straight profile with each corner replaced by a stretch of constant jerk, centred on the
    corner.

    The first one can't begin before the profile does, so the first line comes half of it late; it
    is left where it meets the second line, or shifts all that follows where it does not. None where
    the lines are too short.
    """
    # A segment without duration has no slope to be rounded.
    segments = [segment for segment in segments if segment.duration > 0.0]
    slopes = [0.0, *(segment.slope for segment in segments), 0.0]
    blends = [
        abs(after - before) * (rates.up if after > before else rates.down)
        for before, after in pairwise(slopes)
    ]
    for segment, (entering, leaving) in zip(segments, pairwise(blends), strict=True):
        if segment.duration + _ROUNDING < 0.5 * (entering + leaving):
            return None
    pieces = [ProfilePiece(0.0, segments[0].start, 0.0, 0.0)]
    corners = _corners(segments, 0.5 * blends[0])
    for corner, blend, (before, after) in zip(corners, blends, pairwise(slopes), strict=True):
        begin = corner - 0.5 * blend
        if begin < pieces[-1].time - _ROUNDING:
            return None
        if blend > 0.0:
            pieces.append(
                ProfilePiece(begin, pieces[-1].at(begin), before, (after - before) / blend)
            )
        pieces.append(ProfilePiece(begin + blend, pieces[-1].at(begin + blend), after, 0.0))
    return pieces


def _corners(segments: list[_Segment], late: float) -> list[float]:
    """Times (s) of the corners of the straight profile, with its first line delayed (s)."""
    corners, time = [late], 0.0
    for index, segment in enumerate(segments):
        time += segment.duration
        shift = late
        if index == 0 and len(segments) > 1 and segment.slope != segments[1].slope:
            meeting = late * segment.slope / (segment.slope - segments[1].slope)
            if -segment.duration < meeting < segments[1].duration:
                shift, late = meeting, 0.0
        corners.append(time + shift)
    return corners
