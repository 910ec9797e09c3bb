"""MaxVelocityTest: the participant is never too fast."""

from __future__ import annotations

import numpy as np

from runner.criteria.criterion import Drive, Finding

CRITERION = {
    "name": "MaxVelocityTest",
    "unit": "m/s",
    "summary": "it never drives faster than `max_velocity` (m/s)",
    "parameters": {"max_velocity": None},
    "on_roads": False,
}


def evaluate(drive: Drive, max_velocity: float) -> Finding:
    """Find the greatest speed, forwards or backwards."""
    speed = np.abs(drive.columns["speed"])
    fastest = float(speed.max())
    over = np.flatnonzero(speed > max_velocity)
    if len(over):
        since = drive.columns["time"][over[0]]
        return Finding(False, fastest, f"drove up to {fastest:.2f} m/s, from {since:.2f} s on more than {max_velocity:g} m/s")
    return Finding(True, fastest, f"drove {fastest:.2f} m/s at most, {max_velocity:g} m/s are allowed")
