"""Pieces of a reference line that are parametric cubics (`paramPoly3` of OpenDRIVE, with p from 0 to 1)."""

from __future__ import annotations

import math
from typing import NamedTuple

from xodr.builders.curves import Pose

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
