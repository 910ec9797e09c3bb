"""Trajectories by knots, what they have to do with the seven parameters, and the box that both have
in common."""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np

from generation.space.space import Space
from recognition.labels.maneuvers.estimation import (
    distance_model,
    fit_speeds,
    progress,
    reconstruct,
)
from recognition.labels.maneuvers.parameters import PARAMETERS
from schemas.common.array_types import FloatArray

NUMBER = 6
"""Of knots: the fewest that describe recorded cut-ins within the published errors of
reconstruction."""
CAR = 4.5
"""Distance (m) of the reference points of two catalogue cars that touch bumper to bumper."""
_SHARES = np.linspace(0.0, 1.0, NUMBER)
_EVERY = 0.2
"""Resolution (s) of times when the nearest manoeuvre is looked for"""
_SAMPLES = 61
"""Instants at which trajectories are compared with manoeuvres"""
_DRAWS = 5000
"""Points of the manoeuvres' box, besides its corners, that say how far knots go"""


class Setting(NamedTuple):
    """Description of trajectories.

    Attributes:
        ego_speed: that the ego would keep, m/s.
        aside: of the actor from the middle of the ego's lane at the beginning, m.
    """

    ego_speed: float
    aside: float


class Nearest(NamedTuple):
    """The manoeuvres that come nearest to trajectories.

    Attributes:
        theta: the seven parameters (n, 7); they may lie outside of their box.
        lateral, longitudinal: root mean squares (n,) of what is left, m.
    """

    theta: FloatArray
    lateral: FloatArray
    longitudinal: FloatArray


def knots_of(theta: FloatArray, setting: Setting) -> FloatArray:
    """Knots (n, 1 + 6 + 4) of manoeuvres (n, 7): the scene's time (s), ways ahead (m), ways aside
    (m) but the first and last.

    Those two are the middles of the lanes in every manoeuvre.
    """
    values = np.atleast_2d(theta)
    gap, before = values[:, 0], values[:, 2]
    total = values[:, (2, 4, 6)].sum(axis=1)
    time = total[:, None] * _SHARES - before[:, None]
    moved = np.array(
        [reconstruct(row, -setting.aside, times) for row, times in zip(values, time, strict=True)]
    )
    ahead = gap[:, None] + CAR + moved[:, 0] - setting.ego_speed * time
    return np.column_stack([total, ahead, setting.aside + moved[:, 1, 1:-1]])


def box(space: Space, setting: Setting) -> tuple[FloatArray, FloatArray]:
    """Least and greatest knots (11,) that the manoeuvres of a box of the seven parameters have, to
    the centimetre."""
    corners = np.array(list(product(*zip(space.low, space.high, strict=True))))
    inside = space.draw(_DRAWS, np.random.default_rng(0))
    knots = knots_of(np.concatenate([corners, inside]), setting)
    return knots.min(axis=0).round(2), knots.max(axis=0).round(2)


def maneuvers_of(knots: FloatArray, setting: Setting) -> Nearest:
    """The manoeuvres that come nearest to trajectories (n, 11).

    Least squares across the lane give their times, then along it their speeds and gap.
    """
    found = [_nearest(row, setting) for row in knots]
    theta, left = (np.array(part) for part in zip(*found, strict=True))
    return Nearest(theta, left[:, 0], left[:, 1])


def _nearest(row: FloatArray, setting: Setting) -> tuple[FloatArray, tuple[float, float]]:
    """The seven parameters nearest to one trajectory, and the root mean squares that are left
    across and along the lane."""
    total, ahead, beside = _curves(row, setting.aside, np.linspace(0.0, 1.0, _SAMPLES))
    time, way = (
        np.linspace(0.0, total, _SAMPLES),
        ahead + setting.ego_speed * np.linspace(0.0, total, _SAMPLES),
    )
    start, duration = _times(total)
    model = setting.aside * (
        1.0 - progress(np.clip((time - start[:, None]) / duration[:, None], 0.0, 1.0))
    )
    off = np.square(model - beside).mean(axis=1)
    best = int(off.argmin())
    begins, lasts = float(start[best]), float(duration[best])
    rest = max(total - begins - lasts, 0.0)
    there, speeds = np.interp(begins, time, way), np.gradient(way, time)
    along = distance_model(time - begins, lasts, rest)
    found = fit_speeds(along, way - there, np.interp([begins, begins + lasts, total], time, speeds))
    longitudinal = np.square(along @ found - way + there).mean()
    gap = there - setting.ego_speed * begins - CAR
    theta = np.array([gap, found[0], begins, found[1], lasts, found[2], rest])
    return theta, (float(np.sqrt(off[best])), float(np.sqrt(longitudinal)))


def _times(total: float) -> tuple[FloatArray, FloatArray]:
    """Beginnings and durations (m,) that the parameters allow in a scene of that time, s."""
    before, lasts, after = (PARAMETERS[role] for role in ("start_time", "duration", "rest_time"))
    starts = np.arange(before.low, before.high + 1e-9, _EVERY)
    durations = np.arange(lasts.low, lasts.high + 1e-9, _EVERY)
    start, duration = (each.ravel() for each in np.meshgrid(starts, durations, indexing="ij"))
    rest = total - start - duration
    possible = (rest >= after.low - 1e-9) & (rest <= after.high + _EVERY)
    return start[possible], duration[possible]


def _curves(
    row: FloatArray, aside: float, shares: FloatArray
) -> tuple[float, FloatArray, FloatArray]:
    """The scene's time, and ways ahead and aside at shares of it."""
    along = weights(shares)
    return (
        float(row[0]),
        along @ row[1 : NUMBER + 1],
        along @ np.array([aside, *row[NUMBER + 1 :], 0.0]),
    )


def weights(shares: FloatArray) -> FloatArray:
    """Return the weight of each knot at shares (n,) of the time: (n, knots)."""
    from scipy.interpolate import CubicSpline

    found: FloatArray = CubicSpline(_SHARES, np.eye(NUMBER), bc_type="natural")(shares)
    return found
