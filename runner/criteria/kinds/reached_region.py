"""ReachedRegionTest: the participant comes into a rectangle."""

from __future__ import annotations

import numpy as np

from runner.criteria.criterion import Drive, Finding

CRITERION = {
    "name": "ReachedRegionTest",
    "unit": "m",
    "summary": "it comes into the rectangle from (`min_x`, `min_y`) to (`max_x`, `max_y`) of the road network (m)",
    "parameters": {"min_x": None, "max_x": None, "min_y": None, "max_y": None},
    "on_roads": False,
}


def evaluate(drive: Drive, min_x: float, max_x: float, min_y: float, max_y: float) -> Finding:
    """Find the least distance of the box's centre from the rectangle, and when it is inside."""
    x, y = drive.centre()
    inside = np.flatnonzero((min_x < x) & (x < max_x) & (min_y < y) & (y < max_y))
    if len(inside):
        return Finding(True, 0.0, f"reached the region at {drive.columns['time'][inside[0]]:.2f} s")
    away = np.hypot(np.maximum(np.maximum(min_x - x, x - max_x), 0.0), np.maximum(np.maximum(min_y - y, y - max_y), 0.0))
    nearest = float(away.min())
    return Finding(False, nearest, f"did not reach the region; the nearest that it came was {nearest:.1f} m")
