"""Rows of all vehicles of a recording: one for each vehicle and frame, in the order of tracks and time.

"Left" is the left of the lane's traffic. Lanes are those of the reference point.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recognition.labels.rules import Rules
from recognition.sites import Role, Site
from recognition.sites.roles import ROLES
from runner.recording import Recording
from xodr.array_types import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class SceneRows:
    """Rows of all vehicles.

    Attributes:
        names: of the tracks. egos: whether events may be about each of them.
        track: index of each row's track. frame: number of its time step. time: s.
        first, last: first and last row of the part without missing frames that each row is in.
        x, y, h, speed, acceleration: as in the recording; the acceleration is smoothed.
        strip: index of the lane strip. along: distance from its beginning, m. offset, aside: distance to the left of the
            lane's centre and of the road's reference line, m.
        role: index into `ROLES`. front, rear: distance of the box's ends ahead of the reference point, m. width: of the box, m.
    """

    recording: Recording
    site: Site
    rules: Rules
    step: float
    names: list[str]
    egos: BoolArray
    track: IntArray
    frame: IntArray
    time: FloatArray
    first: IntArray
    last: IntArray
    x: FloatArray
    y: FloatArray
    h: FloatArray
    speed: FloatArray
    acceleration: FloatArray
    strip: IntArray
    along: FloatArray
    offset: FloatArray
    aside: FloatArray
    role: IntArray
    front: FloatArray
    rear: FloatArray
    width: FloatArray

    def rows(self, seconds: float) -> int:
        """Number of time steps in a time, at least 1."""
        return max(1, round(seconds / self.step))

    def has_role(self, *roles: Role) -> BoolArray:
        """Rows on lanes of these roles."""
        return np.isin(self.role, [ROLES.index(role) for role in roles])
