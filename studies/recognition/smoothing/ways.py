"""Ways to smooth: ours, and those that well-kept libraries have."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from recognition.recordings.motion import motion_models
from recognition.recordings.motion.observations import Bounds, Noise, Observations
from recognition.recordings.motion.smoothing import centres, observed, states
from schemas.common.array_types import BoolArray, FloatArray
from studies.recognition.smoothing.cases import Case, States

Way = Callable[[Case], States]
_Smooth = Callable[[FloatArray, FloatArray, BoolArray], FloatArray]
"""Times (n,), values and which are unseen; gives values and their first two rates of change (3, n).
"""
_GAUSSIAN = 1e9
"""Degrees of freedom from which Student's t distribution is a normal one."""
_MOVING = 1.0
"""Speed (m/s) from which a way shows where it heads."""


def ours(noise: Noise, case: Case) -> States:
    """As recordings are smoothed when they are read, with these settings."""
    rows, who, columns = case.tracks
    found = states(rows, who, _seen(case, noise), columns)
    return States(*centres(rows, who, found), found["h"], found["speed"], found["acceleration"])


def constant_acceleration(jerk: float, case: Case) -> States:
    """The Rauch-Tung-Striebel smoother of constant acceleration, as the field has it: normal noise,
    no limits."""
    seen = _seen(case, Noise(jerk=jerk, tails=_GAUSSIAN))
    free = np.full(len(seen.time), np.inf)
    forwards = Bounds(*[free] * len(seen.bounds))._replace(reverse=np.zeros(len(free)))
    return States(
        *motion_models.smooth_pedestrians(case.tracks.rows, seen._replace(bounds=forwards)).T
    )


def savitzky_golay(window: float, order: int, case: Case) -> States:
    """SciPy's `savgol_filter` over a time (s), with polynomials of an order; unseen rows are on the
    line between seen ones."""
    from scipy.signal import savgol_filter

    step = case.tracks.rows.step
    length = 2 * max(round(0.5 * window / step), (order + 1) // 2) + 1

    def filtered(_: FloatArray, values: FloatArray, __: BoolArray) -> FloatArray:
        own = min(length, (len(values) - 1) // 2 * 2 + 1)
        return np.stack(
            [
                savgol_filter(values, own, min(order, own - 1), deriv=each, delta=step)
                for each in range(3)
            ]
        )

    return _of_coordinates(case, filtered)


def spline(weight: float | None, case: Case) -> States:
    """SciPy's `make_smoothing_spline` through the rows that are seen; by generalised
    cross-validation without a weight."""
    from scipy.interpolate import make_smoothing_spline

    def fitted(time: FloatArray, values: FloatArray, unseen: BoolArray) -> FloatArray:
        curve = make_smoothing_spline(time[~unseen], values[~unseen], lam=weight)
        return np.stack([curve(time), curve.derivative()(time), curve.derivative(2)(time)])

    return _of_coordinates(case, fitted)


def _seen(case: Case, noise: Noise) -> Observations:
    """Return the inputs of smoothers; of hidden rows only their accuracy."""
    seen = observed(*case.tracks, case.unseen, noise)
    return seen._replace(off=case.off, facing=np.where(case.unseen, np.inf, noise.heading))


def _of_coordinates(case: Case, smooth: _Smooth) -> States:
    """Each coordinate of each track on its own; speeds and accelerations along
    recorded headings.
    """
    rows, who, columns = case.tracks
    places = centres(rows, who, columns)
    found = np.empty((2, 3, len(rows)))
    for start, end in zip(rows.starts[:-1].tolist(), rows.starts[1:].tolist(), strict=True):
        for i, values in enumerate(places):
            found[i, :, start:end] = smooth(
                rows.time[start:end], values[start:end], case.unseen[start:end]
            )
    (x, vx, ax), (y, vy, ay) = found
    cos, sin = np.cos(columns["h"]), np.sin(columns["h"])
    speed = vx * cos + vy * sin
    h = np.where(speed >= _MOVING, np.arctan2(vy, vx), columns["h"])
    return States(x, y, h, speed, ax * cos + ay * sin)
