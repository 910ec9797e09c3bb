"""OnSidewalkTest: the participant stays off sidewalks and does not leave the carriageway."""

from __future__ import annotations

import numpy as np

from runner.criteria.criterion import Drive, Finding
from runner.criteria.intervals import duration_of, intervals
from runner.criteria.lane_types import CARRIAGEWAY, SIDEWALK, on_lanes

CRITERION = {
    "name": "OnSidewalkTest",
    "unit": "s",
    "summary": "it is on a sidewalk, or wholly off lanes for driving and parking, for no longer than `duration` (s), added up",
    "parameters": {"duration": 0.0},
    "on_roads": True,
}


def evaluate(drive: Drive, duration: float) -> Finding:
    """Look at the box's centre, and where that is off the carriageway at its corners."""
    time, corners = drive.columns["time"], drive.corners()
    on_carriageway = on_lanes(drive, drive.centre(), CARRIAGEWAY)
    outside = ~on_carriageway & ~np.any([on_lanes(drive, corner, CARRIAGEWAY) for corner in corners], axis=0)
    sidewalk = ~on_carriageway & on_lanes(drive, drive.centre(), SIDEWALK)
    sidewalk |= outside & np.any([on_lanes(drive, corner, SIDEWALK) for corner in corners], axis=0)
    wrong = sidewalk | outside
    if not wrong.any():
        return Finding(True, 0.0, "was on no sidewalk and did not leave the carriageway")
    total, first = duration_of(wrong, time), intervals(wrong)[0][0]
    where = "on a sidewalk" if sidewalk[first] else "off the carriageway"
    reason = f"was on sidewalks or off the carriageway for {total:.2f} s, first {where} at {time[first]:.2f} s"
    return Finding(total <= duration, total, f"{reason} ({duration:g} s are allowed)")
