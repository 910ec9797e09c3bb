"""What a sensor makes of traffic: noise, vehicles that it misses, and tracks that it sees in part."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recognition.recorder.motion import VehicleMotion
from xodr.array_types import FloatArray

_TURN = 0.1
"""Noise of headings over that of positions, rad/m."""
_SPEED = 1.0
"""Noise of velocities over that of positions, 1/s."""


@dataclass(frozen=True)
class Sensor:
    """How exact a sensor is; the default misses nothing.

    Attributes:
        noise: standard deviation of positions, m; velocities and headings are off in proportion.
        dropped: share of the vehicles that are never seen.
        cut: share of the others of which only a part of the way is seen, half of it or more.
    """

    noise: float = 0.0
    dropped: float = 0.0
    cut: float = 0.0

    def sees(self, moving: VehicleMotion, rng: np.random.Generator) -> VehicleMotion:
        """What is seen of vehicles, with noise."""
        if self == EXACT:
            return moving
        moving = moving.where(self._seen(moving, rng))
        count = len(moving.x)

        def noisy(values: FloatArray, factor: float) -> FloatArray:
            return values + factor * self.noise * rng.standard_normal(count)

        return moving._replace(
            x=noisy(moving.x, 1.0), y=noisy(moving.y, 1.0), h=noisy(moving.h, _TURN),
            vx=noisy(moving.vx, _SPEED), vy=noisy(moving.vy, _SPEED),
        )  # fmt: skip

    def _seen(self, moving: VehicleMotion, rng: np.random.Generator) -> NDArray[np.bool_]:
        vehicles, start, vehicle = np.unique(moving.vehicle, return_index=True, return_inverse=True)
        size = np.bincount(vehicle, minlength=len(vehicles))
        missed = rng.random(len(vehicles)) < self.dropped
        part = np.where(rng.random(len(vehicles)) < self.cut, rng.uniform(0.5, 1.0, len(vehicles)), 1.0)
        begin = rng.uniform(0.0, 1.0, len(vehicles)) * (1.0 - part)
        share = (np.arange(len(vehicle)) - start[vehicle]) / np.maximum(size[vehicle] - 1, 1)
        return ~missed[vehicle] & (share >= begin[vehicle]) & (share <= (begin + part)[vehicle])


EXACT = Sensor()
"""Sees everything as it is."""
