"""Facts about a vehicle from bare positions, without lanes or maps."""

from __future__ import annotations

import numpy as np

from schemas.common.array_types import FloatArray, IntArray

LEAST_WAY = 10.0
"""Distance (m) below which a vehicle does not move."""
_END = 3.0
"""Length of way at each end from which its direction is taken, m."""


def net_turn(x: FloatArray, y: FloatArray) -> float | None:
    """Change of direction over a way, rad, positive to the left, up to half a turn; None for who
    hardly moves."""
    if np.hypot(x[-1] - x[0], y[-1] - y[0]) < LEAST_WAY:
        return None
    start = int(np.argmax(np.hypot(x - x[0], y - y[0]) >= _END))
    end = len(x) - 1 - int(np.argmax(np.hypot(x - x[-1], y - y[-1])[::-1] >= _END))
    first = np.arctan2(y[start] - y[0], x[start] - x[0])
    last = np.arctan2(y[-1] - y[end], x[-1] - x[end])
    return float(np.remainder(last - first + np.pi, 2.0 * np.pi) - np.pi)


def own_lane_changes(lane: IntArray) -> int:
    """Return the number of changes of the data set's lane id."""
    return int(np.count_nonzero(np.diff(lane)))
