"""OffRoadTest: the participant stays on lanes for driving or parking."""

from __future__ import annotations

from runner.criteria.criterion import Drive, Finding
from runner.criteria.intervals import duration_of, intervals
from runner.criteria.lane_types import CARRIAGEWAY, on_lanes

CRITERION = {
    "name": "OffRoadTest",
    "unit": "s",
    "summary": "its centre is off all lanes for driving and parking for no longer than `duration` (s), added up",
    "parameters": {"duration": 0.0},
    "on_roads": True,
}


def evaluate(drive: Drive, duration: float) -> Finding:
    """Add up the times off the lanes."""
    off = ~on_lanes(drive, drive.centre(), CARRIAGEWAY)
    total = duration_of(off, drive.columns["time"])
    if not off.any():
        return Finding(True, 0.0, "stayed on lanes for driving and parking")
    since = drive.columns["time"][intervals(off)[0][0]]
    reason = f"was off all lanes for driving and parking for {total:.2f} s, first at {since:.2f} s"
    return Finding(total <= duration, total, f"{reason} ({duration:g} s are allowed)")
