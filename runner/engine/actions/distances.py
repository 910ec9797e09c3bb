"""Actions that keep a distance to another entity: LongitudinalDistanceAction ahead or behind,
LateralDistanceAction to a side."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from runner.engine.actions.lateral import follow_road
from runner.engine.actions.speed import set_speed
from runner.engine.compile.array_protocols import ArraySteps
from runner.engine.compile.element import LATERAL, LONGITUDINAL, PrivateAction, need_places
from runner.engine.compile.protocols import Rest, Running
from runner.engine.compile.registry import action
from runner.engine.motion import spacing
from runner.engine.motion.dynamics import GapController, gap_speeds, read_constraints, tighter
from runner.engine.motion.following import PathMotion
from runner.engine.motion.placement import wrap
from runner.engine.participants.boxes import box_corners
from runner.engine.participants.declaration import Performance
from runner.engine.participants.entity import Entity
from schemas.common.array_types import BoolArray, FloatArray
from xosc.document.node import Node

if TYPE_CHECKING:
    from runner.engine.compile.array_protocols import ArrayRun
    from runner.engine.compile.protocols import Run
    from runner.engine.compile.registry import Context
    from runner.engine.participants.rows import EntityRows


_SIDES = {"trailingReferencedEntity": 1, "leadingReferencedEntity": -1, "any": 0}
_REACHED = 0.1
"""Gap error (m) below which a distance counts as reached."""
_EXACT, _CORRECTIONS = 1e-4, 10
"""Error (m) that a rigid placement is corrected to, and the most corrections on a curved way."""


@action("LongitudinalDistanceAction")
@dataclass(frozen=True, slots=True)
class LongitudinalDistanceAction(PrivateAction):
    """Keeps a distance, or a time gap at the reference's speed, to a reference entity.

    Without DynamicConstraints the distance holds at once and rigidly, whatever motion that means;
    with them (and for an entity that a system under test drives) a controller within the limits
    closes the gap. Where `continuous`, it never ends by itself.
    """

    domains: ClassVar[tuple[str, ...]] = (LONGITUDINAL,)
    run_by_run: ClassVar[bool] = True

    node: Node
    reference: Entity
    distance: float | None
    time_gap: float
    freespace: bool
    system: str
    side: int
    continuous: bool
    constraints: Performance | None

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> LongitudinalDistanceAction:
        """Build from a LongitudinalDistanceAction element."""
        distance, time_gap = node.finite("distance", None), node.finite("timeGap", None)
        if (distance is None) == (time_gap is None):
            raise node.invalid("exactly one of the attributes distance and timeGap is expected")
        if (distance or 0.0) < 0.0 or (time_gap or 0.0) < 0.0:
            raise node.invalid(
                "distance and timeGap must not be negative; displacement says on which side"
            )
        return cls(
            node=node,
            reference=context.entity(node),
            distance=distance,
            time_gap=time_gap or 0.0,
            freespace=node.bool("freespace"),
            system=read_system(node),
            side=_SIDES[node.choice("displacement", _SIDES, "trailingReferencedEntity")],
            continuous=node.bool("continuous"),
            constraints=read_constraints(node.find("DynamicConstraints")),
        )

    def references(self) -> Iterable[Entity]:
        """The entity that the distance is kept to."""
        return (self.reference,)

    def start(self, actor: Entity, run: Run) -> Running | None:
        """Take the place at once where nothing limits the motion, and keep it
        where `continuous`.
        """
        need_places(self.node, actor, self.reference)
        if self.system in ("road", "lane"):
            run.roads.keep_to_road(actor)
        gap = _Gap(self, actor, run)
        if self.constraints is not None or (
            actor.controls.driver is not None and not run.initialising
        ):
            limits = tighter(self.constraints or Performance(), actor.declared.performance)
            return _DistanceKeeping(gap, limits, self.continuous)
        gap.close()
        set_speed(
            actor,
            self.reference.speed if run.initialising else self.reference.controls.target_speed,
            run,
        )
        return _Rigid(gap) if self.continuous else None

    def steps_in_arrays(self, actor: EntityRows, run: ArrayRun) -> ArraySteps | None:
        """The controllers of many runs; a rigid distance is kept run by run."""
        return _Approaches(self, actor, run) if self.constraints is not None else None


def read_system(node: Node) -> str:
    """The coordinateSystem of a distance action.

    Raises:
        Unsupported: it is the world's, which has neither a longitudinal nor a lateral direction.
    """
    system = node.choice("coordinateSystem", (*spacing.SYSTEMS, "world"), "entity")
    if system == "world":
        raise node.unsupported(
            "coordinateSystem='world' gives this distance no direction; use entity, "
            "lane, road or trajectory"
        )
    return str(system)


class _Gap:
    """The distance to be kept, as a reference-point distance along the actor's way."""

    __slots__ = ("action", "actor", "run", "side")

    def __init__(self, action: LongitudinalDistanceAction, actor: Entity, run: Run) -> None:
        self.action = action
        self.actor = actor
        self.run = run
        self.side = action.side or (1 if (self._ahead() or 0.0) >= 0.0 else -1)

    def _ahead(self) -> float | None:
        if not self.action.reference.active:
            return None
        return spacing.longitudinal(
            self.run.roads, self.actor, self.action.reference, self.action.system, False
        )

    def error(self) -> float | None:
        """Return the distance (m) that the actor is behind its goal; None if undefined."""
        ahead = self._ahead()
        return None if ahead is None else ahead - self.side * self._target_distance()

    def _target_distance(self) -> float:
        action = self.action
        distance = (
            action.distance
            if action.distance is not None
            else action.time_gap * abs(action.reference.speed)
        )
        return distance + self._overhang() if action.freespace else distance

    def _overhang(self) -> float:
        """Length (m) between the two reference points that the boxes cover."""
        actor, reference = self.actor, self.action.reference
        angle = wrap(reference.h - actor.h)
        if self.action.system != "entity":
            angle = 0.0 if abs(angle) <= math.pi / 2 else math.pi
        along = [x for x, _ in box_corners(0.0, 0.0, angle, reference.box)]
        rear = actor.declared.front - actor.box.length
        return actor.declared.front - min(along) if self.side > 0 else max(along) - rear

    def close(self) -> None:
        """Move the actor along its own way to where the distance holds."""
        actor = self.actor
        sideways, actor.controls.target_offset = actor.controls.target_offset, None
        for _ in range(_CORRECTIONS):
            error = self.error()
            if error is None or abs(error) < _EXACT:
                break
            _move(actor, error)
        actor.controls.target_offset = sideways


def _move(actor: Entity, distance: float) -> None:
    """Move an entity forward (m; backward where negative) on the way that it
    follows, in no time.
    """
    motion = actor.controls.motion
    if isinstance(motion, PathMotion):
        motion.s = max(motion.s + distance, 0.0)
        motion.put(actor, actor.speed)
    else:
        motion.advance(actor, distance, 1.0)


class _Rigid(Running):
    """The distance holds exactly at every step."""

    __slots__ = ("_gap",)

    def __init__(self, gap: _Gap) -> None:
        self._gap = gap

    def follows(self) -> Entity | None:
        """The reference."""
        return self._gap.action.reference

    def step(self, dt: float) -> bool:
        """Correct what the last step has left, and move as the reference does."""
        self._gap.close()
        self._gap.actor.controls.target_speed = self._gap.action.reference.controls.target_speed
        return False


class _DistanceKeeping(Running):
    """The distance is reached, and kept, within limits."""

    __slots__ = ("_continuous", "_controller", "_gap")

    def __init__(self, gap: _Gap, limits: Performance, continuous: bool) -> None:
        self._gap = gap
        self._controller = GapController(limits)
        self._continuous = continuous

    @property
    def goal(self) -> LongitudinalDistanceAction:
        """The action, with the distance of its run."""
        return self._gap.action

    @property
    def side(self) -> int:
        """1 where the actor is to be behind the reference, −1 ahead of it."""
        return self._gap.side

    @property
    def limits(self) -> tuple[float, ...]:
        """Numbers of the controller."""
        return self._controller.numbers

    def follows(self) -> Entity | None:
        """The reference."""
        return self._gap.action.reference

    def step(self, dt: float) -> bool:
        """Ask for the controller's speed; without a way to the reference the speed stays."""
        gap = self._gap
        error = gap.error()
        if error is None:
            return False
        actor, reference = gap.actor, gap.action.reference
        actor.controls.target_speed = max(
            self._controller.speed(error, actor.speed, reference.speed, dt), 0.0
        )
        return not self._continuous and abs(error) < _REACHED

    def rest(self) -> Rest | None:
        """The distance; None where it is kept without end, or is undefined."""
        return None if self._continuous else _apart(self._gap.error(), _REACHED)


class _Approaches(ArraySteps):
    """`_DistanceKeeping` of an actor in many runs."""

    def __init__(
        self, action: LongitudinalDistanceAction, actor: EntityRows, run: ArrayRun
    ) -> None:
        self._action, self._actor, self._run = action, actor, run
        self._distance, self._time_gap = np.zeros(run.n), np.zeros(run.n)
        self._side = np.ones(run.n)
        self._limits = np.zeros((run.n, 7))
        run.own(self)

    def begin(self, row: int, running: _DistanceKeeping) -> None:
        """Take in the goal, the side and the limits of a run."""
        goal = running.goal
        self._distance[row], self._time_gap[row] = goal.distance or 0.0, goal.time_gap
        self._side[row], self._limits[row] = running.side, running.limits

    def step(self, rows: BoolArray, dt: float) -> BoolArray:
        """Ask for the controllers' speeds; where there is no way to the
        reference the speed stays.
        """
        actor, action = self._actor, self._action
        reference = self._run.entities[action.reference.name]
        ahead = spacing.ahead_arrays(self._run.roads, actor, reference, action.system, rows)
        goal = self._distance + self._time_gap * np.abs(reference.speed)
        if action.freespace:
            goal += self._overhang(reference)
        error = ahead - self._side * goal
        known = rows & ~np.isnan(error)
        limits = self._limits.T
        wanted = gap_speeds(limits, known, error, actor.speed, reference.speed, dt)
        actor.target_speed = np.where(known, np.maximum(wanted, 0.0), actor.target_speed)
        done: BoolArray = known & (np.abs(error) < _REACHED)
        return done & (not action.continuous)

    def _overhang(self, reference: EntityRows) -> FloatArray:
        """`_Gap._overhang` in the runs (n,)."""
        actor, box = self._actor, reference.box
        angle = np.remainder(reference.h - actor.h + math.pi, math.tau) - math.pi
        if self._action.system != "entity":
            angle = np.where(np.abs(angle) <= math.pi / 2, 0.0, math.pi)
        c, s = np.cos(angle), np.sin(angle)
        middle = box.x * c - box.y * s
        half = (box.length * np.abs(c) + box.width * np.abs(s)) / 2
        front, rear = actor.declared.front, actor.declared.front - actor.box.length
        return np.where(self._side > 0, front - (middle - half), middle + half - rear)


def _apart(error: float | None, tolerance: float) -> Rest | None:
    """Return the rest of a distance that is so far (m) from its goal, None if undefined."""
    if error is None:
        return None
    return Rest("its distance", f"{abs(error):.2f} m from it", abs(error), tolerance)


_LATERAL_SIDES = {"leftToReferencedEntity": 1, "rightToReferencedEntity": -1, "any": 0}
_LATERALLY_REACHED = 0.01
"""Error (m) below which a lateral distance counts as reached."""


@action("LateralDistanceAction")
@dataclass(frozen=True, slots=True)
class LateralDistanceAction(PrivateAction):
    """Keeps a lateral distance to a reference entity; without `distance`, the distance at the
    action's start.

    Where there is no road, it moves across the direction that it faces, which is that of the
    reference. Without DynamicConstraints the distance holds at once and rigidly; with them a
    controller within the limits moves the entity sideways. Where `continuous`, it never ends by
    itself. Sides are those of the reference.
    """

    domains: ClassVar[tuple[str, ...]] = (LATERAL,)
    run_by_run: ClassVar[bool] = True

    node: Node
    reference: Entity
    distance: float | None
    freespace: bool
    system: str
    side: int
    continuous: bool
    constraints: Performance | None

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> LateralDistanceAction:
        """Build from a LateralDistanceAction element."""
        distance = node.finite("distance", None)
        if distance is not None and distance < 0.0:
            raise node.invalid(
                f"distance={distance:g} must not be negative; displacement says on which side"
            )
        return cls(
            node=node,
            reference=context.entity(node),
            distance=distance,
            freespace=node.bool("freespace"),
            system=read_system(node),
            side=_LATERAL_SIDES[node.choice("displacement", _LATERAL_SIDES, "any")],
            continuous=node.bool("continuous"),
            constraints=_both_ways(read_constraints(node.find("DynamicConstraints"))),
        )

    def references(self) -> Iterable[Entity]:
        """The entity that the distance is kept to."""
        return (self.reference,)

    def start(self, actor: Entity, run: Run) -> Running | None:
        """Begin; an initial action without limits sets the place at time 0."""
        need_places(self.node, self.reference)
        if self.system != "entity" or run.roads.network is not None:
            follow_road(actor, run, self.node)
        running = _Sidestep(self, actor, run)
        if not run.initialising or self.constraints is not None:
            return running
        running.step(run.dt)
        actor.controls.motion.advance(actor, 0.0, run.dt)
        run.roads.stay(actor)
        return running if self.continuous else None


def _both_ways(limits: Performance | None) -> Performance | None:
    """Limits of lateral motion, where left and right are alike: the smaller of acceleration and
    deceleration."""
    if limits is None:
        return None
    acceleration = min(limits.max_acceleration, limits.max_deceleration)
    rate = min(limits.max_acceleration_rate, limits.max_deceleration_rate)
    return Performance(limits.max_speed, acceleration, acceleration, rate, rate)


class _Sidestep(Running):
    """The distance is reached, and kept."""

    __slots__ = ("_action", "_actor", "_controller", "_distance", "_run", "_side", "_speed")

    def __init__(self, action: LateralDistanceAction, actor: Entity, run: Run) -> None:
        self._action = action
        self._actor = actor
        self._run = run
        self._controller = (
            GapController(action.constraints) if action.constraints is not None else None
        )
        self._speed = 0.0
        left = self._left() or 0.0
        self._side = action.side or (1 if left >= 0.0 else -1)
        self._distance = action.distance
        if self._distance is None:
            self._distance = max(self._side * left - self._cover(), 0.0)

    def _left(self) -> float | None:
        """Return the offset (m) of the actor to the left of the reference; None if undefined."""
        action = self._action
        if not action.reference.active:
            return None
        return spacing.lateral(self._run.roads, action.reference, self._actor, action.system, False)

    def _cover(self) -> float:
        """Width (m) between the two reference points that the boxes cover."""
        action, actor = self._action, self._actor
        if not action.freespace:
            return 0.0
        angle = wrap(actor.h - action.reference.h)
        if action.system != "entity":
            angle = 0.0 if abs(angle) <= math.pi / 2 else math.pi
        across = [y for _, y in box_corners(0.0, 0.0, angle, actor.box)]
        box = action.reference.box
        reach = box.width / 2 + self._side * box.y
        return reach - min(across) if self._side > 0 else reach + max(across)

    def _error(self) -> float | None:
        """Return the offset (m) to the actor's own left that is left to move; None if the distance
        is undefined."""
        left = self._left()
        if left is None or self._distance is None:
            return None
        error = self._side * (self._distance + self._cover()) - left
        return error if math.cos(self._actor.h - self._action.reference.h) >= 0.0 else -error

    def follows(self) -> Entity | None:
        """The reference."""
        return self._action.reference

    def step(self, dt: float) -> bool:
        """Ask for the offset at the end of the step."""
        error, actor = self._error(), self._actor
        if error is None:
            return False
        step = error if self._controller is None else self._limited(self._controller, error, dt)
        if not actor.on_lane:
            actor.x, actor.y = (
                actor.x - step * math.sin(actor.h),
                actor.y + step * math.cos(actor.h),
            )
            h = self._action.reference.h
            actor.h = h if math.cos(actor.h - h) >= 0.0 else wrap(h + math.pi)
            return not self._action.continuous and abs(error) < _LATERALLY_REACHED
        actor.controls.target_offset = actor.kept_offset + actor.direction * step
        actor.controls.path_compensated = self._controller is not None
        return not self._action.continuous and abs(error) < _LATERALLY_REACHED

    def rest(self) -> Rest | None:
        """The distance; None where it is kept without end, or is undefined."""
        return None if self._action.continuous else _apart(self._error(), _LATERALLY_REACHED)

    def _limited(self, controller: GapController, error: float, dt: float) -> float:
        """Sideways step (m) of a controlled motion, by the present place of the reference, without
        prediction."""
        self._speed = controller.speed(error, self._speed, 0.0, dt)
        return self._speed * dt

    def stop(self) -> None:
        """The entity belongs to the lane that it is on."""
        self._run.roads.stay(self._actor)
