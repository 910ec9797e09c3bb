"""Where a position is: a pose in the world, and the place on the road that it is tied to."""

from __future__ import annotations

import math
from typing import NamedTuple

from xodr.model import RoadPoint


class Placement(NamedTuple):
    """Where a position is: a world pose, and the road point under it where the position is tied to a road.

    x, y, z in m; h, pitch, roll in rad; `direction` is +1 when h faces increasing s. `heading_offset` is h relative
    to the lane in the direction faced, rad.
    """

    x: float
    y: float
    z: float
    h: float
    pitch: float = 0.0
    roll: float = 0.0
    point: RoadPoint | None = None
    direction: int = 1
    heading_offset: float = 0.0


def wrap(angle: float) -> float:
    """Angle in (−π, π]."""
    return math.remainder(angle, math.tau)
