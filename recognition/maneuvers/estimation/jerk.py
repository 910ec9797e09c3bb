"""How suddenly the acceleration of a manoeuvre builds up."""

from __future__ import annotations

import numpy as np

from recognition.maneuvers.estimation.motion import LaneMotion
from recognition.maneuvers.unit import Unit

WIDE = 0.5
"""Half the time (s) over which jerk is a difference of speeds: what is recorded is not smooth enough for less"""
_LEAD_IN = 1.0
"""Time (s) before a unit in which its acceleration may begin: units begin where it is already there"""


def onset_jerk(motion: LaneMotion, unit: Unit, change: float) -> float:
    """Greatest jerk (m/s³) towards the greatest acceleration of a unit, from a second before it on.

    It is the second difference of the speed over twice `WIDE`: the mean of the jerk in that time, by a triangular window. NaN
    where the speed does not change, or its acceleration does not build up in what was recorded.

    Args:
        change: of the speed in the unit, m/s; its sign says which way counts.
    """
    scene, half = motion.scene, motion.scene.rows(WIDE)
    begin = max(unit.start - scene.rows(_LEAD_IN), int(motion.first[unit.start]))
    peak = begin + int(np.argmax(np.sign(change) * scene.acceleration[begin : unit.end + 1]))
    first, last = max(begin - half, int(motion.first[unit.start])), min(peak + half, int(motion.last[unit.start]))
    speed = scene.speed[first : last + 1]
    if change == 0.0 or len(speed) <= 2 * half:
        return np.nan
    jerk = np.sign(change) * (speed[2 * half :] - 2.0 * speed[half:-half] + speed[: -2 * half]) / (half * scene.step) ** 2
    greatest = float(jerk.max())
    return greatest if greatest > 0.0 else np.nan
