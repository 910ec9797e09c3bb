"""Piecewise cubic functions of s: elevation, superelevation, lane offset, widths, borders, lane centres.

OpenDRIVE describes all of them as records `a + b·ds + c·ds² + d·ds³` with ds = s − start, each valid until the next.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable
from itertools import pairwise
from typing import NamedTuple

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
        return Cubic(start, a + x * (b + x * (c + x * d)), b + x * (2 * c + 3 * x * d), c + 3 * x * d, d)


class Profile:
    """A function of s made of cubics with ascending starts; the first also holds before its start.

    Attributes:
        constant: the value where the function is the same everywhere, else None. Callers in hot paths may test it.
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
    """The s between which a function exceeds a level within [start, end]; infinite where it does so up to that end.

    Where it does nowhere, both lie outside: (∞, -∞).
    """
    if profile.constant is not None:
        return (-math.inf, math.inf) if profile.constant > level else (math.inf, -math.inf)
    knots = [start, *(piece.start for piece in profile.pieces if start < piece.start < end), end]
    samples = [a + (b - a) * index / _SAMPLES for a, b in pairwise(knots) for index in range(_SAMPLES)] + [end]
    above = [index for index, s in enumerate(samples) if profile(s) > level]
    if not above:
        return math.inf, -math.inf
    first, last = above[0], above[-1]
    begins = _fall(profile, level, samples[first], samples[first - 1]) if first else -math.inf
    ends = _fall(profile, level, samples[last], samples[last + 1]) if last + 1 < len(samples) else math.inf
    return begins, ends


def _fall(profile: Profile, level: float, above: float, below: float) -> float:
    """The s at which a function falls to a level, between one where it exceeds it and one where it does not."""
    while abs(below - above) > _SAME_PLACE:
        middle = 0.5 * (above + below)
        above, below = (middle, below) if profile(middle) > level else (above, middle)
    return below


ZERO = Profile([Cubic(0.0, 0.0)])
"""The function that is 0 everywhere."""


def _sum(one: Cubic, other: Cubic, factor: float) -> Cubic:
    _, a, b, c, d = other
    return Cubic(one.start, one.a + factor * a, one.b + factor * b, one.c + factor * c, one.d + factor * d)
