"""WrongLaneTest: the participant does not drive on lanes of the opposite direction."""

from __future__ import annotations

import math

import numpy as np

from runner.criteria.criterion import Drive, Finding
from runner.criteria.intervals import intervals
from runner.criteria.lane_types import CARRIAGEWAY

CRITERION = {
    "name": "WrongLaneTest",
    "unit": "m",
    "summary": "outside junctions it does not drive on a lane whose traffic comes towards it",
    "parameters": {},
    "on_roads": True,
}

_AGAINST = math.radians(120.0)
"""Angle between heading and the lane's traffic from which it drives against it."""


def evaluate(drive: Drive) -> Finding:
    """Compare the heading with the direction of the lane under the reference point."""
    columns = drive.columns
    wrong = np.array(
        [_against(drive, *row) for row in zip(*(columns[name] for name in ("road_id", "lane_id", "s", "h")), strict=True)]
    )
    if not wrong.any():
        return Finding(True, 0.0, "drove on no lane of the opposite direction")
    distance = float(drive.steps[wrong[1:]].sum())
    first = intervals(wrong)[0][0]
    where = f"lane {columns['lane_id'][first]} of road {columns['road_id'][first]}"
    return Finding(
        False, distance, f"drove {distance:.1f} m against the traffic, first at {columns['time'][first]:.2f} s on {where}"
    )


def _against(drive: Drive, road_id: str, lane_id: int, s: float, h: float) -> bool:
    """Whether a heading (rad) is against the traffic of a lane outside of junctions."""
    road = drive.network.roads[road_id]
    inside = min(max(s, 0.0), road.length)
    lane = road.section(inside).lanes.get(lane_id)
    if road.junction_id is not None or lane is None or lane.type not in CARRIAGEWAY or lane.direction == "both":
        return False
    way = road.heading(inside) + (0.0 if road.direction(lane_id, inside) > 0 else math.pi)
    return abs(math.remainder(h - way, math.tau)) > _AGAINST
