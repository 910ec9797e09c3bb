"""Features of windows of tokens without an encoder: what the map alone tells, and plain numbers of
motion."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recognition.trfe.inputs.tokens import FEATURES

_STATIC = ("lanes_to_left", "lanes_to_right", "lane_behind", "lane_ahead", "limit", "has_limit")


def static(inputs: NDArray[np.float16]) -> NDArray[np.float32]:
    """Return map-only features of the middle of windows (n, participants, frames, features): the
    ego's lane, without traffic."""
    columns = [
        number
        for number, name in enumerate(FEATURES)
        if name in _STATIC or name.startswith("role_")
    ]
    return _middle(inputs)[:, columns]


def kinematic(inputs: NDArray[np.float16]) -> NDArray[np.float32]:
    """Thirteen numbers of the motion in windows (n, participants, frames, features), without the
    map: of the ego's speed, acceleration, yaw rate, lateral speed and way to the side, and of the
    gap to its lead."""
    with np.errstate(all="ignore"):
        ego = np.asarray(inputs[:, 0], np.float32)
        names = ("speed", "acceleration", "yaw_rate", "lateral_speed", "aside")
        found = {name: ego[:, :, FEATURES.index(name)] for name in names}
        gap = ego[:, :, FEATURES.index("gap")]
        numbers = [
            *(np.nanmean(found[name], axis=1) for name in found),
            *(np.nanstd(found[name], axis=1) for name in names[:-1]),
            np.nanmax(found["aside"], axis=1) - np.nanmin(found["aside"], axis=1),
            np.nanmean(gap, axis=1), np.nanmin(gap, axis=1),
            np.nanmax(gap, axis=1) - np.nanmin(gap, axis=1),
        ]  # fmt: skip
    return np.nan_to_num(np.stack(numbers, axis=1))


def _middle(inputs: NDArray[np.float16]) -> NDArray[np.float32]:
    """The ego's features (n, features) in the middle frame, 0 where it is not there."""
    return np.nan_to_num(np.asarray(inputs[:, 0, inputs.shape[2] // 2], np.float32))
