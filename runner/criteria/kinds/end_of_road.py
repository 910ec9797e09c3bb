"""EndofRoadTest: the participant stays on the road that it started on."""

from __future__ import annotations

import numpy as np

from runner.criteria.criterion import Drive, Finding

CRITERION = {
    "name": "EndofRoadTest",
    "unit": "s",
    "summary": "it does not come to another road and drive on for longer than `duration` (s)",
    "parameters": {"duration": 0.0},
    "on_roads": True,
}


def evaluate(drive: Drive, duration: float) -> Finding:
    """Find when it first was on another road than at the beginning."""
    roads, time = drive.columns["road_id"], drive.columns["time"]
    left = np.flatnonzero(roads != roads[0])
    if not len(left):
        return Finding(True, 0.0, f"stayed on road {roads[0]}")
    when, after = float(time[left[0]]), float(time[-1] - time[left[0]])
    reason = f"left road {roads[0]} for road {roads[left[0]]} at {when:.2f} s, {after:.2f} s before the end"
    return Finding(after <= duration, after, f"{reason} ({duration:g} s are allowed)")
