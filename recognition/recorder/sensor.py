"""What a sensor makes of traffic: noise, distortion, vehicles that it misses, and tracks that it sees in part."""

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
_WAVES = 3
_WAVELENGTHS = 30.0, 120.0
"""Of distortion, m."""


@dataclass(frozen=True)
class Sensor:
    """How exact a sensor is; the default misses nothing.

    Attributes:
        noise: standard deviation of positions, m; velocities and headings are off in proportion.
        distortion: standard deviation of displacements that vary slowly from place to place, m, half of them the same for all
            vehicles, as where map and camera do not agree, and half each one's own, as of drivers who leave the lane's centre.
        dropped: share of the vehicles that are never seen.
        cut: share of the others of which only a part of the way is seen, a quarter of it or more.
    """

    noise: float = 0.0
    distortion: float = 0.0
    dropped: float = 0.0
    cut: float = 0.0

    def sees(self, moving: VehicleMotion, rng: np.random.Generator) -> VehicleMotion:
        """What is seen of vehicles, with noise."""
        if self == EXACT:
            return moving
        moving = self._distorted(moving.where(self._seen(moving, rng)), rng)
        count = len(moving.x)

        def noisy(values: FloatArray, factor: float) -> FloatArray:
            return values + factor * self.noise * rng.standard_normal(count)

        return moving._replace(
            x=noisy(moving.x, 1.0), y=noisy(moving.y, 1.0), h=noisy(moving.h, _TURN),
            vx=noisy(moving.vx, _SPEED), vy=noisy(moving.vy, _SPEED),
        )  # fmt: skip

    def _distorted(self, moving: VehicleMotion, rng: np.random.Generator) -> VehicleMotion:
        """Places displaced by waves over the map; velocities and headings follow."""
        vehicle = np.unique(moving.vehicle, return_inverse=True)[1]
        along = np.stack([np.cos(moving.h), np.sin(moving.h)])
        place, velocity = np.stack([moving.x, moving.y]), np.stack([moving.vx, moving.vy])
        shift, change, turn = np.zeros_like(place), np.zeros_like(place), np.zeros_like(place)
        for axis in np.repeat([0, 1], _WAVES):
            angle, length = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(*_WAVELENGTHS)
            wave = 2.0 * np.pi / length * np.array([np.cos(angle), np.sin(angle)])
            everybody, own = rng.standard_normal(2), rng.standard_normal((vehicle.max(initial=0) + 1, 2))
            cosine, sine = self.distortion / np.sqrt(2.0 * _WAVES) * (everybody + own)[vehicle].T
            phase = wave @ place
            slope = sine * np.cos(phase) - cosine * np.sin(phase)
            shift[axis] += cosine * np.cos(phase) + sine * np.sin(phase)
            change[axis] += slope * (wave @ velocity)
            turn[axis] += slope * (wave @ along)
        heading = np.arctan2(*(along + turn)[::-1]) - np.arctan2(*along[::-1])
        return moving._replace(
            x=moving.x + shift[0], y=moving.y + shift[1], vx=moving.vx + change[0], vy=moving.vy + change[1],
            h=moving.h + (heading + np.pi) % (2.0 * np.pi) - np.pi,
        )  # fmt: skip

    def _seen(self, moving: VehicleMotion, rng: np.random.Generator) -> NDArray[np.bool_]:
        vehicles, start, vehicle = np.unique(moving.vehicle, return_index=True, return_inverse=True)
        size = np.bincount(vehicle, minlength=len(vehicles))
        missed = rng.random(len(vehicles)) < self.dropped
        part = np.where(rng.random(len(vehicles)) < self.cut, rng.uniform(0.25, 1.0, len(vehicles)), 1.0)
        begin = rng.uniform(0.0, 1.0, len(vehicles)) * (1.0 - part)
        share = (np.arange(len(vehicle)) - start[vehicle]) / np.maximum(size[vehicle] - 1, 1)
        return ~missed[vehicle] & (share >= begin[vehicle]) & (share <= (begin + part)[vehicle])


EXACT = Sensor()
"""Sees everything as it is."""
