"""Motion models of smoothing: states of vehicles and pedestrians by damped Gauss-Newton steps over
banded systems."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from recognition.recordings.motion.observations import Observations, cost, headings, turned, weight
from recognition.recordings.rows import Rows, rate
from schemas.common.array_types import FloatArray, IntArray

_ITERATIONS = 60
_ENOUGH = 1e-4
"""Tracks whose cost falls by less than this share of it are done."""
_DAMPING, _LEAST_DAMPING, _EASIER, _HARDER = 1e-3, 1e-9, 0.2, 10.0


class Terms(NamedTuple):
    """Residuals and what they depend on, for n rows of d states each.

    rows, rows_by: residuals of rows over their standard deviation (n, k), and their derivatives by
    the row's state (n, k, d). between: residuals of the intervals between rows (n - 1, m); 0 where
    a track ends. by_before, by_after: their derivatives by the states of the rows before and after
    (n - 1, m, d). cost: of each row and the interval after it (n,).
    """

    rows: FloatArray
    rows_by: FloatArray
    between: FloatArray
    by_before: FloatArray
    by_after: FloatArray
    cost: FloatArray


def minimum(
    z: FloatArray, starts: IntArray, scale: FloatArray, terms: Callable[[FloatArray], Terms]
) -> FloatArray:
    """States that minimise the cost of each track, by Levenberg and Marquardt's method.

    Args:
        z: states to begin with (n, d).
        starts: first row of each track, and n.
        scale: a usual change of each state in one step (d,).
        terms: residuals for states.
    """
    sizes, heads = np.diff(starts), starts[:-1]
    damping = np.full(len(heads), _DAMPING)
    now = terms(z)
    cost = np.add.reduceat(now.cost, heads)
    for _ in range(_ITERATIONS):
        # In units of a usual change: m, rad and 1/m can't be compared.
        moved = z + _step(now, np.repeat(damping, sizes)[:, None] / scale**2)
        then = terms(moved)
        costs = np.add.reduceat(then.cost, heads)
        better = costs <= cost
        slack = _ENOUGH * (1.0 + cost)
        done = np.abs(cost - costs) <= slack
        rows = np.repeat(better, sizes)
        z = np.where(rows[:, None], moved, z)
        # Small changes mean convergence with little damping only: with much, steps are short
        # anyway.
        if (done & (damping <= _DAMPING)).all():
            break
        # Tracks whose step was rejected keep their terms.
        now, cost = _chosen(rows, then, now), np.where(better, costs, cost)
        damping = np.where(
            better | done, np.maximum(_EASIER * damping, _LEAST_DAMPING), _HARDER * damping
        )
    return z


def _chosen(rows: NDArray[np.bool_], these: Terms, those: Terms) -> Terms:
    """The first terms in the rows of an array of truths, the others elsewhere."""
    if rows.all():
        return these

    def choose(this: FloatArray, that: FloatArray) -> FloatArray:
        return np.where(rows[: len(this)].reshape(-1, *[1] * (this.ndim - 1)), this, that)

    return Terms(*(choose(this, that) for this, that in zip(these, those, strict=True)))


def _step(terms: Terms, damping: FloatArray) -> FloatArray:
    """The step (n, d) to the minimum of the squares of the residuals and of the damped step."""
    n, _, d = terms.rows_by.shape
    own = terms.rows_by.mT @ terms.rows_by
    own[:, range(d), range(d)] += damping
    own[:-1] += terms.by_before.mT @ terms.by_before
    own[1:] += terms.by_after.mT @ terms.by_after
    slope = _weighed(terms.rows_by, terms.rows)
    slope[:-1] += _weighed(terms.by_before, terms.between)
    slope[1:] += _weighed(terms.by_after, terms.between)
    band = _band(own, terms.by_after.mT @ terms.by_before)
    return solveh_banded(
        band, -slope.ravel(), lower=True, overwrite_ab=True, check_finite=False
    ).reshape(n, d)


def _weighed(slopes: FloatArray, values: FloatArray) -> FloatArray:
    return (slopes.mT @ values[:, :, None])[:, :, 0]


def _band(own: FloatArray, across: FloatArray) -> FloatArray:
    """Lower band (2d, n d) of the symmetric matrix with diagonal blocks (n, d, d) and blocks below
    them (n - 1, d, d)."""
    n, d, _ = own.shape
    # Row k has the k-th diagonal below the main one, as solveh_banded takes it.
    band = np.zeros((2 * d, n, d))
    for column in range(d):
        for row in range(column, d):
            band[row - column, :, column] = own[:, row, column]
        for row in range(d):
            band[d + row - column, :-1, column] = across[:, row, column]
    return band.reshape(2 * d, n * d)


X, Y, H, V, A, K = range(6)
_SCALE = np.array([1.0, 1.0, 0.3, 3.0, 3.0, 0.1])
"""Usual changes of a state while the minimum is searched."""
_EXACT = (0.003, 0.003, 0.0005, 0.003)
"""Deviations of x, y, h, v from the model in a second, m, rad, m/s: the trapezoidal rule's, and
slip."""
_UNKNOWN = {A: 50.0, K: 2.0}
"""Deviations about 0 where nothing is known, so that tracks of few rows have a solution."""
_STEADY = 50.0
"""Deviation (m/s) of the speed from that at the start of the search, likewise."""
_FIRM = (0.1, 0.1, 0.1, 0.01)
"""Excess of speed (m/s), acceleration along and across (m/s²) and yaw rate (rad/s) that weighs as
one deviation of noise."""
_FIRM_JERK = 0.05
"""Excess of jerk (m/s³) that weighs as one deviation of noise."""


def smooth_vehicles(rows: Rows, seen: Observations) -> FloatArray:
    """x, y (m) of the rear axle, heading (rad), speed and acceleration along it
    of each row (n, 5).
    """
    h, still = headings(rows, seen), np.zeros(len(rows))
    along = rate(seen.x, rows) * np.cos(h) + rate(seen.y, rows) * np.sin(h)
    # A single row has no rate: its recorded speed counts.
    speed = np.where(rows.first < rows.last, along, seen.speed)
    x, y = seen.x - seen.behind * np.cos(h), seen.y - seen.behind * np.sin(h)
    start = np.stack([x, y, h, speed, still, still], axis=1)
    return minimum(start, seen.starts, _SCALE, lambda z: _terms(z, seen, speed))[:, :5]


def _terms(z: FloatArray, seen: Observations, speed: FloatArray) -> Terms:
    rows, rows_by, costs = _rows(z, seen, speed)
    between, before, after = _between(z, seen)
    costs[:-1] += (between * between).sum(axis=1)
    return Terms(rows, rows_by, between, before, after, costs)


def _rows(
    z: FloatArray, seen: Observations, speed: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Residuals of rows (centre, heading, what is unknown, limits), their
    derivatives, and costs.
    """
    n, tails = len(z), seen.noise.tails
    cos, sin, h, v = np.cos(z[:, H]), np.sin(z[:, H]), z[:, H], z[:, V]
    # States are of the rear axle, observations of the centre.
    off_x, off_y = z[:, X] + seen.behind * cos - seen.x, z[:, Y] + seen.behind * sin - seen.y
    turn = turned(h - seen.h)
    squares, turns = (off_x * off_x + off_y * off_y) / seen.off**2, (turn / seen.facing) ** 2
    # Iteratively reweighted least squares: the weight is the derivative of Student's cost by the
    # squared deviation.
    place, facing = (
        np.sqrt(seen.trusted * weight(squares, 2, tails)) / seen.off,
        np.sqrt(weight(turns, 1, tails)) / seen.facing,
    )
    value, by = np.zeros((n, 10)), np.zeros((n, 10, 6))
    value[:, 0], value[:, 1], value[:, 2] = off_x * place, off_y * place, turn * facing
    by[:, 0, X], by[:, 1, Y], by[:, 2, H] = place, place, facing
    by[:, 0, H], by[:, 1, H] = -seen.behind * sin * place, seen.behind * cos * place
    value[:, 3], by[:, 3, V] = (v - speed) / _STEADY, 1.0 / _STEADY
    for i, (column, deviation) in enumerate(_UNKNOWN.items(), start=4):
        value[:, i], by[:, i, column] = z[:, column] / deviation, 1.0 / deviation
    _limit(value, by, z, seen)
    # The first three residuals are reweighted: the cost itself is that of Student's distribution.
    costs = (
        seen.trusted * cost(squares, 2, tails)
        + cost(turns, 1, tails)
        + (value[:, 3:] ** 2).sum(axis=1)
    )
    return value, by, costs


def _limit(value: FloatArray, by: FloatArray, z: FloatArray, seen: Observations) -> None:
    """Enter excesses over limits as residuals 6 to 9, with their derivatives."""
    v, a, k, limits = z[:, V], z[:, A], z[:, K], seen.bounds
    one = np.ones(len(z))
    limited = (
        (v, -limits.reverse, limits.speed, {V: one}),
        (a, -limits.braking, limits.acceleration, {A: one}),
        (v * v * k, -limits.lateral, limits.lateral, {V: 2.0 * v * k, K: v * v}),
        (v * k, -limits.yaw_rate, limits.yaw_rate, {V: k, K: v}),
    )
    for i, ((what, least, most, slopes), firm) in enumerate(
        zip(limited, _FIRM, strict=True), start=6
    ):
        excess = what - np.clip(what, least, most)
        value[:, i] = excess / firm
        for column, slope in slopes.items():
            by[:, i, column] = np.where(excess != 0.0, slope / firm, 0.0)


def _between(z: FloatArray, seen: Observations) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Residuals of intervals (model, noise, limit of jerk), and their derivatives by the states
    before and after."""
    dt, m, noise = seen.steps, len(z) - 1, seen.noise
    # Rates are those of the mean state, so that the error is of third order in the step.
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
    # Noise that adds up as a random walk: with the root of the time.
    deviation = np.sqrt(dt)[:, None] * np.array([*_EXACT, noise.jerk, noise.bend, 1.0])
    # The limit of jerk is none: its excess adds up with the time.
    deviation[:, 6] = dt * _FIRM_JERK
    inverse = seen.joined[:, None] / deviation
    # Chain rule: both states are half of the mean, and −1 and +1 of the change.
    by_mean *= 0.5 * inverse[:, :, None]
    by_change *= inverse[:, :, None]
    return value * inverse, by_mean - by_change, by_mean + by_change


_PEDESTRIAN_SCALE = np.array([1.0, 1.0, 1.0, 1.0, 3.0, 3.0])
_PEDESTRIAN_EXACT = 0.003
"""Deviation of positions (m) and velocities (m/s) from the model in a second: the trapezoidal
rule's."""
_PEDESTRIAN_UNKNOWN = 50.0
"""Deviation of velocities (m/s) and accelerations (m/s²) about 0 where nothing is known."""
_TURNS = 0.5
"""Time to either side (s) over which pedestrians turn."""
_PEDESTRIAN_FIRM = 0.1
"""Excess of speed (m/s) and acceleration (m/s²) that weighs as one deviation of noise."""


def smooth_pedestrians(rows: Rows, seen: Observations) -> FloatArray:
    """x, y (m), heading (rad), speed and acceleration along it of each row (n, 5)."""
    still = np.zeros(len(rows))
    start = np.stack([seen.x, seen.y, rate(seen.x, rows), rate(seen.y, rows), still, still], axis=1)
    x, y, vx, vy, ax, ay = minimum(
        start, seen.starts, _PEDESTRIAN_SCALE, lambda z: _pedestrian_terms(z, seen)
    ).T
    h = _turning(headings(rows, seen), rows)
    return np.stack(
        [x, y, h, vx * np.cos(h) + vy * np.sin(h), ax * np.cos(h) + ay * np.sin(h)], axis=1
    )


def _turning(h: FloatArray, rows: Rows) -> FloatArray:
    """Headings as means over `_TURNS` to either side: a turn on the spot takes that time."""
    reach = max(1, round(_TURNS / rows.step))
    here = np.arange(len(rows))
    start, end = rows.each(rows.starts[:-1]), rows.each(rows.starts[1:])
    total = np.append(0.0, np.cumsum(h))
    first, last = np.maximum(here - reach, start), np.minimum(here + reach + 1, end)
    return (total[last] - total[first]) / (last - first)


def _pedestrian_terms(z: FloatArray, seen: Observations) -> Terms:
    n = len(z)
    off = z[:, :2] - np.stack([seen.x, seen.y], axis=1)
    squares = (off * off).sum(axis=1) / seen.off**2
    place = np.sqrt(seen.trusted * weight(squares, 2, seen.noise.tails)) / seen.off
    value, by = np.zeros((n, 8)), np.zeros((n, 8, 6))
    value[:, :2] = off * place[:, None]
    by[:, range(2), range(2)] = place[:, None]
    value[:, 2:6], by[:, range(2, 6), range(2, 6)] = (
        z[:, 2:] / _PEDESTRIAN_UNKNOWN,
        1.0 / _PEDESTRIAN_UNKNOWN,
    )
    for i, (column, most) in enumerate(
        ((2, seen.bounds.speed), (4, seen.bounds.acceleration)), start=6
    ):
        vector = z[:, column : column + 2]
        length = np.hypot(*vector.T)
        beyond = length > most
        value[:, i] = np.where(beyond, length - most, 0.0) / _PEDESTRIAN_FIRM
        by[:, i, column : column + 2] = (
            np.where(beyond[:, None], vector / np.maximum(length, 1e-9)[:, None], 0.0)
            / _PEDESTRIAN_FIRM
        )
    between, before, after = _pedestrian_between(z, seen)
    costs = seen.trusted * cost(squares, 2, seen.noise.tails) + (value[:, 2:] ** 2).sum(axis=1)
    costs[:-1] += (between * between).sum(axis=1)
    return Terms(value, by, between, before, after, costs)


def _pedestrian_between(
    z: FloatArray, seen: Observations
) -> tuple[FloatArray, FloatArray, FloatArray]:
    dt = seen.steps[:, None]
    mean, change = 0.5 * (z[:-1] + z[1:]), z[1:] - z[:-1]
    inverse = seen.joined[:, None] / (
        np.sqrt(dt) * np.array([_PEDESTRIAN_EXACT] * 4 + [seen.noise.jerk] * 2)
    )
    value = change.copy()
    value[:, :4] -= dt * mean[:, 2:]
    by_change = np.broadcast_to(np.eye(6), (len(dt), 6, 6)) * inverse[:, :, None]
    by_mean = np.broadcast_to(np.eye(6, k=2), (len(dt), 6, 6)) * (-0.5 * dt * inverse)[:, :, None]
    return value * inverse, by_mean - by_change, by_mean + by_change
