"""Plane curves of the builders: clothoids (lines and arcs among them) and parametric cubics (`paramPoly3`, p from 0 to 1)."""

from __future__ import annotations

import math
from typing import NamedTuple


class Pose(NamedTuple):
    """Position in m and heading in rad."""

    x: float
    y: float
    heading: float

    def shifted(self, t: float) -> Pose:
        """The pose `t` metres to the left, same heading."""
        return Pose(self.x - t * math.sin(self.heading), self.y + t * math.cos(self.heading), self.heading)

    def turned(self, angle: float) -> Pose:
        """The pose turned on the spot, counterclockwise."""
        return Pose(self.x, self.y, self.heading + angle)


class Segment(NamedTuple):
    """Piece of a reference line: its length in m and its curvatures at start and end in 1/m, linear between."""

    length: float
    start: float = 0.0
    end: float = 0.0


def line(length: float) -> Segment:
    """A straight piece."""
    return Segment(length)


def arc(length: float, curvature: float) -> Segment:
    """A circular piece; curvature positive to the left."""
    return Segment(length, curvature, curvature)


def advance(pose: Pose, segment: Segment) -> Pose:
    """The pose at the end of a segment that starts at `pose`."""
    from pyclothoids import Clothoid

    rate = (segment.end - segment.start) / segment.length
    curve = Clothoid.StandardParams(*pose, segment.start, rate, segment.length)
    turn = segment.length * (segment.start + segment.end) / 2
    return Pose(curve.XEnd, curve.YEnd, pose.heading + turn)


def connect(start: Pose, end: Pose) -> Segment:
    """Return the only clothoid from `start` to `end` that keeps both headings.

    Source: Bertolazzi and Frego, G1 fitting with clothoids, 2015.
    """
    from pyclothoids import Clothoid

    curve = Clothoid.G1Hermite(*start, *end)
    first, last = curve.KappaStart, curve.KappaEnd
    if abs(first - last) * curve.length < 1e-9:
        first = last = (first + last) / 2 if abs(first + last) * curve.length > 1e-9 else 0.0
    return Segment(curve.length, first, last)


Coefficients = tuple[float, float, float, float]


class ParamPoly3(NamedTuple):
    """A piece u(p), v(p) in the frame of its start: u ahead, v to the left, a + b·p + c·p² + d·p³ with p from 0 to 1.

    length: of the curve, in m. The curve begins at the frame's origin in its direction: a of both and b of v are 0.
    """

    length: float
    u: Coefficients
    v: Coefficients

    def after(self, pose: Pose) -> Pose:
        """The pose at the end of the piece that starts at `pose`; it turns by less than half a turn."""
        ahead, aside = sum(self.u), sum(self.v)
        turn = math.atan2(self.v[1] + 2 * self.v[2] + 3 * self.v[3], self.u[1] + 2 * self.u[2] + 3 * self.u[3])
        cos, sin = math.cos(pose.heading), math.sin(pose.heading)
        return Pose(pose.x + cos * ahead - sin * aside, pose.y + sin * ahead + cos * aside, pose.heading + turn)

    def mirrored(self) -> ParamPoly3:
        """The piece on the other side of its starting direction."""
        a, b, c, d = self.v
        return ParamPoly3(self.length, self.u, (-a, -b, -c, -d))
