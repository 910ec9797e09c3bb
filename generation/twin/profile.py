"""Changes of speed with a limited jerk, in many cases at once: `runner.actions.speed_profile` of one entry in arrays."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from generation.twin.motion import Body, Changing
from runner.actions.speed_profile import STRETCH, STRETCHES
from runner.motion.dynamics import EPSILON
from runner.participants.declaration import Performance
from xodr.array_types import BoolArray, FloatArray


@dataclass
class JerkChanging(Changing):
    """An actor's change of speed with a limited jerk, and the settling after it; without a change of lane.

    Args:
        jerk: of the change (n,), m/s³.
    """

    jerk: FloatArray = field(kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        self._profile = np.zeros((self.n, len(_COLUMNS)))

    def begin(self, fires: BoolArray, body: Body, following: float) -> None:
        """Begin where the trigger fires; every change takes time, even one to the same speed."""
        fires = fires & ~self.begun
        if not fires.any():
            return
        super().begin(fires, body, following)
        self._accelerating |= fires
        self.done = np.where(fires, np.inf, self.done)
        planned = plan(body.speed, self.speed, self.duration, self.jerk, body.actor.performance)
        self._profile = np.where(fires[:, None], planned, self._profile)

    def _wanted(self, past: FloatArray, extent: FloatArray) -> tuple[FloatArray, BoolArray]:
        wanted, over = super()._wanted(past, extent)
        changing = np.isnan(self._settling)
        speed, ended = speeds(self._profile, past)
        return np.where(changing, speed, wanted), np.where(changing, ended, over)


_COLUMNS = ("start", "slope", "entering", "leaving", "duration")


def plan(start: FloatArray, target: FloatArray, duration: FloatArray, jerk: FloatArray, limits: Performance) -> FloatArray:
    """The profiles (n, 5) from speeds to speeds (n,), m/s, with the columns of `_COLUMNS`.

    These are: speed at the start, m/s; slope between the corners, m/s²; times that the first and the last corner take,
    and from the middle of one to that of the other, s.

    Args:
        duration: wanted (n,), s. jerk: greatest (n,), m/s³. limits: of the vehicle.
    """
    change = np.minimum(target, limits.max_speed) - start
    gains = change > 0.0
    lasts = np.maximum(duration, np.abs(change) / np.where(gains, limits.max_acceleration, limits.max_deceleration))
    up, down = np.minimum(jerk, limits.max_acceleration_rate), np.minimum(jerk, limits.max_deceleration_rate)
    entering, leaving = np.where(gains, up, down), np.where(gains, down, up)
    both = 0.5 * (1.0 / entering + 1.0 / leaving)
    for _ in range(STRETCHES):
        tight = lasts + EPSILON < np.abs(change) / lasts * both
        if not tight.any():
            break
        lasts = np.where(tight, lasts * STRETCH, lasts)
    slope = change / lasts
    return np.stack([start, slope, np.abs(slope) / entering, np.abs(slope) / leaving, lasts], axis=1)


def speeds(profile: FloatArray, past: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Speeds (n,), m/s, at times since the profiles (n, 5) began (n,), s, and where these have ended (n,)."""
    start, slope, entering, leaving, lasts = profile.T
    held = lasts - 0.5 * (entering - leaving) - leaving  # from the end of the first corner to the beginning of the last
    into, after = np.clip(past, 0.0, entering), np.clip(past - entering - held, 0.0, leaving)
    between = np.clip(past - entering, 0.0, held)
    risen = np.divide(into * into, 2.0 * entering, out=np.zeros_like(into), where=entering > 0.0)
    fallen = after - np.divide(after * after, 2.0 * leaving, out=np.zeros_like(after), where=leaving > 0.0)
    return start + slope * (risen + between + fallen), past + EPSILON >= entering + held + leaving
