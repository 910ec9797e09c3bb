"""How pedestrians move: to every side.

State: x, y (m), their velocities (m/s) and accelerations (m/s²), whose changes are white noise.
"""

from __future__ import annotations

import numpy as np

from recognition.datasets.smoothing.banded import Terms, minimum
from recognition.datasets.smoothing.headings import headings
from recognition.datasets.smoothing.observations import Seen, cost, weight
from recognition.datasets.tables.rates import rate
from recognition.datasets.tables.rows import Rows
from xodr.array_types import FloatArray

_SCALE = np.array([1.0, 1.0, 1.0, 1.0, 3.0, 3.0])
_EXACT = 0.003
"""Deviation of positions (m) and velocities (m/s) from the model in a second: the trapezoidal rule's."""
_UNKNOWN = 50.0
"""Deviation of velocities (m/s) and accelerations (m/s²) about 0 where nothing is known."""
_TURNS = 0.5
"""Time to either side (s) over which pedestrians turn."""
_FIRM = 0.1
"""Excess of speed (m/s) and acceleration (m/s²) that weighs as one deviation of noise."""


def smooth(rows: Rows, seen: Seen) -> FloatArray:
    """x, y (m), heading (rad), speed and acceleration along it of each row (n, 5)."""
    still = np.zeros(len(rows))
    start = np.stack([seen.x, seen.y, rate(seen.x, rows), rate(seen.y, rows), still, still], axis=1)
    x, y, vx, vy, ax, ay = minimum(start, seen.starts, _SCALE, lambda z: _terms(z, seen)).T
    h = _turning(headings(rows, seen), rows)
    return np.stack([x, y, h, vx * np.cos(h) + vy * np.sin(h), ax * np.cos(h) + ay * np.sin(h)], axis=1)


def _turning(h: FloatArray, rows: Rows) -> FloatArray:
    """Headings as means over `_TURNS` to either side: who turns on the spot takes that time for it."""
    reach = max(1, round(_TURNS / rows.step))
    here = np.arange(len(rows))
    start, end = rows.each(rows.starts[:-1]), rows.each(rows.starts[1:])
    total = np.append(0.0, np.cumsum(h))
    first, last = np.maximum(here - reach, start), np.minimum(here + reach + 1, end)
    return (total[last] - total[first]) / (last - first)


def _terms(z: FloatArray, seen: Seen) -> Terms:
    n = len(z)
    off = z[:, :2] - np.stack([seen.x, seen.y], axis=1)
    squares = (off * off).sum(axis=1) / seen.off**2
    place = np.sqrt(seen.trusted * weight(squares, 2, seen.noise.tails)) / seen.off
    value, by = np.zeros((n, 8)), np.zeros((n, 8, 6))
    value[:, :2] = off * place[:, None]
    by[:, range(2), range(2)] = place[:, None]
    value[:, 2:6], by[:, range(2, 6), range(2, 6)] = z[:, 2:] / _UNKNOWN, 1.0 / _UNKNOWN
    for i, (column, most) in enumerate(((2, seen.bounds.speed), (4, seen.bounds.acceleration)), start=6):
        vector = z[:, column : column + 2]
        length = np.hypot(*vector.T)
        beyond = length > most
        value[:, i] = np.where(beyond, length - most, 0.0) / _FIRM
        by[:, i, column : column + 2] = np.where(beyond[:, None], vector / np.maximum(length, 1e-9)[:, None], 0.0) / _FIRM
    between, before, after = _between(z, seen)
    costs = seen.trusted * cost(squares, 2, seen.noise.tails) + (value[:, 2:] ** 2).sum(axis=1)
    costs[:-1] += (between * between).sum(axis=1)
    return Terms(value, by, between, before, after, costs)


def _between(z: FloatArray, seen: Seen) -> tuple[FloatArray, FloatArray, FloatArray]:
    dt = seen.steps[:, None]
    mean, change = 0.5 * (z[:-1] + z[1:]), z[1:] - z[:-1]
    inverse = seen.joined[:, None] / (np.sqrt(dt) * np.array([_EXACT] * 4 + [seen.noise.jerk] * 2))
    value = change.copy()
    value[:, :4] -= dt * mean[:, 2:]
    by_change = np.broadcast_to(np.eye(6), (len(dt), 6, 6)) * inverse[:, :, None]
    by_mean = np.broadcast_to(np.eye(6, k=2), (len(dt), 6, 6)) * (-0.5 * dt * inverse)[:, :, None]
    return value * inverse, by_mean - by_change, by_mean + by_change
