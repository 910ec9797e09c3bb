"""Changes of values over time: transition shapes, limits, and the controller that closes a gap
within limits.

A shape runs from 0 to 1 over a normalised parameter p in [0, 1] (OpenSCENARIO XML 1.3, class
DynamicsShape). Its steepest slope relates a `rate` to a duration, duration = slope · |change| /
rate, and its greatest second derivative relates an acceleration to one, duration = sqrt(bend ·
|change| / acceleration).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from runner.engine.participants.declaration import Performance

if TYPE_CHECKING:
    from schemas.common.array_types import BoolArray, FloatArray
    from xosc.document.node import Node

EPSILON = 1e-9
"""Share of a transition below which rounding is at work, and the transition is complete."""

DIMENSIONS = ("time", "rate", "distance")
FOLLOWING_MODES = ("position", "follow")

RESERVE = 0.8
"""Share of the braking limit that the gap controller plans with; the rest makes up for its lag."""
_SAMPLES = 1000
"""Intervals for the mean of a speed that changes its sign."""
_GENTLE = 0.5
"""Lateral acceleration of the way back into a lane, m/s²: that of a lane offset that names none"""
_BRISK = 2.0
"""Greatest lateral acceleration (m/s²) of that way where a route leaves little room"""
_SLANT = 6.0
"""Least length of that way, in widths that it goes aside"""
_SHORTEST = 1e-3
"""Least length (m) of that way"""


def _linear(p: float) -> float:
    return p


def _cubic(p: float) -> float:
    # No slope at both ends; steepest, 1.5, in the middle (DynamicsShape `cubic`).
    return p * p * (3.0 - 2.0 * p)


def _sinusoidal(p: float) -> float:
    return 0.5 * (1.0 - math.cos(math.pi * p))


def _step(p: float) -> float:
    return 1.0


class TransitionShape(NamedTuple):
    """A transition shape: its value over p, its greatest slope and its greatest second derivative.

    A linear transition has no finite acceleration at its ends; it is given as long as a cubic one.
    """

    value: Callable[[float], float]
    slope: float
    bend: float

    def values(self, p: FloatArray) -> FloatArray:
        """The values over p in many runs (n,)."""
        return _VALUES[self.value](p)


SHAPES: dict[str, TransitionShape] = {
    # The second derivative of the cubic stands in for that of the line, which is infinite at its
    # ends.
    "linear": TransitionShape(_linear, 1.0, 6.0),
    "cubic": TransitionShape(_cubic, 1.5, 6.0),
    "sinusoidal": TransitionShape(_sinusoidal, math.pi / 2, math.pi**2 / 2),
    "step": TransitionShape(_step, 0.0, 0.0),
}


_VALUES: dict[Callable[[float], float], Callable[[FloatArray], FloatArray]] = {
    _linear: lambda p: p,
    _cubic: lambda p: p * p * (3.0 - 2.0 * p),
    _sinusoidal: lambda p: 0.5 * (1.0 - np.cos(math.pi * p)),
    _step: np.ones_like,
}


class TransitionDynamics(NamedTuple):
    """TransitionDynamics: shape, what its value means, and whether the entity's Performance bounds
    it.

    `value` is a time (s), a rate (unit of the changing value per second) or a distance (m), not
    negative. `strict` is followingMode `position`: the transition takes the time that it says
    whatever the Performance. From version 1.2 on this is the default; earlier versions have no
    followingMode, and a vehicle stays what it is.
    """

    shape: TransitionShape
    dimension: str
    value: float
    strict: bool

    @classmethod
    def from_xml(cls, node: Node, version: tuple[int, int]) -> TransitionDynamics:
        """Read a SpeedActionDynamics or LaneChangeActionDynamics element.

        A rate's sign says nothing (the target does) and is dropped: files write decelerations as
        negative rates.
        """
        dimension = node.choice("dynamicsDimension", DIMENSIONS)
        value = node.float("value")
        # Before the sign is checked: other values must not be negative.
        if dimension == "rate":
            value = abs(value)
        if value < 0.0:
            raise node.invalid(f"value={value:g} must not be negative")
        shape = SHAPES[node.choice("dynamicsShape", SHAPES)]
        mode = node.choice(
            "followingMode", FOLLOWING_MODES, "position" if version >= (1, 2) else "follow"
        )
        return cls(shape, dimension, value, mode == "position")

    def extent(self, change: float) -> float:
        """Return the extent of a transition by `change`: s, or m for the dimension distance; 0 at
        once, infinite never."""
        if self.shape.slope == 0.0 or change == 0.0:
            return 0.0
        if self.dimension == "rate":
            # The rate is the greatest one of the transition: a curved shape is steeper in its
            # middle and so takes longer than a line.
            return self.shape.slope * abs(change) / self.value if self.value > 0.0 else math.inf
        return self.value

    def extent_arrays(self, change: FloatArray, value: Any) -> FloatArray:
        """`extent` in many runs (n,), in which the value is a number or an array (n,)."""
        value = value * np.ones_like(change)
        if self.shape.slope == 0.0:
            return np.zeros_like(change)
        if self.dimension == "rate":
            way = self.shape.slope * np.abs(change)
            value = np.divide(way, value, out=np.full_like(change, np.inf), where=value > 0.0)
        return np.where(change == 0.0, 0.0, value)

    def speed_duration_arrays(
        self, start: FloatArray, target: FloatArray, performance: Performance, value: Any
    ) -> FloatArray:
        """`speed_duration` in many runs (n,); NaN for a change over a distance from forward to
        backward motion."""
        duration = self.extent_arrays(target - start, value)
        if self.dimension == "distance":
            mean = np.where(start * target >= 0.0, np.abs(start + target) / 2.0, np.nan)
            duration = np.divide(duration, mean, out=duration.copy(), where=duration > 0.0)
        if self.strict:
            return duration
        # Away from standstill, in either direction, counts as acceleration.
        faster = np.abs(target) > np.abs(start)
        limit = np.where(faster, performance.max_acceleration, performance.max_deceleration)
        way = self.shape.slope * np.abs(target - start)
        least = np.divide(way, limit, out=np.full_like(way, np.inf), where=limit > 0.0)
        return np.where(duration == 0.0, 0.0, np.maximum(duration, least))

    def speed_duration(self, start: float, target: float, performance: Performance) -> float:
        """Seconds that a change of speed from `start` to `target` (m/s) takes.

        A change over a distance is run over the time in which the entity covers that distance, so
        that it also leaves standstill; backward and forward motion both count. Where the
        Performance bounds the transition, it takes as long as keeps the steepest slope within the
        greatest acceleration or deceleration.
        """
        duration = self.extent(target - start)
        # Over the mean speed, which is right whatever the shape if the speed does not change its
        # sign.
        if self.dimension == "distance" and duration > 0.0:
            duration /= self._mean_speed(start, target)
        if self.strict or duration == 0.0:
            return duration
        limit = (
            performance.max_acceleration
            if abs(target) > abs(start)
            else performance.max_deceleration
        )
        return (
            max(duration, self.shape.slope * abs(target - start) / limit)
            if limit > 0.0
            else math.inf
        )

    def _mean_speed(self, start: float, target: float) -> float:
        # Else the mean of |v| has no closed form for curved shapes.
        if start * target >= 0.0:  # the shapes are symmetric
            return abs(start + target) / 2.0
        value, change = self.shape.value, target - start
        return (
            sum(abs(start + change * value((i + 0.5) / _SAMPLES)) for i in range(_SAMPLES))
            / _SAMPLES
        )


def read_constraints(node: Node | None) -> Performance | None:
    """Read DynamicConstraints; limits that it does not give are infinite. None where the element is
    absent."""
    if node is None:
        return None
    names = (
        "maxSpeed",
        "maxAcceleration",
        "maxDeceleration",
        "maxAccelerationRate",
        "maxDecelerationRate",
    )
    values = [node.float(name, math.inf) for name in names]
    if min(values) < 0.0:
        raise node.invalid("the limits of DynamicConstraints must not be negative")
    return Performance(*values)


def tighter(constraints: Performance, performance: Performance) -> Performance:
    """Limits of a controller that an action activates: no vehicle exceeds the constraints, or its
    own limits."""
    return Performance(
        *(min(own, other) for own, other in zip(constraints, performance, strict=True))
    )


class GapController:
    """Closes a gap within limits of speed, acceleration, deceleration and jerk, and hardly
    overshoots.

    It steers the closing speed to u(gap) by a = 2 √k (u − closing speed). Near the goal u = λ · gap
    with λ = √k / 2, which makes it a critically damped spring of stiffness k = 0.4 · b, where b is
    the limit for braking into the goal; where following that line would need more than B = 0.8 b,
    u = √(2 B gap − (B / λ)²). A jerk limit j bounds the bandwidth, √k ≤ j / limit. Without any
    limit but that of speed, the gap is closed as fast as that allows.

    Changes of speed have a planner of their own (`speed_plans`), because a speed is reached in a
    known time while a gap's goal moves as its reference drives. Planned by that one, chasing the
    speed u, the gap closes a quarter later or overshoots by metres
    (`test_a_plan_of_speeds_closes_gaps_worse`).

    Args:
        limits: infinite where there are none.
    """

    __slots__ = ("_acceleration", "_ahead", "_back", "_jerk", "_limits")

    def __init__(self, limits: Performance) -> None:
        self._limits = limits
        self._jerk = min(limits.max_acceleration_rate, limits.max_deceleration_rate)
        either = min(limits.max_acceleration, limits.max_deceleration, self._jerk)
        self._ahead = limits.max_acceleration if limits.max_acceleration < math.inf else either
        self._back = limits.max_deceleration if limits.max_deceleration < math.inf else either
        self._acceleration = 0.0

    def speed(self, gap: float, speed: float, goal_speed: float, dt: float) -> float:
        """Speed (m/s) to have after dt (s).

        Args:
            gap: way still to go, m; positive ahead.
            speed: own speed, m/s.
            goal_speed: at which the goal itself moves, m/s.
        """
        # No acceleration limits at all: the gap is closed within this step.
        if self._ahead == math.inf:
            target = goal_speed + gap / dt
        else:
            target = speed + self._steer(gap, speed - goal_speed, dt) * dt
        return min(max(target, -self._limits.max_speed), self._limits.max_speed)

    def _steer(self, gap: float, closing: float, dt: float) -> float:
        drive, brake = (self._ahead, self._back) if gap > 0.0 else (self._back, self._ahead)
        # Stiffness k = 0.4 b, see the class; the jerk limits how fast the spring may react.
        root = math.sqrt(0.4 * brake)
        if self._jerk < math.inf and (strongest := max(drive, brake)) > 0.0:
            root = min(root, self._jerk / strongest)
        acceleration = 2.0 * root * (_safe_closing(gap, RESERVE * brake, root / 2.0) - closing)
        acceleration = min(max(acceleration, -self._back), self._ahead)
        # Jerk limits relative to the acceleration of the step before.
        acceleration = max(
            acceleration, self._acceleration - self._limits.max_deceleration_rate * dt
        )
        self._acceleration = min(
            acceleration, self._acceleration + self._limits.max_acceleration_rate * dt
        )
        return self._acceleration

    @property
    def numbers(self) -> tuple[float, ...]:
        """Accelerations ahead and back, jerk, limits of speed, deceleration rate and acceleration
        rate, and the present acceleration, as `gap_speeds` takes them."""
        limits = self._limits
        rates = limits.max_deceleration_rate, limits.max_acceleration_rate
        return (
            self._ahead, self._back, self._jerk, limits.max_speed, *rates, self._acceleration
        )  # fmt: skip


def _safe_closing(gap: float, brake: float, slope: float) -> float:
    far = abs(gap)
    if slope * slope * far <= brake:
        return slope * gap
    # Line and root meet at gap = brake / slope² with the same slope: the closing speed has no kink.
    knee = brake / slope
    return math.copysign(math.sqrt(2.0 * brake * far - knee * knee), gap)


def gap_speeds(
    controllers: FloatArray,
    rows: BoolArray,
    gap: FloatArray,
    speed: FloatArray,
    goal_speed: FloatArray,
    dt: float,
) -> FloatArray:
    """Speeds (n,) of `GapController` in many runs.

    Args:
        controllers: numbers (7, n) of the controller of each run, as of `GapController.numbers`;
            the present acceleration is changed in place.
        rows: runs in which it is at work (n,). gap, speed, goal_speed, dt: as of
            `GapController.speed`, (n,).
    """
    ahead, back, jerk, fastest, slowing, rising, before = controllers
    free = np.isinf(ahead)
    forward = gap > 0.0
    drive, brake = np.where(forward, ahead, back), np.where(forward, back, ahead)
    strongest = np.maximum(drive, brake)
    closing, far = speed - goal_speed, np.abs(gap)
    with np.errstate(invalid="ignore", divide="ignore"):  # of runs without these limits
        root = np.sqrt(0.4 * brake)
        root = np.where(strongest > 0.0, np.minimum(root, jerk / strongest), root)
        safe, slope = RESERVE * brake, root / 2.0
        knee = safe / slope
        fast = np.copysign(np.sqrt(2.0 * safe * far - knee * knee), gap)
        wanted = np.where(slope * slope * far <= safe, slope * gap, fast)
        steered = np.minimum(np.maximum(2.0 * root * (wanted - closing), -back), ahead)
        steered = np.maximum(steered, before - slowing * dt)
        steered = np.minimum(steered, before + rising * dt)
        controllers[6] = np.where(rows & ~free, steered, before)
        target = np.where(free, goal_speed + gap / dt, speed + steered * dt)
    held: FloatArray = np.minimum(np.maximum(target, -fastest), fastest)
    return held


class Easing:
    """The way of an entity, whose lane has ended beside another or that changes lanes for its
    route, to its place in a lane.

    It is a cubic, smooth at both ends.

    Lateral values are to the left of where the entity faces, m.

    Args:
        place: its offset in lanes.
        left: where it is in the new lane.
        slope: how far it goes to the left for each metre, against the new lane; kept where that
            leads to its place.
        speed: m/s.
        within: distance (m) in which it is to be there, as far as 2 m/s² to the side allow.

    Attributes:
        length: distance (m) to its place.
    """

    __slots__ = ("_aside", "_way", "left", "length", "place", "slope")

    def __init__(
        self, place: float, left: float, slope: float, speed: float, within: float = math.inf
    ) -> None:
        self.place, self.left = place, left
        self._aside, self._way = left - place, 0.0
        # The length of a cubic over `aside` whose greatest lateral acceleration,
        # 6·aside·v²/length², is the given one.
        gentle, brisk = (
            abs(speed) * math.sqrt(6.0 * abs(self._aside) / lateral)
            for lateral in (_GENTLE, _BRISK)
        )
        self.length = max(brisk, min(gentle, within), _SLANT * abs(self._aside), _SHORTEST)
        # A slope away from the place would swing out before coming back: it is dropped.
        steepest = -3.0 * self._aside / self.length  # beyond it the cubic would go past the place
        self.slope = max(min(slope, max(steepest, 0.0)), min(steepest, 0.0))

    @property
    def done(self) -> bool:
        """Whether it is there."""
        return self._way >= self.length

    @property
    def inclination(self) -> float:
        """Way to the left for each metre, where it is now."""
        part = self._way / self.length
        rest = 1.0 - part
        return (
            self.slope * rest * (rest - 2.0 * part) - 6.0 * self._aside * part * rest / self.length
        )

    def advance(self, distance: float) -> float:
        """Return the value a distance (m, ≥ 0) further on."""
        self._way = min(self._way + distance, self.length)
        part = self._way / self.length
        rest = (1.0 - part) ** 2
        self.left = (
            self.place + self._aside * (1.0 + 2.0 * part) * rest + self.slope * self._way * rest
        )
        return self.left
