"""What a scenario declares about a participant."""

from __future__ import annotations

import math
from typing import NamedTuple


class BoundingBox(NamedTuple):
    """Box of an entity in its own frame: x forward, y left, z up from the reference point (rear axle on the ground), m."""

    x: float
    y: float
    z: float
    length: float
    width: float
    height: float


class Performance(NamedTuple):
    """Limits of a vehicle: m/s, m/s² and (jerk) m/s³; infinite where the file gives none."""

    max_speed: float = math.inf
    max_acceleration: float = math.inf
    max_deceleration: float = math.inf
    max_acceleration_rate: float = math.inf
    max_deceleration_rate: float = math.inf
