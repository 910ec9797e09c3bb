"""Curves that entities follow off their lane, by arc length: polylines, clothoids, sampled curves,
and chains of them.

Lengths and speeds are horizontal, as on roads. A path answers `at(s) -> WorldPose` for every step
of every follower, so it is prepared when it is built; beyond its ends it goes on straight. The
heading is the tangent's where none was given.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple, Protocol

from xodr.model import WorldPose
from xodr.model.geometry import PlanElement

_SAME_PLACE = 1e-9
"""Distance (m) within which two points of a path are one."""
_SHORT = 1e-4
"""A length (m) over which every path is straight."""
_AHEAD = 1.0
"""Angle (rad) to the tangent up to which an orientation certainly faces along a path."""
_REFINEMENTS = 8


class Path(Protocol):
    """A curve by its arc length s (m) from 0 to `length`."""

    length: float

    def at(self, s: float) -> WorldPose:
        """Position (m) and orientation (rad) at s."""
        ...

    def knots(self) -> list[float]:
        """Ascending s, both ends included, between which the path is close to its chord."""
        ...


class Corner(NamedTuple):
    """A vertex of a polyline: position (m), and the orientation (rad) where one is prescribed
    there."""

    x: float
    y: float
    z: float
    h: float | None = None
    pitch: float | None = None
    roll: float | None = None


class _StraightPiece(NamedTuple):
    """A straight piece of a polyline: from s = start, direction (dx, dy, dz) and turning (dh, dp,
    dr) per metre."""

    start: float
    length: float
    pose: WorldPose
    dx: float
    dy: float
    dz: float
    dh: float
    dp: float
    dr: float


class Polyline:
    """Straight lines from corner to corner; prescribed orientations are interpolated between the
    corners.

    A corner without a heading has that of the line; without a pitch, that of the line's slope;
    without a roll, none.

    Args:
        corners: two or more.
    """

    def __init__(self, corners: Sequence[Corner]) -> None:
        self.stations = [0.0]
        """s of each corner"""
        for a, b in pairwise(corners):
            self.stations.append(self.stations[-1] + math.hypot(b.x - a.x, b.y - a.y))
        self.length = self.stations[-1]
        ends = zip(pairwise(corners), self.stations, strict=False)
        self._stretches = [
            _stretch(a, b, start)
            for (a, b), start in ends
            if math.hypot(b.x - a.x, b.y - a.y) > _SAME_PLACE
        ]
        # All corners in one place: a path of no length, with the orientation of the first.
        if not self._stretches:
            only = corners[0]
            pose = WorldPose(
                only.x, only.y, only.z, only.h or 0.0, only.pitch or 0.0, only.roll or 0.0
            )
            self._stretches = [
                _StraightPiece(
                    0.0, 0.0, pose, math.cos(pose.h), math.sin(pose.h), 0.0, 0.0, 0.0, 0.0
                )
            ]
        self._starts = [stretch.start for stretch in self._stretches]

    def at(self, s: float) -> WorldPose:
        """Position and orientation at s."""
        start, length, pose, dx, dy, dz, dh, dp, dr = self._stretches[
            max(bisect_right(self._starts, s) - 1, 0)
        ]
        u = s - start
        # Beyond its ends the line goes on, its orientation does not turn further.
        turned = min(max(u, 0.0), length)
        x, y, z, h, pitch, roll = pose
        return WorldPose(
            x + u * dx,
            y + u * dy,
            z + u * dz,
            h + turned * dh,
            pitch + turned * dp,
            roll + turned * dr,
        )

    @cached_property
    def faces_ahead(self) -> bool:
        """Whether orientations are within `_AHEAD` of the tangent everywhere; False where pieces
        are too short to tell."""
        pieces = self._stretches
        tangents = [math.atan2(piece.dy, piece.dx) for piece in pieces]
        for number, piece in enumerate(pieces):
            # About a corner `tangent` lies between those of both sides.
            if piece.length < 2.0 * _SHORT:
                return False
            for h in (piece.pose.h, piece.pose.h + piece.length * piece.dh):
                for along in tangents[max(number - 1, 0) : number + 2]:
                    if abs(math.remainder(h - along, math.tau)) > _AHEAD:
                        return False
        return True

    def knots(self) -> list[float]:
        """The corners."""
        return [*self._starts, self.length]


def _stretch(a: Corner, b: Corner, start: float) -> _StraightPiece:
    length = math.hypot(b.x - a.x, b.y - a.y)
    tangent = math.atan2(b.y - a.y, b.x - a.x)
    # Pitch is positive when the nose is down (ISO 8855), so uphill is negative.
    slope = -math.atan2(b.z - a.z, length)
    h, h_end = (tangent if corner.h is None else corner.h for corner in (a, b))
    pitch, pitch_end = (slope if corner.pitch is None else corner.pitch for corner in (a, b))
    roll, roll_end = (corner.roll or 0.0 for corner in (a, b))
    turns = (
        # Orientations turn the shorter way round.
        math.remainder(end - begin, math.tau)
        for begin, end in ((h, h_end), (pitch, pitch_end), (roll, roll_end))
    )
    rates = ((b.x - a.x), (b.y - a.y), (b.z - a.z), *turns)
    return _StraightPiece(
        start, length, WorldPose(a.x, a.y, a.z, h, pitch, roll), *(rate / length for rate in rates)
    )


class Segments:
    """Chain of lines, arcs and Euler spirals, at a constant height.

    Args:
        segments: one or more, each beginning where the one before ends.
        z: height, m.
    """

    def __init__(self, segments: Sequence[PlanElement], z: float) -> None:
        self._segments, self._z = segments, z
        self.stations = [0.0]
        """s of the beginning of each segment, and of the end"""
        for segment in segments:
            self.stations.append(self.stations[-1] + segment.length)
        self.length = self.stations[-1]
        self._starts = self.stations[:-1]

    def at(self, s: float) -> WorldPose:
        """Position and orientation at s."""
        # Beyond its ends it goes on straight.
        inside = min(max(s, 0.0), self.length)
        index = bisect_right(self._starts, inside) - 1
        x, y, h = self._segments[index].at(inside - self._starts[index])
        beyond = s - inside
        return WorldPose(x + beyond * math.cos(h), y + beyond * math.sin(h), self._z, h, 0.0, 0.0)

    def knots(self) -> list[float]:
        """Knots of the segments."""
        inner = [
            start + u
            for start, segment in zip(self._starts, self._segments, strict=True)
            for u in segment.knots()[:-1]
        ]
        return [*inner, self.length]


class Sample(NamedTuple):
    """A point of a sampled curve: arc length s and position (m), heading of the tangent and
    orientation h (rad, not wrapped)."""

    s: float
    x: float
    y: float
    z: float
    tangent: float
    h: float


class Sampled:
    """A smooth curve through closely spaced samples: cubic (Hermite) between them.

    Args:
        samples: two or more, of ascending s.
    """

    def __init__(self, samples: Sequence[Sample]) -> None:
        self._samples = samples
        self._starts = [sample.s for sample in samples[:-1]]
        self.length = samples[-1].s

    def at(self, s: float) -> WorldPose:
        """Position and orientation at s."""
        inside = min(max(s, 0.0), self.length)
        index = bisect_right(self._starts, inside) - 1
        a, b = self._samples[index], self._samples[index + 1]
        span = b.s - a.s
        # Heading and height are linear between samples: their errors are of second order in the
        # spacing.
        u = (inside - a.s) / span
        v = 1.0 - u
        # Hermite basis: positions at both ends, tangents of length `span`
        start, end = v * v * (1.0 + 2.0 * u), u * u * (3.0 - 2.0 * u)
        leave, arrive = u * v * v * span, -u * u * v * span
        x = start * a.x + end * b.x + leave * math.cos(a.tangent) + arrive * math.cos(b.tangent)
        y = start * a.y + end * b.y + leave * math.sin(a.tangent) + arrive * math.sin(b.tangent)
        tangent = a.tangent + u * (b.tangent - a.tangent)
        beyond = s - inside
        slope = (b.z - a.z) / span
        return WorldPose(
            x + beyond * math.cos(tangent),
            y + beyond * math.sin(tangent),
            a.z + (inside - a.s) * slope,
            a.h + u * (b.h - a.h),
            -math.atan(slope),
            0.0,
        )

    def knots(self) -> list[float]:
        """The samples."""
        return [*self._starts, self.length]


class Chain:
    """Chain of paths; the last one begins at an s of its own.

    Args:
        first: followed from its beginning to its end.
        then: followed after that, from `begin` on.
        begin: s on `then`, m.
    """

    def __init__(self, first: Path, then: Path, begin: float = 0.0) -> None:
        self.first, self.then, self.begin = first, then, begin
        self.length = first.length + then.length - begin

    def at(self, s: float) -> WorldPose:
        """Position and orientation at s."""
        return (
            self.first.at(s)
            if s < self.first.length
            else self.then.at(s - self.first.length + self.begin)
        )

    def knots(self) -> list[float]:
        """Knots of both parts."""
        shift = self.first.length - self.begin
        return [
            *self.first.knots(),
            *(knot + shift for knot in self.then.knots() if knot > self.begin),
        ]


class SmoothCurve(Sampled):
    """A smooth curve through corners, with the s (m) of each.

    Cubics in the length of the chords join the corners. Tangents at inner corners are those of a
    parabola through the corner and its neighbours, those at the ends continue that parabola.
    Prescribed headings turn evenly from corner to corner.
    """

    def __init__(self, corners: Sequence[Corner]) -> None:
        chords = [math.hypot(b.x - a.x, b.y - a.y) for a, b in pairwise(corners)]
        slopes = [
            ((b.x - a.x) / d, (b.y - a.y) / d) if d > _SAME_PLACE else (0.0, 0.0)
            for (a, b), d in zip(pairwise(corners), chords, strict=True)
        ]
        leave = _tangents(chords, slopes)
        samples: list[Sample] = []
        self.stations = [0.0]
        for index, (a, b) in enumerate(pairwise(corners)):
            if chords[index] > _SAME_PLACE:
                _sample(samples, a, b, chords[index], leave[index], leave[index + 1])
            self.stations.append(samples[-1].s if samples else 0.0)
        super().__init__(samples)


def smoothed(corners: Sequence[Corner]) -> Polyline | SmoothCurve:
    """A smooth curve through corners; a line where they are at two places at most."""
    places = {(corner.x, corner.y) for corner in corners}
    return SmoothCurve(corners) if len(places) > 2 else Polyline(corners)


def _tangents(
    chords: Sequence[float], slopes: Sequence[tuple[float, float]]
) -> list[tuple[float, float]]:
    """Derivatives by the chord's length at each corner."""
    inner = [
        tuple(
            (p * e + q * d) / (d + e) if d + e > _SAME_PLACE else 0.0
            for p, q in zip(before, after, strict=True)
        )
        for (d, e), (before, after) in zip(pairwise(chords), pairwise(slopes), strict=True)
    ]
    first = tuple(2.0 * p - q for p, q in zip(slopes[0], inner[0], strict=True))
    last = tuple(2.0 * p - q for p, q in zip(slopes[-1], inner[-1], strict=True))
    return [(x, y) for x, y in (first, *inner, last)]


def _sample(
    samples: list[Sample],
    a: Corner,
    b: Corner,
    chord: float,
    leave: tuple[float, float],
    arrive: tuple[float, float],
) -> None:
    """Add the samples of a cubic from a corner to the next, the first corner's own where there are
    none yet."""
    # A sample each metre, at least 8 for short bends; 200 bound the cost of long chords.
    count = max(8, min(200, math.ceil(chord)))
    for number in range(1 if samples else 0, count + 1):
        u = number / count
        v = 1.0 - u
        start, end, out, into = (
            v * v * (1.0 + 2.0 * u),
            u * u * (3.0 - 2.0 * u),
            u * v * v * chord,
            -u * u * v * chord,
        )
        x, y = (
            start * p + end * q + out * m + into * n
            for p, q, m, n in ((a.x, b.x, leave[0], arrive[0]), (a.y, b.y, leave[1], arrive[1]))
        )
        ahead, before, after = 6.0 * u * v / chord, v * (v - 2.0 * u), u * (u - 2.0 * v)
        dx, dy = (
            ahead * (b.x - a.x) + before * leave[0] + after * arrive[0],
            ahead * (b.y - a.y) + before * leave[1] + after * arrive[1],
        )
        heading = math.atan2(dy, dx)
        # Headings go on from the sample before, not wrapped, so that they can be interpolated.
        last = samples[-1] if samples else Sample(0.0, x, y, a.z, heading, heading)
        tangent = last.tangent + math.remainder(heading - last.tangent, math.tau)
        given = (
            a.h + u * math.remainder(b.h - a.h, math.tau)
            if a.h is not None and b.h is not None
            else tangent
        )
        h = last.h + math.remainder(given - last.h, math.tau)
        # Stations have to ascend, also where samples coincide.
        s = last.s + max(math.hypot(x - last.x, y - last.y), _SAME_PLACE) if samples else 0.0
        samples.append(Sample(s, x, y, a.z + u * (b.z - a.z), tangent, h))


def approach(x: float, y: float, h: float, z: float, target: WorldPose) -> Sampled:
    """A smooth way from a pose to a point of a path, leaving and arriving in the given directions.

    Args:
        x, y, z, h: where it begins, m and rad.
        target: where it ends.
    """
    reach = math.hypot(target.x - x, target.y - y)
    count = max(8, min(200, math.ceil(reach)))
    leave, arrive = (
        (reach * math.cos(h), reach * math.sin(h)),
        (reach * math.cos(target.h), reach * math.sin(target.h)),
    )
    samples = [Sample(0.0, x, y, z, h, h)]
    for index in range(1, count + 1):
        u = index / count
        v = 1.0 - u
        start, end, out, into = (
            v * v * (1.0 + 2.0 * u),
            u * u * (3.0 - 2.0 * u),
            u * v * v,
            -u * u * v,
        )
        px = start * x + end * target.x + out * leave[0] + into * arrive[0]
        py = start * y + end * target.y + out * leave[1] + into * arrive[1]
        ahead, before = 6.0 * u * v, v * (v - 2.0 * u)
        dx = ahead * (target.x - x) + before * leave[0] + u * (u - 2.0 * v) * arrive[0]
        dy = ahead * (target.y - y) + before * leave[1] + u * (u - 2.0 * v) * arrive[1]
        last = samples[-1]
        tangent = last.h + math.remainder(math.atan2(dy, dx) - last.h, math.tau)
        s = last.s + max(math.hypot(px - last.x, py - last.y), _SAME_PLACE)
        samples.append(Sample(s, px, py, z + u * (target.z - z), tangent, tangent))
    return Sampled(samples)


def tangent(path: Path, s: float) -> float:
    """Heading (rad) of a path's tangent at s, independent of prescribed orientations."""
    s = min(max(s, 0.0), path.length)
    # A difference, since the orientation of a path may be prescribed and need not be its tangent.
    a, b = path.at(max(s - _SHORT, 0.0)), path.at(min(s + _SHORT, path.length))
    return math.atan2(b.y - a.y, b.x - a.x)


def turns_back(path: Path, s: float) -> bool:
    """Whether a path reverses at s, so that an entity has to stop there."""
    before, here, after = (
        path.at(min(max(s + shift, 0.0), path.length)) for shift in (-_SHORT, 0.0, _SHORT)
    )
    return (here.x - before.x) * (after.x - here.x) + (here.y - before.y) * (after.y - here.y) < 0.0


def nearest(path: Path, x: float, y: float) -> float:
    """The s of the point of a path that is nearest to x, y (m); of several the first."""
    knots = path.knots()
    best, found = math.inf, 0.0
    poses = [path.at(knot) for knot in knots]
    for (a, b), (start, end) in zip(pairwise(poses), pairwise(knots), strict=True):
        dx, dy = b.x - a.x, b.y - a.y
        square = dx * dx + dy * dy
        u = min(max(((x - a.x) * dx + (y - a.y) * dy) / square, 0.0), 1.0) if square else 0.0
        gap = math.hypot(a.x + u * dx - x, a.y + u * dy - y)
        # With a tolerance, so that of equal places the first stays; refining is left to
        # improvements.
        if gap < best - _SAME_PLACE:
            best, found = gap, _refined(path, x, y, start, end, start + u * (end - start))
    return found


def _refined(path: Path, x: float, y: float, low: float, high: float, s: float) -> float:
    """The foot of the perpendicular between two s, from a guess on the chord, by steps along the
    tangent."""
    # Steps along the tangent converge where the curve bends gently over a chord; the bound ends
    # those that do not.
    for _ in range(_REFINEMENTS):
        here, h = path.at(s), tangent(path, s)
        moved = min(max(s + (x - here.x) * math.cos(h) + (y - here.y) * math.sin(h), low), high)
        if abs(moved - s) < 1e-7:
            return moved
        s = moved
    return s
