"""On what kind of lane a place is."""

from __future__ import annotations

import numpy as np

from runner.criteria.criterion import Drive
from xodr.lookup.placing import lanes_under

CARRIAGEWAY = frozenset(
    (
        *("driving", "parking", "entry", "exit", "onRamp", "offRamp", "connectingRamp", "slipLane"),
        *("bidirectional", "shared", "mwyEntry", "mwyExit", "bus", "taxi", "HOV"),
    )
)
"""Lane types of OpenDRIVE on which cars drive or park."""
SIDEWALK = frozenset(("sidewalk", "walking"))


def on_lanes(drive: Drive, place: tuple[np.ndarray, np.ndarray], types: frozenset[str]) -> np.ndarray:
    """Which of a drive's places (x and y, each (n,), m) are on a lane of these types, on whatever road; shape (n,)."""
    found = np.zeros(len(place[0]), bool)
    for lanes in lanes_under(drive.network, *place, drive.columns["z"]):
        here = [
            lanes.road.section(s).lanes[lane].type in types
            for lane, s in zip(lanes.lane_id.tolist(), lanes.s.tolist(), strict=True)
        ]
        found[lanes.rows[here]] = True
    return found
