"""Braking that would have avoided a contact: an entity slows down on its own path, the other one moves as recorded."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from runner.measures.measure import GREATEST_DECELERATION
from runner.measures.relations import Motion, boxes_overlap
from schemas.common.array_types import FloatArray

FULL = 8.0
"""Deceleration (m/s²) of full braking by a car on a dry road"""
_LONGEST = 10.0
"""Longest time (s) before a contact at which braking is tried"""
_STEP = 0.05
"""Between the instants that are looked at, s"""
_HALVINGS = 12
"""Of the interval in which the least deceleration lies"""


@dataclass(frozen=True)
class Conflict:
    """A participant, the other one that it touches, and the row of the participant at which it does."""

    ego: Motion
    other: Motion
    row: int

    def latest(self, deceleration: float) -> float | None:
        """The latest instant (s) from which constant braking (m/s²) avoids the contact; None where none of the last 10 s does."""
        stride = max(1, round(_STEP / _timestep(self.ego)))
        first = int(np.searchsorted(self.ego.time, self.ego.time[self.row] - _LONGEST))
        rows = range(self.row - 1, first - 1, -stride)
        return next((float(self.ego.time[row]) for row in rows if self._avoids(row, deceleration)), None)

    def least(self, time: float) -> float | None:
        """The least constant braking (m/s²) from an instant (s) on that avoids the contact; None if it is beyond grip."""
        row = int(np.searchsorted(self.ego.time, time - 1e-6))
        if row >= self.row or not self._avoids(row, GREATEST_DECELERATION):
            return None
        low, high = 0.0, GREATEST_DECELERATION
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            low, high = (low, middle) if self._avoids(row, middle) else (middle, high)
        return high

    def _avoids(self, row: int, deceleration: float) -> bool:
        """Whether no contact comes of constant braking from a row on, until the ego stands and the other's record has ended."""
        begin, speed = float(self.ego.time[row]), abs(float(self.ego.speed[row]))
        standing = speed / max(deceleration, 1e-3)
        end = max(begin + min(standing, 2 * _LONGEST), float(self.other.time[-1]))
        time = np.arange(max(begin, float(self.other.time[0])), end + _STEP, _STEP)
        braked = np.minimum(time - begin, standing)
        way = speed * braked - deceleration * braked**2 / 2
        return not boxes_overlap(_along(self.ego, row, way), _at(self.other, time)).any()


def _along(motion: Motion, row: int, way: FloatArray) -> Motion:
    """A participant on its own path, so far (m) from where it is at a row; straight on where the path has ended."""
    x, y = motion.x[row:], motion.y[row:]
    driven = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    moving = np.concatenate([[True], np.diff(driven) > 0.0])
    h = np.unwrap(motion.h[row:])
    x, y, z, h = (np.interp(way, driven[moving], values[moving]) for values in (x, y, motion.z[row:], h))
    return _moved(motion, x, y, z, h, np.maximum(way - driven[-1], 0.0))


def _at(motion: Motion, time: FloatArray) -> Motion:
    """A participant at instants (s); after its last one straight on with its last speed."""
    h = np.unwrap(motion.h)
    x, y, z, h = (np.interp(time, motion.time, values) for values in (motion.x, motion.y, motion.z, h))
    return _moved(motion, x, y, z, h, motion.speed[-1] * np.maximum(time - motion.time[-1], 0.0))


def _moved(motion: Motion, x: FloatArray, y: FloatArray, z: FloatArray, h: FloatArray, ahead: FloatArray) -> Motion:
    """A participant at other places, each moved ahead (m)."""
    nothing = np.zeros_like(x)
    x, y = x + ahead * np.cos(h), y + ahead * np.sin(h)
    no_road = np.full(len(x), None, object)
    return replace(motion, time=nothing, x=x, y=y, z=z, h=h, speed=nothing, road=no_road, s=nothing, t=nothing)


def _timestep(motion: Motion) -> float:
    return float(np.diff(motion.time).min()) if len(motion.time) > 1 else _STEP
