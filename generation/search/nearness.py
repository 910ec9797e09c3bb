"""How near a run came to a failure: what leads a search on while nothing fails."""

from __future__ import annotations

import numpy as np

from generation.outcomes.outcomes import Outcomes
from xodr.array_types import FloatArray

_FAR, _HARD = 5.0, 8.0
"""Clearance (m) at which its margin counts 1/e, and DRAC (m/s²) at which nothing is left of its own"""
_CLEAR, _BRAKED = 0.1, 0.8
"""What each margin counts: vehicles that pass each other in two lanes are close, and far from a collision"""


def nearness(outcomes: Outcomes) -> FloatArray:
    """By both margins, least clearance and greatest DRAC (n,), 0 to below 1; 0 where no run took place."""
    near = _CLEAR * np.exp(-np.minimum(outcomes.clearance, 1e3) / _FAR) + _BRAKED * np.minimum(outcomes.max_drac / _HARD, 1.0)
    return np.where(outcomes.executed, near, 0.0)
