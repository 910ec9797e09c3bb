"""RunningStopTest: the participant stops at stop signs."""

from __future__ import annotations

import numpy as np

from runner.criteria.criterion import Drive, Finding
from runner.criteria.stop_lines import Crossing, crossings
from xodr.model import Signal

CRITERION = {
    "name": "RunningStopTest",
    "unit": "stop signs",
    "summary": "it stops (slower than 0.1 m/s) within the last 4 m before each stop sign",
    "parameters": {},
    "on_roads": True,
}

_TYPES = {"206", "R1-1"}
"""Types of the stop sign: OpenDRIVE's own and Germany's, and North America's."""
_NEAR, _STANDING = 4.0, 0.1
"""m before the line, and m/s, of a stop."""


def evaluate(drive: Drive) -> Finding:
    """Look for a standstill with the front close to each line, up to the moment in which the reference point passes it."""
    found = crossings(drive, _is_stop_sign)
    ran = [crossing for crossing in found if not _stopped(drive, crossing)]
    if ran:
        return Finding(False, float(len(ran)), f"ran the stop sign {ran[0].signal.id} at {ran[0].time:.2f} s")
    return Finding(True, 0.0, f"stop signs passed: {len(found)}, all after a stop" if found else "came past no stop sign")


def _is_stop_sign(signal: Signal) -> bool:
    return not signal.dynamic and signal.type in _TYPES


def _stopped(drive: Drive, crossing: Crossing) -> bool:
    """Whether it stood shortly before a crossing."""
    before = np.concatenate([[0.0], np.cumsum(drive.steps)])[: crossing.row + 1]
    front = drive.track.box.x + drive.track.box.length / 2
    near = before >= before[-1] - front - _NEAR
    return bool((np.abs(drive.columns["speed"][: crossing.row + 1][near]) < _STANDING).any())
