"""ActorBlockedTest: the participant does not stand still for too long."""

from __future__ import annotations

import numpy as np

from runner.criteria.criterion import Drive, Finding
from runner.criteria.intervals import intervals

CRITERION = {
    "name": "ActorBlockedTest",
    "unit": "s",
    "summary": "it is never slower than `min_speed` (m/s) for longer than `max_time` (s)",
    "parameters": {"min_speed": None, "max_time": None},
    "on_roads": False,
}


def evaluate(drive: Drive, min_speed: float, max_time: float) -> Finding:
    """Find the longest time below the speed."""
    time = drive.columns["time"]
    slow = [(float(time[b] - time[a]), float(time[a])) for a, b in intervals(np.abs(drive.columns["speed"]) < min_speed)]
    longest, since = max(slow, default=(0.0, 0.0))
    blocked = longest > max_time
    when = f" from {since:.2f} s on" if slow else ""
    return Finding(
        not blocked, longest, f"was slower than {min_speed:g} m/s for {longest:.2f} s{when}, {max_time:g} s are allowed"
    )
