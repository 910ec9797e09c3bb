"""The three speeds of a manoeuvre, and the way that they stand for.

Before the manoeuvre the start speed is kept; during it the speed goes to the end speed, after it to the final speed, evenly over
time.
"""

from __future__ import annotations

import numpy as np

from xodr.array_types import FloatArray

_WEIGHT = 10.0
"""How many metres of the way one m/s of a speed counts as when speeds are fitted: so much that they stay near those at the
instants that they are named after (0.3 to 0.6 m/s on own motorways), and follow the way all the same, s"""
EVERY = 0.2
"""Resolution (s) of the motion that speeds are fitted to"""


def distance_model(time: FloatArray, duration: float, rest: float) -> FloatArray:
    """What each m/s of start, end and final speed adds to the way since the manoeuvre began (n, 3), s.

    Args:
        time: instants counted from the manoeuvre's beginning (n,), s.
        duration: of the manoeuvre, s. rest: from its end to the scene's, s.
    """
    during = np.clip(time, 0.0, duration)
    after = np.clip(time - duration, 0.0, None)
    gained, settled = during**2 / (2.0 * duration), after**2 / (2.0 * rest) if rest > 0.0 else 0.0 * after
    return np.stack([np.minimum(time, 0.0) + during - gained, gained + after - settled, settled], axis=1)


def fit_speeds(model: FloatArray, way: FloatArray, seen: FloatArray) -> FloatArray:
    """Start, end and final speed (3,), m/s, that follow a way best and stay near the speeds seen at their instants.

    Args:
        model: what each speed adds to the way (n, 3), s (`distance_model`).
        way: since the manoeuvre began (n,), m.
        seen: speeds at its beginning, its end, and the scene's end (3,), m/s.
    """
    target = np.concatenate([way, _WEIGHT * seen])
    found = np.linalg.lstsq(np.vstack([model, _WEIGHT * np.eye(3)]), target)[0]
    return np.maximum(found, 0.0)
