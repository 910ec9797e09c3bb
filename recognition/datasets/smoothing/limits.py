"""What vehicles and pedestrians can do: limits of speed, acceleration, jerk and turning, by category, with their sources."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple, Self

import numpy as np

from xodr.array_types import FloatArray, IntArray


class Limits(NamedTuple):
    """Greatest speed and speed in reverse (m/s), acceleration and braking along the path, acceleration across it (m/s²), jerk
    (m/s³), yaw rate (rad/s)."""

    speed: float
    reverse: float
    acceleration: float
    braking: float
    lateral: float
    jerk: float
    yaw_rate: float


_CAR = Limits(70.0, 5.0, 5.0, 9.0, 8.0, 15.0, 1.0)
_HEAVY = Limits(35.0, 3.0, 3.0, 8.0, 5.0, 15.0, 0.6)
LIMITS = {
    "car": _CAR,
    "van": _CAR._replace(speed=50.0),
    "truck": _HEAVY,
    "bus": _HEAVY,
    "tram": Limits(25.0, 3.0, 2.0, 4.0, 3.0, 15.0, 0.6),
    "motorbike": _CAR._replace(speed=80.0, acceleration=8.0),
    "bicycle": Limits(20.0, 1.0, 3.0, 6.0, 5.0, 15.0, 1.5),
    "pedestrian": Limits(10.0, 0.0, 5.0, 5.0, 5.0, 30.0, 3.2),
}
"""Sources. Acceleration up to 5 m/s², jerk up to 15 m/s³: Punzo, Borzacchiello and Ciuffo (Transp. Res. C 19, 2011), Montanino
and Punzo (Transp. Res. B 80, 2015), who find no more in what is sound of NGSIM. Braking of 9 m/s² and 8 m/s² across: tyres on dry
asphalt; SUMO's emergency braking of cars is 9 m/s² too. Heavy vehicles brake at up to 8 m/s², and tip over beyond 5 m/s² across
(Gillespie, Fundamentals of Vehicle Dynamics, 1992). Yaw rates: what the smallest turning circle (11 m, 20 m of heavy vehicles)
allows at a walking speed of 5 m/s. Speeds are those that catalogue entries of the category have."""


class Bounds(NamedTuple):
    """Limits of each row, (n,) each; units as in `Limits`."""

    speed: FloatArray
    reverse: FloatArray
    acceleration: FloatArray
    braking: FloatArray
    lateral: FloatArray
    jerk: FloatArray
    yaw_rate: FloatArray

    @classmethod
    def of(cls, categories: Iterable[str], sizes: IntArray) -> Self:
        """Those of tracks of these categories, with so many rows each."""
        return cls(*np.repeat(np.array([LIMITS.get(category, _CAR) for category in categories]), sizes, axis=0).T)
