"""How vehicles move: the rear axle goes where the vehicle heads, as in the kinematic bicycle model.

State: x, y (m) and heading h (rad) of the rear axle, speed v (m/s) and acceleration a (m/s²) along the heading, curvature κ of
its path (1/m). From row to row v, h, x and y follow by the trapezoidal rule; changes of a and κ are white noise. A vehicle that
stands does not turn, whatever its recorded positions and headings do.
"""

from __future__ import annotations

import numpy as np

from recognition.datasets.smoothing.banded import Terms, minimum
from recognition.datasets.smoothing.headings import headings
from recognition.datasets.smoothing.observations import Seen, cost, turned, weight
from recognition.datasets.tables.rates import rate
from recognition.datasets.tables.rows import Rows
from xodr.array_types import FloatArray

X, Y, H, V, A, K = range(6)
_SCALE = np.array([1.0, 1.0, 0.3, 3.0, 3.0, 0.1])
"""Usual changes of a state while the minimum is searched."""
_EXACT = (0.003, 0.003, 0.0005, 0.003)
"""Deviations of x, y, h, v from the model in a second, m, rad, m/s: the trapezoidal rule's, and slip."""
_UNKNOWN = {A: 50.0, K: 2.0}
"""Deviations about 0 where nothing is known, so that tracks of few rows have a solution."""
_STEADY = 50.0
"""Deviation (m/s) of the speed from that at the start of the search, likewise."""
_FIRM = (0.1, 0.1, 0.1, 0.01)
"""Excess of speed (m/s), acceleration along and across (m/s²) and yaw rate (rad/s) that weighs as one deviation of noise."""
_FIRM_JERK = 0.05
"""Excess of jerk (m/s³) that does."""


def smooth(rows: Rows, seen: Seen) -> FloatArray:
    """x, y (m) of the rear axle, heading (rad), speed and acceleration along it of each row (n, 5)."""
    h, still = headings(rows, seen), np.zeros(len(rows))
    along = rate(seen.x, rows) * np.cos(h) + rate(seen.y, rows) * np.sin(h)
    speed = np.where(rows.first < rows.last, along, seen.speed)
    x, y = seen.x - seen.behind * np.cos(h), seen.y - seen.behind * np.sin(h)
    start = np.stack([x, y, h, speed, still, still], axis=1)
    return minimum(start, seen.starts, _SCALE, lambda z: _terms(z, seen, speed))[:, :5]


def _terms(z: FloatArray, seen: Seen, speed: FloatArray) -> Terms:
    rows, rows_by, costs = _rows(z, seen, speed)
    between, before, after = _between(z, seen)
    costs[:-1] += (between * between).sum(axis=1)
    return Terms(rows, rows_by, between, before, after, costs)


def _rows(z: FloatArray, seen: Seen, speed: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Residuals of rows (centre, heading, what is unknown, limits), their derivatives, and costs."""
    n, tails = len(z), seen.noise.tails
    cos, sin, h, v = np.cos(z[:, H]), np.sin(z[:, H]), z[:, H], z[:, V]
    off_x, off_y = z[:, X] + seen.behind * cos - seen.x, z[:, Y] + seen.behind * sin - seen.y
    turn = turned(h - seen.h)
    squares, turns = (off_x * off_x + off_y * off_y) / seen.off**2, (turn / seen.facing) ** 2
    place, facing = np.sqrt(seen.trusted * weight(squares, 2, tails)) / seen.off, np.sqrt(weight(turns, 1, tails)) / seen.facing
    value, by = np.zeros((n, 10)), np.zeros((n, 10, 6))
    value[:, 0], value[:, 1], value[:, 2] = off_x * place, off_y * place, turn * facing
    by[:, 0, X], by[:, 1, Y], by[:, 2, H] = place, place, facing
    by[:, 0, H], by[:, 1, H] = -seen.behind * sin * place, seen.behind * cos * place
    value[:, 3], by[:, 3, V] = (v - speed) / _STEADY, 1.0 / _STEADY
    for i, (column, deviation) in enumerate(_UNKNOWN.items(), start=4):
        value[:, i], by[:, i, column] = z[:, column] / deviation, 1.0 / deviation
    _limit(value, by, z, seen)
    costs = seen.trusted * cost(squares, 2, tails) + cost(turns, 1, tails) + (value[:, 3:] ** 2).sum(axis=1)
    return value, by, costs


def _limit(value: FloatArray, by: FloatArray, z: FloatArray, seen: Seen) -> None:
    """Enter how far rows are beyond limits, as residuals 6 to 9, and the derivatives where they are."""
    v, a, k, limits = z[:, V], z[:, A], z[:, K], seen.bounds
    one = np.ones(len(z))
    limited = (
        (v, -limits.reverse, limits.speed, {V: one}),
        (a, -limits.braking, limits.acceleration, {A: one}),
        (v * v * k, -limits.lateral, limits.lateral, {V: 2.0 * v * k, K: v * v}),
        (v * k, -limits.yaw_rate, limits.yaw_rate, {V: k, K: v}),
    )
    for i, ((what, least, most, slopes), firm) in enumerate(zip(limited, _FIRM, strict=True), start=6):
        excess = what - np.clip(what, least, most)
        value[:, i] = excess / firm
        for column, slope in slopes.items():
            by[:, i, column] = np.where(excess != 0.0, slope / firm, 0.0)


def _between(z: FloatArray, seen: Seen) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Residuals of intervals (model, noise, limit of jerk), and their derivatives by the states before and after."""
    dt, m, noise = seen.steps, len(z) - 1, seen.noise
    mean, change = 0.5 * (z[:-1] + z[1:]), z[1:] - z[:-1]
    cos, sin, (v, a, k) = np.cos(mean[:, H]), np.sin(mean[:, H]), mean[:, V:].T
    excess = np.abs(change[:, A]) - seen.bounds.jerk[:-1] * dt
    value, by_mean, by_change = np.empty((m, 7)), np.zeros((m, 7, 6)), np.zeros((m, 7, 6))
    value[:, :4] = change[:, :4] - dt[:, None] * np.stack([v * cos, v * sin, v * k, a], axis=1)
    value[:, 4:6] = change[:, 4:6]
    value[:, 6] = np.where(excess > 0.0, np.sign(change[:, A]) * excess, 0.0)
    by_mean[:, 0, H], by_mean[:, 0, V] = dt * v * sin, -dt * cos
    by_mean[:, 1, H], by_mean[:, 1, V] = -dt * v * cos, -dt * sin
    by_mean[:, 2, V], by_mean[:, 2, K], by_mean[:, 3, A] = -dt * k, -dt * v, -dt
    by_change[:, range(6), range(6)] = 1.0
    by_change[:, 6, A] = excess > 0.0
    deviation = np.sqrt(dt)[:, None] * np.array([*_EXACT, noise.jerk, noise.bend, 1.0])
    deviation[:, 6] = dt * _FIRM_JERK
    inverse = seen.joined[:, None] / deviation
    by_mean *= 0.5 * inverse[:, :, None]
    by_change *= inverse[:, :, None]
    return value * inverse, by_mean - by_change, by_mean + by_change
