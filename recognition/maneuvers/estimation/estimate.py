"""The values of a unit's parameters: the one estimator of densities and catalogues."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from recognition.maneuvers.estimation.jerk import onset_jerk
from recognition.maneuvers.estimation.motion import LaneMotion
from recognition.maneuvers.estimation.speeds import EVERY, distance_model, fit_speeds
from recognition.maneuvers.parameters import Values
from recognition.maneuvers.unit import LANE_CHANGE, Unit
from xodr.array_types import FloatArray


class Estimate(NamedTuple):
    """What was estimated of a unit.

    Attributes:
        values: of its parameters.
        other_speed: of the one who is not the actor, when the manoeuvre begins, m/s; 0 without another.
        jerk: how suddenly the acceleration of the manoeuvre builds up, m/s³; NaN where that can't be said.
    """

    values: Values
    other_speed: float
    jerk: float


def estimate(motion: LaneMotion, unit: Unit) -> Estimate | None:
    """The values of a unit's parameters.

    The gap is that when the manoeuvre begins. The speeds are those with which the reconstruction comes closest to the recorded
    distance and to the speeds recorded at the manoeuvre's beginning and end and at the scene's end.

    Returns:
        None where the two are not one ahead of the other, or the other was not recorded when the manoeuvre begins.
    """
    scene, gap, other_speed = motion.scene, None, 0.0
    if not unit.alone:
        other = motion.row(unit.other, int(scene.frame[unit.start]))
        if other is None:
            return None
        gap = motion.gap(unit.start, other) if unit.kind == LANE_CHANGE else motion.gap(other, unit.start)
        if gap <= 0.0:
            return None
        other_speed = float(scene.speed[other])
    start_time, duration, rest_time = np.diff(scene.time[[unit.first, unit.start, unit.end, unit.last]]).tolist()
    start, end, final = _speeds(motion, unit, duration, rest_time).tolist()
    jerk = onset_jerk(motion, unit, end - start)
    return Estimate(Values(gap, start, start_time, end, duration, final, rest_time), other_speed, jerk)


def _speeds(motion: LaneMotion, unit: Unit, duration: float, rest_time: float) -> FloatArray:
    """Start, end and final speed (3,), m/s."""
    scene = motion.scene
    rows = np.arange(unit.first, unit.last + 1, scene.rows(EVERY))
    distance = motion.longitudinal[rows] - motion.longitudinal[unit.start]
    model = distance_model(scene.time[rows] - scene.time[unit.start], duration, rest_time)
    return fit_speeds(model, distance, scene.speed[[unit.start, unit.end, unit.last]])
