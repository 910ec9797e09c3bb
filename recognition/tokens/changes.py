"""What happens in a window of tokens: plain numbers of how the ego's motion, gap and road change, without an encoder."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recognition.tokens.config import FEATURES

_CHANGING = (
    "speed", "acceleration", "yaw_rate", "lateral_speed", "along", "aside", "ahead", "left", "cos", "sin", "offset", "gap",
    "headway", "has_lead", "border_left", "border_right",
)  # fmt: skip
_ROLES = tuple(name for name in FEATURES if name.startswith("role_"))
CHANGES = 2 * len(_CHANGING) + 2 * len(_ROLES)
"""Numbers of a window"""


def changes(inputs: NDArray[np.float16]) -> NDArray[np.float32]:
    """How the ego's motion, gap and lane change in windows, and which roles its lanes have.

    How a scenario ends otherwise than it began tells what happens in it. Levels, such as of speed or the number of lanes, tell
    where it is, and are left out, but for the roles.

    Args:
        inputs: windows (n, participants, frames, features).

    Returns:
        (n, CHANGES): changes from the first third to the last, and deviations in the window, of motion, gap and distances to the
        borders; then changes and means of the roles. A change is 0 where the ego isn't there in the first or the last third.
    """
    moving, roles = _ego(inputs, _CHANGING), _ego(inputs, _ROLES)
    return np.concatenate([_change(moving), _deviation(moving), _change(roles), np.nan_to_num(_mean(roles))], axis=1)


def _ego(inputs: NDArray[np.float16], names: tuple[str, ...]) -> NDArray[np.float32]:
    """Features (n, frames, names) of the ego; NaN where it isn't there."""
    return np.asarray(inputs[:, 0][:, :, [FEATURES.index(name) for name in names]], np.float32)


def _change(values: NDArray[np.float32]) -> NDArray[np.float32]:
    third = values.shape[1] // 3
    return np.nan_to_num(_mean(values[:, -third:]) - _mean(values[:, :third]))


def _deviation(values: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.sqrt(np.nan_to_num(_mean(np.square(values - _mean(values)[:, None]))))


def _mean(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Mean (n, names) over the frames that are there; NaN where none is."""
    there = np.isfinite(values)
    total, count = np.where(there, values, 0.0).sum(axis=1), there.sum(axis=1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan).astype(np.float32)
