"""Polylines of lane borders: lengths, resampling, directions, and where they cross a line across the road."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from xodr.array_types import FloatArray
from xodr.lanelet2.lanelet import Points

REACH = 8.0
"""Length of line from which a direction is taken, m."""
_BEYOND = 40.0
_SAME = 1e-3
_FEWEST, _MOST = 8, 4000
"""Fewest and most stretches that a line is cut into."""
_AT_ONCE = 2_000_000
"""How many pairs of points and stretches are looked at together, to save memory."""


class Frame(NamedTuple):
    """A line across the road: it passes through (x, y) at right angles to the heading."""

    x: float
    y: float
    heading: float

    def local(self, points: Points) -> Points:
        """How far points lie ahead of the line and to the left of (x, y), (n, 2), m."""
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        return (points - (self.x, self.y)) @ np.array([[cos, -sin], [sin, cos]])

    def world(self, ahead: float, aside: float) -> tuple[float, float]:
        """The point that far ahead and to the left."""
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        return self.x + cos * ahead - sin * aside, self.y + sin * ahead + cos * aside


def lengths(line: Points) -> Points:
    """Arc length at each point, (n,), m."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])


def points_at(line: Points, s: Points) -> Points:
    """Points at arc lengths, (n, 2), m."""
    at = lengths(line)
    return np.column_stack([np.interp(s, at, line[:, axis]) for axis in (0, 1)])


def resampled(line: Points, count: int) -> Points:
    """`count` points at equal distances along the line, its ends included."""
    return points_at(line, np.linspace(0.0, lengths(line)[-1], count))


def places(length: float, step: float) -> int:
    """How many places on a length [m] are about a step apart, both ends included; not too few and not too many."""
    return min(max(int(length / step), _FEWEST), _MOST) + 1


def middle(left: Points, right: Points, step: float = 0.5) -> Points:
    """The line half-way between two lines: points at equal shares of their lengths, about a step apart."""
    count = places(max(lengths(left)[-1], lengths(right)[-1]), step)
    return (resampled(left, count) + resampled(right, count)) / 2


def joined(lines: list[Points]) -> Points:
    """Lines one after the other, without points that repeat."""
    points = np.concatenate(lines)
    steps = np.hypot(*np.diff(points, axis=0).T)
    return points[np.concatenate([[True], steps > _SAME])]


def prolonged(line: Points) -> Points:
    """The line with a straight piece before its start and after its end."""
    first, last = line[0] - line[1], line[-1] - line[-2]
    before = line[0] + first * (_BEYOND / np.hypot(*first))
    after = line[-1] + last * (_BEYOND / np.hypot(*last))
    return np.concatenate([[before], line, [after]])


def direction(line: Points, at_end: bool) -> float:
    """Heading [rad] of a line at one of its ends: the tangent of a parabola through its last (first) `REACH` metres."""
    total = lengths(line)[-1]
    reach = min(REACH, total)
    near = points_at(line, np.linspace(total - reach, total, 33) if at_end else np.linspace(0.0, reach, 33))
    parameter = np.linspace(-1.0, 0.0, 33) if at_end else np.linspace(0.0, 1.0, 33)
    dx, dy = (np.polynomial.Polynomial.fit(parameter, near[:, axis], 2).deriv()(0.0) for axis in (0, 1))
    return math.atan2(dy, dx)


def frame_at(line: Points, s: float) -> Frame:
    """The line across a line at an arc length, m."""
    before = points_at(line, np.linspace(0.0, s, 65))
    return Frame(float(before[-1, 0]), float(before[-1, 1]), direction(before, True))


def crossing(line: Points, frame: Frame) -> tuple[float, float]:
    """Where a line crosses a frame from behind it: arc length on the line and distance to the left of the frame's origin, m.

    The crossing nearest to the origin is meant; where there is none, the line's point nearest to the frame.
    """
    ahead, aside = frame.local(line).T
    steps = np.flatnonzero((ahead[:-1] <= 0.0) & (ahead[1:] > 0.0))
    at = lengths(line)
    if not len(steps):
        nearest = int(np.argmin(np.abs(ahead)))
        return float(at[nearest]), float(aside[nearest])
    share = ahead[steps] / (ahead[steps] - ahead[steps + 1])
    places = aside[steps] + share * (aside[steps + 1] - aside[steps])
    best = int(np.argmin(np.abs(places)))
    step = steps[best]
    return float(at[step] + share[best] * (at[step + 1] - at[step])), float(places[best])


def between(line: Points, start: Frame, end: Frame) -> Points:
    """The part of a line between two frames that it crosses."""
    s0, s1 = crossing(line, start)[0], crossing(line, end)[0]
    if s1 <= s0:
        s1 = s0 + _SAME
    at = lengths(line)
    inner = at[(at > s0) & (at < s1)]
    return points_at(line, np.concatenate([[s0], inner, [s1]]))


def across(points: Points, tangents: Points, line: Points) -> FloatArray:
    """How far to the left of points a line passes that goes their way, measured at right angles to tangents (n,), m.

    The place nearest to the point is meant; NaN where the line does not pass.
    """
    count = max(_AT_ONCE // len(line), 1)
    blocks = [slice(start, start + count) for start in range(0, len(points), count)]
    return np.concatenate([_across(points[block], tangents[block], line) for block in blocks] or [np.zeros(0)])


def _across(points: Points, tangents: Points, line: Points) -> FloatArray:
    tangents = tangents / np.hypot(*tangents.T)[:, None]
    delta = line[None] - points[:, None]
    ahead = (delta * tangents[:, None]).sum(axis=2)
    aside = delta[..., 1] * tangents[:, None, 0] - delta[..., 0] * tangents[:, None, 1]
    meets = (ahead[:, :-1] <= 0.0) & (ahead[:, 1:] > 0.0)
    share = np.divide(ahead[:, :-1], ahead[:, :-1] - ahead[:, 1:], where=meets, out=np.zeros(meets.shape))
    t = np.where(meets, aside[:, :-1] + share * (aside[:, 1:] - aside[:, :-1]), np.inf)
    nearest = np.take_along_axis(t, np.argmin(np.abs(t), axis=1)[:, None], axis=1)[:, 0]
    return np.where(np.isfinite(nearest), nearest, np.nan)
