"""Whether seven parameters would have done: what an adversary did within an episode, as the
manoeuvre that is nearest to it."""

from __future__ import annotations

import numpy as np

from generation.space.density.roles import EGO_SPEED, roles_of
from generation.space.space import Space
from schemas.common.array_types import FloatArray
from studies.generation.adversary.course import START, Scene
from studies.generation.adversary.environment import Episodes

_DURATIONS = np.arange(1.0, 8.01, 0.25)
_STARTS = np.arange(0.0, 7.01, 0.25)
"""Durations of lane changes, and times at which they begin, that are compared with a way, s"""


def as_maneuvers(scene: Scene, space: Space, episodes: Episodes, dt: float) -> FloatArray:
    """The points (n, d) of a space of cut-ins that are nearest to the ways of actors.

    Of half cosines across the lane the nearest one by least squares says when the manoeuvre begins
    and how long it lasts; gap and speeds are those of the way at these times, the ego's speed that
    of the beginning.
    """
    shift = scene.start - scene.lanes[scene.lane]
    cases = zip(episodes.ways, episodes.starts[:, 2].tolist(), strict=True)
    rows = [_described(way, ego_speed, scene.between, abs(shift), dt) for way, ego_speed in cases]
    roles = roles_of(space.names)
    theta = np.array([[row[roles[name].role] for name in space.names] for row in rows]).reshape(
        -1, len(space.names)
    )
    return space.clip(theta)


def _described(
    way: FloatArray, ego_speed: float, between: float, shift: float, dt: float
) -> dict[str, float]:
    """The parameters of one way (k, 2), by role."""
    time, aside = np.arange(len(way), dtype=np.float64) * dt, np.abs(way[:, 1] - way[0, 1])
    speed = np.gradient(way[:, 0], dt)
    pairs = [(start, duration) for start in _STARTS for duration in _DURATIONS]
    shapes = np.array([_half_cosine(time, start, duration) for start, duration in pairs])
    start, duration = pairs[int(np.square(shift * shapes - aside).sum(axis=1).argmin())]
    begins, ends = (min(round(each / dt), len(way) - 1) for each in (start, start + duration))
    return {
        "gap": float(way[begins, 0] - START - ego_speed * start - between),
        "start_speed": float(speed[begins]),
        "start_time": start,
        "end_speed": float(speed[ends]),
        "duration": duration,
        "final_speed": float(speed[-1]),
        "rest_time": float(time[-1] - time[ends]),
        EGO_SPEED: ego_speed,
    }


def _half_cosine(time: FloatArray, start: float, duration: float) -> FloatArray:
    """Return the progress of a lane change (k,), 0 to 1."""
    return 0.5 - 0.5 * np.cos(np.pi * np.clip((time - start) / duration, 0.0, 1.0))
