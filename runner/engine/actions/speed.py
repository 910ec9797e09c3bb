"""SpeedAction, and SpeedProfileAction: a series of speed targets over time."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from runner.engine.compile.array_protocols import ArrayProcess, ArraySteps, RunByRun
from runner.engine.compile.element import LONGITUDINAL, PrivateAction
from runner.engine.compile.protocols import Rest, Running
from runner.engine.compile.registry import action
from runner.engine.motion.dynamics import (
    EPSILON,
    FOLLOWING_MODES,
    TransitionDynamics,
    TransitionShape,
    read_constraints,
    tighter,
)
from runner.engine.motion.speed_plans import ProfileEntry, ProfilePiece, plan, pursued
from runner.engine.participants.declaration import Performance
from runner.engine.participants.entity import Entity
from schemas.expressions.columns import NotInArrays
from xosc.document.node import Node

if TYPE_CHECKING:
    from runner.engine.compile.array_protocols import ArrayRun
    from runner.engine.compile.protocols import Run
    from runner.engine.compile.registry import Context
    from runner.engine.participants.rows import EntityRows
    from schemas.common.array_types import BoolArray, FloatArray


RELATIVE: dict[str, Callable[[float, float], float]] = {
    "delta": lambda speed, value: speed + value,
    "factor": lambda speed, value: speed * value,
}
"""SpeedTargetValueType → the target speed (m/s), from the reference's speed and the value."""


@action("SpeedAction")
@dataclass(frozen=True, slots=True)
class SpeedAction(PrivateAction):
    """Brings an entity to a speed, absolute or relative to another entity's.

    A relative target is the reference's speed at the action's start, or, where `continuous`, its
    speed at any time; the action then never ends by itself. A step is a change of state, which no
    Performance bounds.

    Where `lasting`, as in scenarios for CARLA, a step in a story keeps the speed over its time or
    distance, and ends then.
    """

    domains: ClassVar[tuple[str, ...]] = (LONGITUDINAL,)

    dynamics: TransitionDynamics
    value: float
    reference: Entity | None
    relation: str
    continuous: bool
    lasting: bool = False

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> SpeedAction:
        """Build from a SpeedAction element."""
        dynamics = TransitionDynamics.from_xml(node.need("SpeedActionDynamics"), context.version)
        target = node.need("SpeedActionTarget").only()
        value = target.finite("value")
        if target.tag == "AbsoluteTargetSpeed":
            return cls(dynamics, value, None, "", False, context.document.for_carla)
        relation = target.choice("speedTargetValueType", RELATIVE)
        return cls(
            dynamics,
            value,
            context.entity(target),
            relation,
            target.bool("continuous"),
            context.document.for_carla,
        )

    def references(self) -> Iterable[Entity]:
        """The entity whose speed the target is relative to."""
        return (self.reference,) if self.reference is not None else ()

    @property
    def goal(self) -> float:
        """Speed asked for now, m/s."""
        if self.reference is None:
            return self.value
        return RELATIVE[self.relation](self.reference.speed, self.value)

    def target(self, actor: Entity) -> float:
        """Target speed now, m/s: the goal as far as the Performance bounds it."""
        speed = self.goal
        limit = math.inf if self.dynamics.strict else actor.declared.performance.max_speed
        return min(max(speed, -limit), limit)

    def start(self, actor: Entity, run: Run) -> Running | None:
        """Begin; a change that takes no time is complete at once, unless it never ends."""
        target = self.target(actor)
        duration = self.dynamics.speed_duration(actor.speed, target, actor.declared.performance)
        if duration <= 0.0:
            set_speed(actor, target, run)
        if self.continuous:
            return _Tracking(self, actor, duration)
        if self.lasting and duration <= 0.0 and not run.initialising:
            return _Hold(actor, self.dynamics)
        if duration <= 0.0:
            if run.initialising or target == self.goal:
                return None
            return _AtOnce(actor, self.goal)
        limits = actor.declared.performance
        jerky = min(limits.max_acceleration_rate, limits.max_deceleration_rate) < math.inf
        if jerky and not self.dynamics.strict and duration < math.inf:
            pieces = plan(actor.speed, [ProfileEntry(duration, target)], limits, True)
            return _Profile(actor, None, pieces, self.goal)
        return _SpeedTransition(actor, target, duration, self.dynamics.shape, self.goal)

    def in_arrays(self, actor: EntityRows, run: ArrayRun) -> ArrayProcess:
        """The change of speed, unless jerk limits make a profile of it."""
        limits = actor.declared.performance
        jerk = min(limits.max_acceleration_rate, limits.max_deceleration_rate)
        if self.lasting:
            raise NotInArrays("a SpeedAction of a file for CARLA plays in single runs only")
        if jerk < math.inf and not self.dynamics.strict:
            return RunByRun(self, actor, run)
        return _Changes(self, actor, run)


class _Changes(ArrayProcess):
    """A SpeedAction of an actor in many runs: `_SpeedTransition` and `_Tracking`."""

    def __init__(self, action: SpeedAction, actor: EntityRows, run: ArrayRun) -> None:
        super().__init__(run)
        self._action, self._actor, self._run = action, actor, run
        self._reference = (
            run.entities[action.reference.name] if action.reference is not None else None
        )
        self._start, self._target = np.zeros(run.n), np.zeros(run.n)
        self._duration, self._elapsed = np.zeros(run.n), np.zeros(run.n)

    @property
    def _asked(self) -> FloatArray:
        """Speed asked for now (n,), m/s."""
        value: FloatArray = self._run.value(self._action.value) * np.ones(self._run.n)
        if self._reference is not None:
            value = RELATIVE[self._action.relation](self._reference.speed, value)  # type: ignore[arg-type, assignment]
        return value

    @property
    def _goal(self) -> FloatArray:
        """The target speed now (n,), m/s: that as far as the Performance bounds it."""
        strict = self._action.dynamics.strict
        limit = math.inf if strict else self._actor.declared.performance.max_speed
        return np.minimum(np.maximum(self._asked, -limit), limit)

    def start(self, rows: BoolArray) -> BoolArray:
        """Begin; a change that takes no time is complete at once, unless it never ends."""
        action, actor, run = self._action, self._actor, self._run
        target = self._goal
        duration = action.dynamics.speed_duration_arrays(
            actor.speed, target, actor.declared.performance, run.value(action.dynamics.value)
        )
        run.leave(rows & np.isnan(duration))
        at_once = rows & (duration <= 0.0)
        actor.target_speed[at_once] = target[at_once]
        if run.initialising:
            actor.speed[at_once] = target[at_once]
        self._start[rows], self._target[rows] = actor.speed[rows], target[rows]
        self._duration[rows], self._elapsed[rows] = duration[rows], 0.0
        if action.continuous:
            return rows.copy()
        short = at_once & (not run.initialising) & (target != self._asked)
        return rows & (~at_once | short)

    def step(self, dt: float) -> BoolArray:
        """Ask for the speed at the end of the step."""
        self._elapsed = self._elapsed + dt
        if self._action.continuous:
            return self._track(dt)
        rows = np.flatnonzero(self.active)
        start, target = self._start[rows], self._target[rows]
        progress = self._elapsed[rows] / self._duration[rows]
        over = progress >= 1.0 - EPSILON
        shape = self._action.dynamics.shape.values(np.minimum(progress, 1.0))
        self._actor.target_speed[rows] = np.where(over, target, start + (target - start) * shape)
        done = np.zeros_like(self.active)
        done[rows] = over
        return done

    def _track(self, dt: float) -> BoolArray:
        actor, dynamics = self._actor, self._action.dynamics
        target = self._goal
        if dynamics.dimension == "rate" and dynamics.shape.slope > 0.0:
            reach = self._run.value(dynamics.value) * dt
            target = np.minimum(np.maximum(target, actor.speed - reach), actor.speed + reach)
        else:
            under = self.active & (self._elapsed < self._duration)
            progress = np.divide(
                self._elapsed, self._duration, out=np.zeros_like(target), where=under
            )
            way = self._start + (target - self._start) * dynamics.shape.values(progress)
            target = np.where(under, way, target)
        if not dynamics.strict and dynamics.shape.slope > 0.0:
            limits = actor.declared.performance
            faster = np.abs(target) > np.abs(actor.speed)
            most = np.where(faster, limits.max_acceleration, limits.max_deceleration) * dt
            target = np.minimum(np.maximum(target, actor.speed - most), actor.speed + most)
        actor.target_speed = np.where(self.active, target, actor.target_speed)
        return np.zeros_like(self.active)


def _reached(actor: Entity, goal: float) -> Rest:
    """Return the rest of an ended change of speed to a goal (m/s)."""
    return Rest(
        f"{goal:.2f} m/s", f"{actor.speed:.2f} m/s", abs(goal - actor.speed), _SPEED_TOLERANCE
    )


class _AtOnce(Running):
    """A change of speed that takes no time, and whose Performance does not allow its goal (m/s)."""

    __slots__ = ("_actor", "_goal")

    def __init__(self, actor: Entity, goal: float) -> None:
        self._actor, self._goal = actor, goal

    def step(self, dt: float) -> bool:
        """Return true: the speed was set at the start."""
        return True

    def rest(self) -> Rest:
        """The goal, and the speed."""
        return _reached(self._actor, self._goal)


def set_speed(actor: Entity, speed: float, run: Run) -> None:
    """Have the entity drive at a speed (m/s) from the coming step on; at the start, or when it has
    just entered, from now on."""
    actor.controls.target_speed = speed
    if run.initialising:
        actor.speed = speed
    elif actor.entered == run.time:
        actor.begin_at(speed)


def demanded_speed(actor: Entity) -> float:
    """Speed (m/s) requested for the coming step; the driven speed while another controller drives
    the entity."""
    controls = actor.controls
    return (
        actor.speed
        if controls.driver is not None or controls.world_driven
        else controls.target_speed
    )


class _SpeedTransition(Running):
    """Change to a target speed along a shape."""

    __slots__ = (
        "_actor",
        "_change",
        "_duration",
        "_elapsed",
        "_goal",
        "_start",
        "_target",
        "_value",
    )

    def __init__(
        self, actor: Entity, target: float, duration: float, shape: TransitionShape, goal: float
    ) -> None:
        self._actor = actor
        self._goal = goal
        self._start = actor.speed
        self._target = target
        self._change = target - actor.speed
        self._duration = duration
        self._value = shape.value
        self._elapsed = 0.0

    def step(self, dt: float) -> bool:
        """Ask for the profile's speed at the end of the step."""
        self._elapsed += dt
        progress = self._elapsed / self._duration
        if progress >= 1.0 - EPSILON:
            self._actor.controls.target_speed = self._target
            return True
        self._actor.controls.target_speed = self._start + self._change * self._value(progress)
        return False

    def rest(self) -> Rest:
        """The goal, and the speed."""
        return _reached(self._actor, self._goal)


class _Hold(Running):
    """Keeping a speed over a time (s) or distance (m)."""

    __slots__ = ("_actor", "_elapsed", "_extent", "_origin", "_over_distance")

    def __init__(self, actor: Entity, dynamics: TransitionDynamics) -> None:
        self._actor = actor
        self._extent = dynamics.value
        self._over_distance = dynamics.dimension == "distance"
        self._origin = actor.odometer
        self._elapsed = 0.0

    def step(self, dt: float) -> bool:
        """Wait."""
        self._elapsed += dt
        return (
            self._actor.odometer - self._origin if self._over_distance else self._elapsed
        ) >= self._extent - EPSILON


class _Tracking(Running):
    """Change to a speed that follows another entity's, which is then kept.

    With a rate, the demand moves by at most that rate; with a time or distance, the shape blends
    into the moving target, which is then kept: exactly, or with followingMode `follow` as far as
    the Performance allows.
    """

    __slots__ = ("_acceleration", "_action", "_actor", "_duration", "_elapsed", "_start")

    def __init__(self, action: SpeedAction, actor: Entity, duration: float) -> None:
        self._action = action
        self._actor = actor
        self._start = actor.speed
        self._duration = duration
        self._elapsed = self._acceleration = 0.0

    def follows(self) -> Entity | None:
        """The reference."""
        return self._action.reference

    def step(self, dt: float) -> bool:
        """Ask for the target's speed as far as it may be reached."""
        self._elapsed += dt
        actor, dynamics = self._actor, self._action.dynamics
        target = self._action.target(actor)
        if dynamics.dimension == "rate" and dynamics.shape.slope > 0.0:
            reach = dynamics.value * dt
            target = min(max(target, actor.speed - reach), actor.speed + reach)
        elif self._elapsed < self._duration:
            target = self._start + (target - self._start) * dynamics.shape.value(
                self._elapsed / self._duration
            )
        if not dynamics.strict and dynamics.shape.slope > 0.0:
            target, self._acceleration = pursued(
                actor.speed, self._acceleration, target, actor.declared.performance, dt
            )
        actor.controls.target_speed = target
        return False


_UNLIMITED = Performance()
_EPSILON = 1e-9
_LATE = 0.05
"""Time (s) by which the last target of a profile may come late"""
_SPEED_TOLERANCE = 0.1
"""Difference (m/s) from the goal of a change of speed that counts as none"""


@action("SpeedProfileAction")
@dataclass(frozen=True, slots=True)
class SpeedProfileAction(PrivateAction):
    """Runs through speed targets, absolute or relative to another entity's speed at any time.

    followingMode `position` interpolates linearly. `follow` goes from no acceleration at the start
    to none at the end within the jerk limits (`speed_plans`). Limits are those of
    DynamicConstraints and, where these say nothing and the mode is `follow`, the entity's
    Performance; what they forbid takes longer than the entries say.
    """

    domains: ClassVar[tuple[str, ...]] = (LONGITUDINAL,)
    run_by_run: ClassVar[bool] = True

    entries: tuple[ProfileEntry, ...]
    reference: Entity | None
    smooth: bool
    constraints: Performance

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> SpeedProfileAction:
        """Build from a SpeedProfileAction element."""
        entries = tuple(_read_entry(entry) for entry in node.children("SpeedProfileEntry"))
        if not entries:
            raise node.invalid("a SpeedProfileEntry is expected inside")
        reference = context.entity(node) if node.has("entityRef") else None
        constraints = read_constraints(node.find("DynamicConstraints")) or _UNLIMITED
        return cls(
            entries,
            reference,
            node.choice("followingMode", FOLLOWING_MODES) == "follow",
            constraints,
        )

    def references(self) -> Iterable[Entity]:
        """The entity whose speed the targets are relative to."""
        return (self.reference,) if self.reference is not None else ()

    def start(self, actor: Entity, run: Run) -> Running:
        """Plan the profile from the speed that the actor has, or that a SpeedAction has just
        demanded."""
        limits = (
            tighter(self.constraints, actor.declared.performance)
            if self.smooth
            else self.constraints
        )
        speed = demanded_speed(actor) - (
            self.reference.speed if self.reference is not None else 0.0
        )
        pieces = plan(speed, self.entries, limits, self.smooth)
        times = [entry.time for entry in self.entries if entry.time is not None]
        asked = sum(times) if len(times) == len(self.entries) else math.inf
        return _Profile(actor, self.reference, pieces, self.entries[-1].speed, asked)

    def steps_in_arrays(self, actor: EntityRows, run: ArrayRun) -> ArraySteps:
        """The profiles of many runs, each planned by itself."""
        return _Profiles(actor, run, self.reference)


def _read_entry(node: Node) -> ProfileEntry:
    time = node.finite("time", None)
    if time is not None and time < 0.0:
        raise node.invalid(f"time={time:g} must not be negative")
    return ProfileEntry(time, node.finite("speed"))


class _Profile(Running):
    """The profile in execution."""

    __slots__ = ("_actor", "_asked", "_elapsed", "_goal", "_pieces", "_reference", "_times")

    def __init__(
        self,
        actor: Entity,
        reference: Entity | None,
        pieces: list[ProfilePiece],
        goal: float,
        asked: float = math.inf,
    ) -> None:
        self._goal, self._asked = goal, asked
        self._actor = actor
        self._reference = reference
        self._pieces = pieces
        self._times = [piece.time for piece in pieces]
        self._elapsed = 0.0

    def follows(self) -> Entity | None:
        """The reference."""
        return self._reference

    @property
    def pieces(self) -> Sequence[ProfilePiece]:
        """Pieces of constant jerk; the last one has no end."""
        return self._pieces

    def step(self, dt: float) -> bool:
        """Ask for the profile's speed at the end of the step."""
        self._elapsed += dt
        time = self._elapsed + _EPSILON
        piece = self._pieces[bisect_right(self._times, time) - 1]
        base = self._reference.speed if self._reference is not None else 0.0
        self._actor.controls.target_speed = base + piece.at(self._elapsed)
        return time >= self._times[-1]

    def rest(self) -> Rest:
        """The last target and its time; where the speed is right, what is left is the time before
        it or that it came late."""
        left = self._times[-1] - self._elapsed
        base = self._reference.speed if self._reference is not None else 0.0
        speed = _reached(self._actor, base + self._goal)
        if left > _EPSILON:
            before = f"{speed.reached} {left:.2f} s before its end"
            return Rest(f"{speed.goal} at the end of its profile", before, left, _LATE)
        late = self._times[-1] - self._asked
        if speed.left > speed.tolerance or late <= _LATE:
            return speed
        goal, reached = (
            f"{speed.goal} in {self._asked:.2f} s",
            f"{speed.reached} in {self._times[-1]:.2f} s",
        )
        return Rest(goal, reached, late, _LATE)


class _Profiles(ArraySteps):
    """`_Profile` of an actor in many runs."""

    def __init__(self, actor: EntityRows, run: ArrayRun, reference: Entity | None) -> None:
        self._actor, self._run, self._reference = actor, run, reference
        self._elapsed = np.zeros(run.n)
        self._pieces = np.zeros((run.n, 0, 4))
        """time, speed, acceleration and jerk of each piece; those of infinite time are none"""
        run.own(self)

    def begin(self, row: int, running: _Profile) -> None:
        """Take in the plan of a run."""
        pieces = running.pieces
        if (lacking := len(pieces) - self._pieces.shape[1]) > 0:
            more = np.zeros((len(self._elapsed), lacking, 4))
            more[:, :, 0] = np.inf
            self._pieces = np.concatenate([self._pieces, more], axis=1)
        self._pieces[row, :, 0] = np.inf
        self._pieces[row, : len(pieces)] = pieces
        self._elapsed[row] = 0.0

    def step(self, rows: BoolArray, dt: float) -> BoolArray:
        """Ask for the profiles' speeds at the end of the step."""
        self._elapsed[rows] += dt
        elapsed, pieces = self._elapsed, self._pieces
        begun = pieces[:, :, 0] <= (elapsed + _EPSILON)[:, None]
        count = begun.sum(axis=1)
        time, speed, acceleration, jerk = pieces[
            np.arange(len(elapsed)), np.maximum(count - 1, 0)
        ].T
        past = np.where(rows, elapsed - time, 0.0)
        base = 0.0 if self._reference is None else self._run.entities[self._reference.name].speed
        wanted = base + speed + (acceleration + 0.5 * jerk * past) * past
        actor = self._actor
        actor.target_speed = np.where(rows, wanted, actor.target_speed)
        return rows & (count == np.isfinite(pieces[:, :, 0]).sum(axis=1))
