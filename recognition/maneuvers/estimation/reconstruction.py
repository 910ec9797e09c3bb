"""The motion that the seven parameters stand for, and how far it is from the recorded one.

Before the manoeuvre the start speed is kept; during it the speed goes to the end speed, after it to the final speed, evenly over
time; a lane change goes along half a cosine from where it begins to the centre of the lane that it leads to. That is
what the logical scenarios script (`generation.logical`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from recognition.maneuvers.estimation.motion import LaneMotion
from recognition.maneuvers.estimation.speeds import distance_model
from recognition.maneuvers.parameters import PARAMETERS
from recognition.maneuvers.unit import Unit
from xodr.array_types import FloatArray

ROLES = tuple(PARAMETERS)
RATE = 1.0
"""Samples a second by which motions are compared."""


class Errors(NamedTuple):
    """Root mean squares over one unit's scene, m: across the lane (RMSE_t) and along it (RMSE_s)."""

    lateral: float
    longitudinal: float


def reconstruct(row: FloatArray, shift: float, time: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Way along the lane and to the left since the manoeuvre began.

    Args:
        row: the seven parameters (7,).
        shift: lateral way of the whole lane change, m, positive to the left; 0 for none.
        time: instants counted from the manoeuvre's beginning (n,), s.
    """
    values = dict(zip(ROLES, row.tolist(), strict=True))
    speeds = np.array([values["start_speed"], values["end_speed"], values["final_speed"]])
    share = np.clip(time / values["duration"], 0.0, 1.0)
    return distance_model(time, values["duration"], values["rest_time"]) @ speeds, shift * progress(share)


def progress(share: FloatArray) -> FloatArray:
    """Share of the lateral way by share of the time (DynamicsShape sinusoidal)."""
    return 0.5 - 0.5 * np.cos(np.pi * share)


def errors(motion: LaneMotion, unit: Unit, row: FloatArray) -> Errors:
    """How far the reconstruction is from the recording, at 1 Hz through the scene, both at one place when the manoeuvre begins.

    Source: METHOD.md §3, RMSE_t and RMSE_s, which are means of these over all units.
    """
    every = motion.scene.rows(1.0 / RATE)
    before = np.arange(unit.start, unit.first - 1, -every)[::-1]
    rows = np.concatenate([before, np.arange(unit.start + every, unit.last + 1, every)])
    time = motion.scene.time[rows] - motion.scene.time[unit.start]
    along, across = reconstruct(row, unit.shift, time)
    compared = (motion.lateral, across), (motion.longitudinal, along)
    return Errors(*(float(np.sqrt(np.mean((was[rows] - was[unit.start] - made) ** 2))) for was, made in compared))
