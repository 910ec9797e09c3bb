"""The geometry of one road: a smooth reference line along its middle, and its borders as functions of s."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from xodr.array_types import FloatArray
from xodr.builders.curves import Pose
from xodr.builders.parametric import ParamPoly3
from xodr.lanelet2.lanelet import Points
from xodr.lanelet2.lines.mouths import Mouth
from xodr.lanelet2.lines.polylines import across, between, lengths, middle, places, resampled
from xodr.lanelet2.lines.splines import fit

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

STEP = 0.25
"""Distance between the places where borders are measured, m."""
LINE_TOLERANCE = 0.3
"""How far the reference line may keep from the middle of the road, m: only its smoothness matters."""
BORDER_TOLERANCE = 0.15
"""How far the borders may keep from those of the lanelets, m."""
_SHORTEST_BEND, _SHORTEST_PIECE = 3.0, 0.6
"""Shortest pieces of the reference line and of the borders, m."""
_MOST_PIECES = 512
_SHARPEST = 0.8
"""Largest curvature, in parts of that at which the road's inner edge would be the centre of the curve."""

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)


class Shape(NamedTuple):
    """A reference line and the borders.

    start, plan: of the reference line. s: where the pieces of the borders begin, (m,). t: their coefficients, from
    left to right, (m, 4, borders).
    """

    start: Pose
    plan: tuple[ParamPoly3, ...]
    s: FloatArray
    t: FloatArray

    @property
    def length(self) -> float:
        """Length of the reference line, m."""
        return sum(piece.length for piece in self.plan)

    @property
    def end(self) -> list[float]:
        """t of the borders at the end of the road, from left to right, m."""
        ds = self.length - self.s[-1]
        return [float(value) for value in ds ** np.arange(4) @ self.t[-1]]


def shape(lines: list[Points], start: Mouth, end: Mouth) -> Shape:
    """The geometry of the road between two mouths whose borders (from left to right) are the given lines."""
    line = _reference_line(between(lines[0], start.frame, end.frame), between(lines[-1], start.frame, end.frame), start, end)
    knots = _arc_lengths(line)
    at = np.linspace(line.x[0], line.x[-1], places(knots[-1], STEP))
    s = _arc_lengths(line, at)
    samples = np.column_stack([_offsets(line, at, border) for border in lines])
    ends = np.array([_own(start), _own(end)])
    samples[[0, -1]] = ends
    samples = np.minimum.accumulate(samples, axis=1)  # borders that cross leave a lane without width
    slopes = np.array([[edge.slope for edge in mouth.edges] for mouth in (start, end)])
    borders = _smooth(s, samples, ends, slopes)
    first = line(line.x[:1])[0]
    heading = math.atan2(*line(line.x[:1], 1)[0][::-1])
    return Shape(Pose(float(first[0]), float(first[1]), heading), tuple(_pieces(line, knots)), borders.x[:-1], _by_power(borders))


def _own(mouth: Mouth) -> list[float]:
    """The borders as measured from the reference line, which passes half-way between the outer ones."""
    t = [edge.t for edge in mouth.edges]
    return [value - (t[0] + t[-1]) / 2 for value in t]


def _reference_line(left: Points, right: Points, start: Mouth, end: Mouth) -> PPoly:
    """The spline along the middle that does not turn too sharply for the road's width; of those the coarsest one near to it."""
    samples = middle(left, right, STEP)
    half = np.hypot(*(resampled(left, len(samples)) - resampled(right, len(samples))).T) / 2
    ends = np.array([mouth.frame.world(0.0, (mouth.edges[0].t + mouth.edges[-1].t) / 2) for mouth in (start, end)])
    samples[[0, -1]] = ends
    at = lengths(samples)
    slopes = np.array([(math.cos(mouth.frame.heading), math.sin(mouth.frame.heading)) for mouth in (start, end)])
    candidates = []
    for intervals in _doubled(at[-1] / _SHORTEST_BEND):
        line = fit(at, samples, ends, slopes, intervals)
        away = float(np.hypot(*(line(at) - samples).T).max())
        sharp = float(np.abs(_curvatures(line, at) * half).max())
        if sharp <= _SHARPEST and away <= LINE_TOLERANCE:
            return line
        candidates.append((max(sharp, _SHARPEST), max(away, LINE_TOLERANCE), intervals, line))
    return min(candidates, key=lambda candidate: candidate[:3])[3]


def _doubled(most: float) -> Iterator[int]:
    """1, 2, 4, … up to a number, and 1 at least."""
    number = 1
    while number <= max(min(most, _MOST_PIECES), 1.0):
        yield number
        number *= 2


def _curvatures(line: PPoly, at: FloatArray) -> FloatArray:
    (dx, dy), (ddx, ddy) = line(at, 1).T, line(at, 2).T
    return np.asarray((dx * ddy - dy * ddx) / np.hypot(dx, dy) ** 3)


def _arc_lengths(line: PPoly, at: FloatArray | None = None) -> FloatArray:
    """Arc length of a plane curve at its knots, or at parameters."""
    grid = line.x if at is None else at
    ends = np.concatenate([[line.x[0]], grid])
    half = np.diff(ends)[:, None] / 2
    places = ends[:-1, None] + half * (1 + _NODES)
    speeds = np.hypot(*line(places.ravel(), 1).T).reshape(places.shape)
    return np.cumsum((half * speeds) @ _WEIGHTS)


def _offsets(line: PPoly, at: FloatArray, border: Points) -> FloatArray:
    """t of a border at parameters of the reference line, interpolated where no normal of the line meets it."""
    t = across(line(at), line(at, 1), border)
    found = np.isfinite(t)
    return np.interp(at, at[found], t[found]) if found.any() else np.zeros(len(at))


def _smooth(s: FloatArray, samples: FloatArray, ends: FloatArray, slopes: FloatArray) -> PPoly:
    """The coarsest spline within tolerance of the samples, else the nearest one."""
    candidates = []
    for intervals in _doubled(s[-1] / _SHORTEST_PIECE):
        spline = fit(s, samples, ends, slopes, intervals)
        away = float(np.abs(spline(s) - samples).max())
        if away <= BORDER_TOLERANCE:
            return spline
        candidates.append((away, intervals, spline))
    return min(candidates, key=lambda candidate: candidate[:2])[2]


def _pieces(line: PPoly, s: FloatArray) -> list[ParamPoly3]:
    """The pieces of a plane spline in the frames of their starts, with parameters from 0 to 1."""
    found = []
    for index, piece in enumerate(_by_power(line)):
        scaled = piece * (line.x[index + 1] - line.x[index]) ** np.arange(4)[:, None]
        scaled[0] = 0.0
        direction = scaled[1] / np.hypot(*scaled[1])
        u = scaled @ direction
        v = scaled @ np.array([-direction[1], direction[0]])
        v[1] = 0.0
        found.append(ParamPoly3(float(s[index + 1] - s[index]), tuple(u.tolist()), tuple(v.tolist())))
    return found


def _by_power(spline: PPoly) -> FloatArray:
    """The coefficients a, b, c, d of each piece, (m, 4, d)."""
    return spline.c[::-1].transpose(1, 0, 2)
