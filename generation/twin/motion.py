"""Motion of participants on a straight road in many cases at once: steps of `runner.interpreter` in arrays.

All face increasing s; y is t, positive to the left. Arrays have one entry for each case.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from generation.twin.script import Actor
from runner.actions.speed import STRETCH, STRETCHES
from runner.measures.relations import MotionRows, View, interval_gaps
from runner.motion.dynamics import EPSILON, RESERVE
from runner.participants.declaration import Performance
from schemas.common.array_types import BoolArray, FloatArray

_RETURN, _GRAVITY = 3.5, 9.81
"""As in `runner.interpreter.drivers`, m/s²"""
_SAME = 1e-9


@dataclass
class Body:
    """A participant in all cases.

    Attributes:
        x, y: reference point, m. h: heading, rad. speed, acceleration: along it. drift: speed to the left, m/s.
        target: speed that the scenario asks for at the end of the step, m/s.
    """

    actor: Actor
    x: FloatArray
    y: FloatArray
    h: FloatArray
    speed: FloatArray
    acceleration: FloatArray
    target: FloatArray
    drift: FloatArray
    straight: bool = True
    """Whether everyone's heading is 0"""

    def take(self, rows: BoolArray) -> None:
        """Keep some cases only."""
        for name in ("x", "y", "h", "speed", "acceleration", "target", "drift"):
            setattr(self, name, getattr(self, name)[rows])

    def motion(self) -> MotionRows:
        """As the measures see it: a row for each case."""
        zero, one, road = _blank(len(self.x))
        found = MotionRows(self.actor.name, self.actor.box, zero, self.x, self.y, zero, self.h, self.speed, road, self.x, self.y)
        if self.straight:
            found.__dict__["facing"] = one, zero  # need not be worked out
        return found

    def view(self, other: Body) -> View:
        """Return the view of another vehicle along and across the road, as `runner.measures.relations` does on one road."""
        a, b = self.actor.box, other.actor.box
        x, y, there_x, there_y = self.x + a.x, self.y + a.y, other.x + b.x, other.y + b.y
        return View(
            interval_gaps(x - a.length / 2, x + a.length / 2, there_x - b.length / 2, there_x + b.length / 2),
            interval_gaps(y - a.width / 2, y + a.width / 2, there_y - b.width / 2, there_y + b.width / 2),
            self.speed, self.drift, other.speed, other.drift,
        )  # fmt: skip

    def move(self, speed: FloatArray, aside: FloatArray, dt: float) -> None:
        """Move along the lane at a speed (n,) over a slanting way that leads `aside` (n,) metres to the left."""
        way = speed * dt
        if aside.any():
            rest = way * way - aside * aside
            slanted = (aside != 0.0) & (way != 0.0)
            turn = np.arcsin(within(np.divide(aside, way, out=np.zeros_like(way), where=slanted), -1.0, 1.0))
            self.x = self.x + np.sqrt(np.maximum(rest, 0.0))
            self.y = self.y + aside
            self.h, self.straight = np.where(slanted, turn, 0.0), False
        else:
            self.x = self.x + np.sqrt(np.maximum(way * way, 0.0))
            self.h, self.straight = np.zeros_like(way), True
        self.drift = aside / dt
        self.acceleration = (speed - self.speed) / dt
        self.speed = speed


def driven(ego: Body, intervenes: BoolArray, wanted: FloatArray, returning: BoolArray, dt: float) -> tuple[FloatArray, BoolArray]:
    """Speed of an ego at the end of a step, as `runner.interpreter.drivers.SystemDriver` has it, and where it goes on returning.

    Args:
        intervenes: where its system does (n,). wanted: accelerations that the system wants there (n,), m/s².
        returning: where the ego is on its way back to the scripted speed after an intervention (n,).
    """
    limits = ego.actor.performance
    bounded = within(wanted, -min(limits.max_deceleration, _GRAVITY), min(limits.max_acceleration, _GRAVITY))
    braked = within(ego.speed + bounded * dt, 0.0, np.maximum(limits.max_speed, ego.speed))
    change = ego.target - ego.speed
    most = dt * np.where(change * ego.speed >= 0.0, min(_RETURN, limits.max_acceleration), limits.max_deceleration)
    back = ego.speed + within(change, -most, most)
    speed = np.where(intervenes, braked, np.where(returning, back, ego.target))
    return speed, intervenes | (returning & (np.abs(back - ego.target) >= _SAME))


def within(values: FloatArray, low: FloatArray | float, high: FloatArray | float) -> FloatArray:
    """Values no less than `low` and no more than `high`; np.clip takes twice the time for few."""
    found: FloatArray = np.minimum(np.maximum(values, low), high)
    return found


@lru_cache(maxsize=8)
def _blank(n: int) -> tuple[FloatArray, FloatArray, NDArray[np.object_]]:
    """Zeros and ones (n,), and no road for any of n cases."""
    return np.zeros(n), np.ones(n), np.full(n, None, object)


class Keeping:
    """A gap that an actor keeps behind another one, in all cases: `runner.motion.dynamics.GapController` in arrays.

    Args:
        gap: of the boxes (n,), m.
        limits: of acceleration, braking and jerk, all finite.
    """

    def __init__(self, gap: FloatArray, limits: Performance) -> None:
        self._gap, self._limits, self._acceleration = gap, limits, np.zeros(len(gap))
        self._jerk = min(limits.max_acceleration_rate, limits.max_deceleration_rate)

    def take(self, rows: BoolArray) -> None:
        """Keep some cases only."""
        self._gap, self._acceleration = self._gap[rows], self._acceleration[rows]

    def step(self, body: Body, leader: Body, dt: float) -> None:
        """Ask for the speed at the end of the step."""
        box, other, limits = body.actor.box, leader.actor.box, self._limits
        boxes = box.x + box.length / 2 - (other.x - other.length / 2)
        error = leader.x - body.x - (self._gap + boxes)
        drive = np.where(error > 0.0, limits.max_acceleration, limits.max_deceleration)
        brake = np.where(error > 0.0, limits.max_deceleration, limits.max_acceleration)
        root = np.minimum(np.sqrt(0.4 * brake), self._jerk / np.maximum(drive, brake))
        wanted = 2.0 * root * (_safe_closing(error, RESERVE * brake, root / 2.0) - (body.speed - leader.speed))
        wanted = within(wanted, -limits.max_deceleration, limits.max_acceleration)
        wanted = np.maximum(wanted, self._acceleration - limits.max_deceleration_rate * dt)
        self._acceleration = np.minimum(wanted, self._acceleration + limits.max_acceleration_rate * dt)
        body.target = within(body.speed + self._acceleration * dt, 0.0, limits.max_speed)


def _safe_closing(gap: FloatArray, brake: FloatArray, slope: FloatArray) -> FloatArray:
    far, knee = np.abs(gap), brake / slope
    beyond = np.sqrt(np.maximum(2.0 * brake * far - knee * knee, 0.0))
    found: FloatArray = np.where(slope * slope * far <= brake, slope * gap, np.copysign(beyond, gap))
    return found


@dataclass
class Changing:
    """An actor's change of speed and lane, and the settling after it, in all cases.

    Args:
        n: cases.
        shift: way to the left of the lane change, m.
        duration, speed, rest, final: of the change and of the settling (n,), s and m/s.
    """

    n: int
    shift: float
    duration: FloatArray
    speed: FloatArray
    rest: FloatArray
    final: FloatArray
    begun: BoolArray = field(init=False)
    done: FloatArray = field(init=False)
    """When conditions see that the change is complete (n,), s; infinite before"""

    def __post_init__(self) -> None:
        n = self.n
        self.begun, self.done = np.zeros(n, bool), np.full(n, np.inf)
        self._past, self._settling = np.zeros(n), np.full(n, np.nan)
        self._from, self._to = np.zeros(n), np.zeros(n)
        self._accelerating, self._crossing = np.zeros(n, bool), np.zeros(n, bool)
        self._offset = np.zeros(n)

    def take(self, rows: BoolArray) -> None:
        """Keep some cases only."""
        for name, values in vars(self).items():
            if isinstance(values, np.ndarray):
                setattr(self, name, values[rows])

    def begin(self, fires: BoolArray, body: Body, following: float) -> None:
        """Begin where the trigger fires; a change that takes no time is complete, which conditions see one step later."""
        fires = fires & ~self.begun
        if not fires.any():
            return
        self.begun = self.begun | fires
        self._from = np.where(fires, body.speed, self._from)
        self._to = np.where(fires, self.speed, self._to)
        self._accelerating |= fires & (self.speed != body.speed) & (self.duration > 0.0)
        body.target = np.where(fires & ~self._accelerating, self.speed, body.target)
        if self.shift:
            self._crossing |= fires
        self.done = np.where(fires & ~self._accelerating & ~self._crossing, following, self.done)

    def step(self, body: Body, time: float, dt: float) -> FloatArray:
        """Ask for the speed at the end of the step that ends at a time (s); the way to the left (n,) that is driven in it, m."""
        self._past = np.where(self.begun, self._past + dt, 0.0)
        extent = np.where(np.isnan(self._settling), self.duration, self.rest)
        past = np.where(np.isnan(self._settling), self._past, self._settling + dt)
        self._settling = np.where(np.isnan(self._settling), np.nan, self._settling + dt)
        wanted, over = self._wanted(past, extent)
        body.target = np.where(self._accelerating, wanted, body.target)
        self._accelerating = self._accelerating & ~over
        aside = self._sidestep(body, dt) if self.shift else np.zeros_like(past)
        complete = self.begun & np.isinf(self.done) & ~self._accelerating & ~self._crossing
        self.done = np.where(complete, time, self.done)
        return aside

    def _wanted(self, past: FloatArray, extent: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Speed (n,), m/s, after a time of a change or settling that takes another (n,), s, and where that is over (n,)."""
        progress = np.divide(past, extent, out=np.ones_like(past), where=extent > 0.0)
        over = progress >= 1.0 - EPSILON
        return np.where(over, self._to, self._from + (self._to - self._from) * progress), over

    def settle(self, time: float, body: Body) -> None:
        """Begin to settle where the change is complete."""
        starts = (self.done <= time + 1e-9) & np.isnan(self._settling)
        if not starts.any():
            return
        self._settling = np.where(starts, 0.0, self._settling)
        self._from = np.where(starts, body.speed, self._from)
        self._to = np.where(starts, self.final, self._to)
        lasting = (self.final != body.speed) & (self.rest > 0.0)
        self._accelerating = np.where(starts, lasting, self._accelerating)
        body.target = np.where(starts & ~lasting, self.final, body.target)

    def _sidestep(self, body: Body, dt: float) -> FloatArray:
        """Way to the left in this step, no longer than the way driven; the lane is reached when all of it is done."""
        progress = np.divide(self._past, self.duration, out=np.ones_like(self._past), where=self.duration > 0.0)
        over = progress >= 1.0 - EPSILON
        goal = np.where(over, self.shift, self.shift * 0.5 * (1.0 - np.cos(np.pi * np.minimum(progress, 1.0))))
        reach = np.abs(body.speed) * dt
        offset = within(goal, self._offset - reach, self._offset + reach)
        aside = np.where(self._crossing, offset - self._offset, 0.0)
        self._offset = self._offset + aside
        self._crossing = self._crossing & ~(over & (offset == self.shift))
        return aside


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
    into, after = within(past, 0.0, entering), within(past - entering - held, 0.0, leaving)
    between = within(past - entering, 0.0, held)
    risen = np.divide(into * into, 2.0 * entering, out=np.zeros_like(into), where=entering > 0.0)
    fallen = after - np.divide(after * after, 2.0 * leaving, out=np.zeros_like(after), where=leaving > 0.0)
    return start + slope * (risen + between + fallen), past + EPSILON >= entering + held + leaving
