"""When something holds: stretches of rows and their durations."""

from __future__ import annotations

import numpy as np


def intervals(holds: np.ndarray) -> list[tuple[int, int]]:
    """First and last row of each stretch of true values (n,)."""
    edges = np.diff(np.concatenate([[0], holds.astype(np.int8), [0]]))
    return list(zip(np.flatnonzero(edges == 1).tolist(), (np.flatnonzero(edges == -1) - 1).tolist(), strict=True))


def duration_of(holds: np.ndarray, time: np.ndarray) -> float:
    """Time (s) within the stretches; a single row has none."""
    return float(sum(time[last] - time[first] for first, last in intervals(holds)))
