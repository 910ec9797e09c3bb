"""Plan-view geometry of the road reference line (OpenDRIVE "Geometry"): line, arc, spiral, poly3,
paramPoly3.

Every element answers `at(ds) -> (x, y, h)` and `curvature(ds)` with ds the arc length from its own
start [m], h the tangent's heading [rad, not wrapped] and curvature positive to the left [1/m].
These are called for each participant in each step, so they are scalar, use `math` only, and prepare
what they can when they are built.

Profiles are piecewise cubic functions of s: elevation, superelevation, lane offset, widths,
borders, lane centres.

OpenDRIVE describes all of them as records `a + b·ds + c·ds² + d·ds³` with ds = s − start, each
valid until the next.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple, Protocol

# reference lines --------------------------------------------------------------------------------


MAX_PIECES = 20_000
"""Most pieces that one element may be cut into: a file with absurd curvature is refused instead of
filling the memory."""

# Five-point Gauss–Legendre quadrature on [0, 1] (Abramowitz & Stegun, table 25.4).
_SIDES = ((0.9061798459386640, 0.2369268850561891), (0.5384693101056831, 0.4786286704993665))
_QUADRATURE = tuple(
    (0.5 + 0.5 * node, 0.5 * weight)
    for node, weight in (
        *((-x, w) for x, w in _SIDES),
        (0.0, 0.5688888888888889),
        *((x, w) for x, w in _SIDES),
    )
)


class PlanElement(Protocol):
    """One plan-view element."""

    length: float

    def at(self, ds: float) -> tuple[float, float, float]:
        """Position and heading (x, y, h) at arc length ds."""

    def curvature(self, ds: float) -> float:
        """Curvature at arc length ds."""

    def knots(self) -> list[float]:
        """Ascending arc lengths, ends included, between which the heading turns by at most about
        0.3 rad."""


class Start(NamedTuple):
    """Start of an element: position (m), heading (rad), and the element's length (m)."""

    x: float
    y: float
    h: float
    length: float


class Line:
    """A straight element."""

    __slots__ = ("cos", "h", "length", "sin", "x", "y")

    def __init__(self, start: Start) -> None:
        self.x, self.y, self.h, self.length = start
        self.cos, self.sin = math.cos(start.h), math.sin(start.h)

    def at(self, ds: float) -> tuple[float, float, float]:
        """Position and heading (x, y, h) at arc length ds."""
        return self.x + ds * self.cos, self.y + ds * self.sin, self.h

    def curvature(self, ds: float) -> float:
        """Return 0: a line has no curvature."""
        return 0.0

    def knots(self) -> list[float]:
        """Both ends."""
        return [0.0, self.length]


class Arc:
    """An element of constant curvature [1/m]."""

    __slots__ = ("h", "k", "length", "x", "y")

    def __init__(self, start: Start, curvature: float) -> None:
        self.x, self.y, self.h, self.length = start
        self.k = curvature

    def at(self, ds: float) -> tuple[float, float, float]:
        """Position and heading (x, y, h) at arc length ds."""
        half = 0.5 * self.k * ds
        # the chord: exact also where the curvature is so small that differences of sines would
        # cancel
        chord = ds * math.sin(half) / half if half else ds
        middle = self.h + half
        return self.x + chord * math.cos(middle), self.y + chord * math.sin(middle), middle + half

    def curvature(self, ds: float) -> float:
        """The constant."""
        return self.k

    def knots(self) -> list[float]:
        """Evenly spaced."""
        return _even(self.length, abs(self.k) * self.length / 0.3)


class Spiral:
    """An Euler spiral: curvature changes linearly from `start_curvature` to `end_curvature` [1/m].

    The Fresnel integrals are evaluated by five-point Gauss–Legendre quadrature from the nearest of
    several anchors, so close together that the error stays below 1e-11 of the distance between
    them.
    """

    __slots__ = ("_anchors", "_step", "dk", "k", "length")

    def __init__(self, start: Start, start_curvature: float, end_curvature: float) -> None:
        self.length, self.k = start.length, start_curvature
        self.dk = (end_curvature - start_curvature) / start.length
        turning = max(abs(start_curvature), abs(end_curvature)) * start.length
        bending = start.length * math.sqrt(abs(self.dk))
        count = _pieces(max(turning / 0.5, bending / 0.5))
        self._step = start.length / count
        x, y, h = start.x, start.y, start.h
        self._anchors: list[tuple[float, float, float, float]] = []
        for index in range(count):
            curvature = start_curvature + self.dk * index * self._step
            self._anchors.append((x, y, h, curvature))
            x, y, h = self._from(self._anchors[-1], self._step)

    def at(self, ds: float) -> tuple[float, float, float]:
        """Position and heading (x, y, h) at arc length ds."""
        index = min(max(int(ds / self._step), 0), len(self._anchors) - 1)
        return self._from(self._anchors[index], ds - index * self._step)

    def curvature(self, ds: float) -> float:
        """Linear in ds."""
        return self.k + self.dk * ds

    def knots(self) -> list[float]:
        """Evenly spaced."""
        return _even(
            self.length, max(abs(self.k), abs(self.curvature(self.length))) * self.length / 0.3
        )

    def _from(
        self, anchor: tuple[float, float, float, float], u: float
    ) -> tuple[float, float, float]:
        x, y, h, k = anchor
        half_rate = 0.5 * self.dk
        dx = dy = 0.0
        for node, weight in _QUADRATURE:
            v = node * u
            angle = h + v * (k + v * half_rate)
            dx += weight * math.cos(angle)
            dy += weight * math.sin(angle)
        return x + u * dx, y + u * dy, h + u * (k + u * half_rate)


class ParamPoly3:
    """A parametric cubic: u(p), v(p) in the element's own frame, p from 0 to `p_end`.

    The curve parameter is not the arc length: p is found from ds by a table of the arc length.
    Where the curve's true length differs from the declared one (files round), ds is scaled, so that
    the element ends where its polynomials end.

    Raises:
        ValueError: the curve has no length, or is so long or wild that it can't be tabulated.
    """

    __slots__ = ("_h", "_ps", "_quintics", "_scale", "_ss", "_xs", "_ys", "length")

    def __init__(self, start: Start, u: Sequence[float], v: Sequence[float], p_end: float) -> None:
        cos, sin = math.cos(start.h), math.sin(start.h)
        self._xs = [cos * a - sin * b for a, b in zip(u, v, strict=True)]
        self._ys = [sin * a + cos * b for a, b in zip(u, v, strict=True)]
        self._xs[0] += start.x
        self._ys[0] += start.y
        self._h = start.h
        self.length = start.length
        self._tabulate(p_end)
        total = self._ss[-1]
        if not total > 1e-9:
            raise ValueError("the polynomials describe a curve without length")
        self._scale = total / start.length

    def at(self, ds: float) -> tuple[float, float, float]:
        """Position and heading (x, y, h) at arc length ds."""
        p = self.parameter(ds * self._scale)
        a, b, c, d = self._xs
        e, f, g, i = self._ys
        h = math.atan2(f + p * (2.0 * g + 3.0 * p * i), b + p * (2.0 * c + 3.0 * p * d))
        # nearest to the start's heading, so that headings do not jump by a full turn inside an
        # element
        h += math.tau * round((self._h - h) / math.tau)
        return a + p * (b + p * (c + p * d)), e + p * (f + p * (g + p * i)), h

    def curvature(self, ds: float) -> float:
        """Curvature at arc length ds."""
        p = self.parameter(ds * self._scale)
        _, b, c, d = self._xs
        _, f, g, i = self._ys
        dx, dy = b + p * (2.0 * c + 3.0 * p * d), f + p * (2.0 * g + 3.0 * p * i)
        speed = math.hypot(dx, dy)
        return (
            (dx * (2.0 * g + 6.0 * p * i) - dy * (2.0 * c + 6.0 * p * d)) / speed**3
            if speed > 1e-9
            else 0.0
        )

    def knots(self) -> list[float]:
        """Evenly spaced; at least as many as the arc-length table has, which is denser where the
        parameter runs unevenly."""
        headings = [self.at(s / self._scale)[2] for s in self._ss]
        turning = sum(abs(after - before) for before, after in pairwise(headings))
        count = _pieces(max(len(self._ss) - 1, self.length / 20.0, turning / 0.3))
        return [self.length * index / count for index in range(count + 1)]

    def _rates(self, p: float) -> tuple[float, float]:
        """First and second derivative of the parameter by the arc length; 0 where the curve stops,
        as at a cusp."""
        _, b, c, d = self._xs
        _, f, g, i = self._ys
        dx, dy = b + p * (2.0 * c + 3.0 * p * d), f + p * (2.0 * g + 3.0 * p * i)
        speed = math.hypot(dx, dy)
        if not speed > 1e-9:
            return 0.0, 0.0
        along = dx * (2.0 * c + 6.0 * p * d) + dy * (2.0 * g + 6.0 * p * i)
        return 1.0 / speed, -along / speed**4

    def _arc_length(self, start: float, end: float) -> float:
        # Called hundreds of times for each element: written out, without calls of its own.
        _, b, c, d = self._xs
        _, f, g, i = self._ys
        c, g = 2.0 * c, 2.0 * g
        span, total = end - start, 0.0
        for node, weight in _QUADRATURE:
            p = start + node * span
            total += weight * math.hypot(b + p * (c + 3.0 * p * d), f + p * (g + 3.0 * p * i))
        return span * total

    def _tabulate(self, p_end: float) -> None:
        """Cut [0, p_end] until the quadrature is exact and p is a quintic of the arc length between
        the knots."""
        self._ss, self._ps, self._quintics = [0.0], [0.0], []
        before = self._rates(0.0)
        # Ends of the pieces that are left, with their lengths by one quadrature each, and p's
        # rates of change there.
        todo = [(p_end, self._arc_length(0.0, p_end), self._rates(p_end))]
        while todo:
            start, (end, whole, after) = self._ps[-1], todo[-1]
            middle = 0.5 * (start + end)
            first, second = self._arc_length(start, middle), self._arc_length(middle, end)
            halves, rates = first + second, self._rates(middle)
            quintic = _quintic(end - start, before, after, halves)
            away = start + _rise(quintic, first / halves if halves else 0.0) - middle
            exact = abs(whole - halves) < 1e-9 and abs(away) < 1e-7 * rates[0]
            if exact or halves < 1e-9 or end - start < 1e-6 * p_end:
                self._ss.append(self._ss[-1] + halves)
                self._ps.append(end)
                # No polynomial fits a cusp or a halt; p then grows evenly.
                self._quintics.append(quintic if exact else (end - start, 0.0, 0.0, 0.0, 0.0))
                before = after
                todo.pop()
            else:
                todo[-1] = end, second, after
                todo.append((middle, first, rates))
            if len(self._ss) > MAX_PIECES:
                raise ValueError("the polynomials are too long or too wild to be followed")

    def shorten(self, length: float) -> None:
        """End the curve at the true arc length (m), which becomes the declared one."""
        p = self.parameter(length)
        kept = max(bisect_right(self._ps, p) - 1, 0)  # the piece that p lies in begins there
        start, middle = self._ps[kept], 0.5 * (self._ps[kept] + p)
        rest = self._arc_length(start, middle) + self._arc_length(middle, p)
        self._ss[kept + 1 :], self._ps[kept + 1 :] = [self._ss[kept] + rest], [p]
        self._quintics[kept:] = [_quintic(p - start, self._rates(start), self._rates(p), rest)]
        self._scale = self._ss[-1] / self.length

    def parameter(self, s: float) -> float:
        """Curve parameter p at the curve's true arc length s, by Hermite interpolation in the
        table."""
        index = min(max(bisect_right(self._ss, s), 1), len(self._ss) - 1) - 1
        start = self._ss[index]
        span = self._ss[index + 1] - start
        x = min(max((s - start) / span, 0.0), 1.0) if span else 0.0
        b, c, d, e, f = self._quintics[index]
        return self._ps[index] + x * (b + x * (c + x * (d + x * (e + x * f))))


def poly3(start: Start, v: Sequence[float]) -> ParamPoly3:
    """The element poly3, a cubic v(u) in its own frame: the parametric cubic with u(p) = p that has
    the declared length."""
    u = (0.0, 1.0, 0.0, 0.0)
    curve = ParamPoly3(start, u, v, start.length)
    curve.shorten(start.length)
    return curve


class ReferenceLine:
    """The plan view of one road: elements that follow each other along s.

    Before its start and beyond its end the line goes on straight, so that a point just outside has
    a position too.
    """

    __slots__ = ("_ends", "_last", "_only", "end", "segments", "start", "starts", "straight")

    def __init__(self, starts: Sequence[float], segments: Sequence[PlanElement]) -> None:
        self.starts, self.segments = list(starts), list(segments)
        self.start, self.end = self.starts[0], self.starts[-1] + self.segments[-1].length
        self._last = len(self.starts) - 1
        self._ends = [*self.starts[1:], self.end]
        self.straight = all(isinstance(segment, Line) for segment in self.segments)
        only = self.segments[0] if not self._last else None
        self._only = only if isinstance(only, Line) else None

    def at(self, s: float) -> tuple[float, float, float]:
        """Position and heading (x, y, h) at s."""
        if not self.start <= s <= self.end:
            return self._beyond(s)
        index = bisect_right(self.starts, s) - 1 if self._last else 0
        return self.segments[index].at(s - self.starts[index])

    def beside(self, s: float, t: float) -> tuple[float, float, float]:
        """Position and heading (x, y, h) of the point t to the left of the line at s."""
        only = self._only
        if only is not None and self.start <= s <= self.end:
            ds = s - self.start
            return (
                only.x + ds * only.cos - t * only.sin,
                only.y + ds * only.sin + t * only.cos,
                only.h,
            )
        x, y, h = self.at(s)
        return x - t * math.sin(h), y + t * math.cos(h), h

    def element(self, s: float) -> tuple[float, float, PlanElement]:
        """The element at s (the nearest one outside the line), after the s of its start and of its
        end."""
        index = bisect_right(self.starts, s, 1) - 1 if self._last else 0
        return self.starts[index], self._ends[index], self.segments[index]

    def curvature(self, s: float) -> float:
        """Curvature at s, positive to the left; 0 outside the line."""
        if self.straight or not self.start <= s <= self.end:
            return 0.0
        index = bisect_right(self.starts, s) - 1
        return self.segments[index].curvature(s - self.starts[index])

    def knots(self) -> list[float]:
        """Ascending s, ends included, between which the line is close to its chord."""
        inner = [
            start + ds
            for start, segment in zip(self.starts, self.segments, strict=True)
            for ds in segment.knots()[:-1]
        ]
        return [*inner, self.end]

    def _beyond(self, s: float) -> tuple[float, float, float]:
        border = self.start if s < self.start else self.end
        index = 0 if s < self.start else self._last
        x, y, h = self.segments[index].at(border - self.starts[index])
        return x + (s - border) * math.cos(h), y + (s - border) * math.sin(h), h


_Quintic = tuple[float, float, float, float, float]
"""Coefficients of x to x⁵, for x from 0 to 1"""


def _quintic(
    change: float, before: tuple[float, float], after: tuple[float, float], length: float
) -> _Quintic:
    """Quintic that rises by a change over a length, with its first and second derivatives at both
    ends."""
    square = length * length
    b, c, slope, bend = before[0] * length, before[1] * square, after[0] * length, after[1] * square
    return (
        b,
        0.5 * c,
        10.0 * change - 6.0 * b - 4.0 * slope - 1.5 * c + 0.5 * bend,
        -15.0 * change + 8.0 * b + 7.0 * slope + 1.5 * c - bend,
        6.0 * change - 3.0 * (b + slope) + 0.5 * (bend - c),
    )


def _rise(quintic: _Quintic, x: float) -> float:
    b, c, d, e, f = quintic
    return x * (b + x * (c + x * (d + x * (e + x * f))))


def _pieces(count: float) -> int:
    if not count < MAX_PIECES:
        raise ValueError("the element winds too often to be followed")
    return max(1, math.ceil(count))


def _even(length: float, pieces: float) -> list[float]:
    count = _pieces(pieces)
    return [length * index / count for index in range(count + 1)]


# profiles ---------------------------------------------------------------------------------------


_SAMPLES = 8
"""Of each piece, where a function's sign is looked for"""
_SAME_PLACE = 1e-6


class Cubic(NamedTuple):
    """One record: valid from `start` [m] on."""

    start: float
    a: float
    b: float = 0.0
    c: float = 0.0
    d: float = 0.0

    def shifted(self, start: float) -> Cubic:
        """The same polynomial expressed about another start."""
        x = start - self.start
        _, a, b, c, d = self
        return Cubic(
            start, a + x * (b + x * (c + x * d)), b + x * (2 * c + 3 * x * d), c + 3 * x * d, d
        )


class Profile:
    """A function of s made of cubics with ascending starts; the first also holds before its start.

    Attributes:
        constant: the value where the function is the same everywhere, else None. Callers in hot
            paths may test it.
    """

    __slots__ = ("constant", "pieces", "starts")

    def __init__(self, pieces: Iterable[Cubic]) -> None:
        self.pieces = list(pieces)
        self.starts = [piece.start for piece in self.pieces]
        first = self.pieces[0].a
        flat = all(a == first and b == c == d == 0.0 for _, a, b, c, d in self.pieces)
        self.constant = first if flat else None

    def __call__(self, s: float) -> float:
        """Value at s."""
        if self.constant is not None:
            return self.constant
        start, a, b, c, d = self.pieces[max(bisect_right(self.starts, s) - 1, 0)]
        s -= start
        return a + s * (b + s * (c + s * d))

    def slope(self, s: float) -> float:
        """First derivative at s."""
        if self.constant is not None:
            return 0.0
        start, _, b, c, d = self.pieces[max(bisect_right(self.starts, s) - 1, 0)]
        s -= start
        return b + s * (2.0 * c + 3.0 * s * d)

    def plus(self, other: Profile, factor: float = 1.0) -> Profile:
        """The function `self + factor · other`."""
        starts = sorted({*self.starts, *other.starts})
        return Profile(_sum(self._about(start), other._about(start), factor) for start in starts)

    def within(self, start: float, end: float) -> Profile:
        """The part that matters between two s, so that sums over one lane section stay short."""
        inside = [piece for piece in self.pieces if start < piece.start < end]
        return Profile([self._about(start), *inside])

    def _about(self, start: float) -> Cubic:
        return self.pieces[max(bisect_right(self.starts, start) - 1, 0)].shifted(start)


def exceeding(profile: Profile, level: float, start: float, end: float) -> tuple[float, float]:
    """The s between which a function exceeds a level within [start, end]; infinite where it does so
    up to that end.

    Where it does nowhere, both lie outside: (∞, -∞).
    """
    if profile.constant is not None:
        return (-math.inf, math.inf) if profile.constant > level else (math.inf, -math.inf)
    knots = [start, *(piece.start for piece in profile.pieces if start < piece.start < end), end]
    samples = [
        a + (b - a) * index / _SAMPLES for a, b in pairwise(knots) for index in range(_SAMPLES)
    ] + [end]
    above = [index for index, s in enumerate(samples) if profile(s) > level]
    if not above:
        return math.inf, -math.inf
    first, last = above[0], above[-1]
    begins = _fall(profile, level, samples[first], samples[first - 1]) if first else -math.inf
    ends = (
        _fall(profile, level, samples[last], samples[last + 1])
        if last + 1 < len(samples)
        else math.inf
    )
    return begins, ends


def _fall(profile: Profile, level: float, above: float, below: float) -> float:
    """The s at which a function falls to a level, between one where it exceeds it and one where it
    does not."""
    while abs(below - above) > _SAME_PLACE:
        middle = 0.5 * (above + below)
        above, below = (middle, below) if profile(middle) > level else (above, middle)
    return below


ZERO = Profile([Cubic(0.0, 0.0)])
"""The function that is 0 everywhere."""


def _sum(one: Cubic, other: Cubic, factor: float) -> Cubic:
    _, a, b, c, d = other
    return Cubic(
        one.start, one.a + factor * a, one.b + factor * b, one.c + factor * c, one.d + factor * d
    )
