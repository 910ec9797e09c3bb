"""LaneChangeAction and LaneOffsetAction.

Both bring an entity's lateral position to a goal along a shape. Positions are held as seen by the
entity, positive to its left, because a lane offset (OpenDRIVE t direction) changes its sign where
the way leads onto a road that is laid the other way round. Nothing slides: a transition never moves
an entity sideways by more than it travels.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from runner.engine.compile.array_protocols import ArrayProcess, RunByRun
from runner.engine.compile.element import LATERAL, PrivateAction, need_places
from runner.engine.compile.protocols import Rest, Running
from runner.engine.compile.registry import action
from runner.engine.motion.dynamics import (
    EPSILON,
    SHAPES,
    Easing,
    TransitionDynamics,
    TransitionShape,
)
from runner.engine.participants.entity import Entity
from runner.engine.positions.lane import LAYERS
from xodr.model import PERMANENT, TEMPORARY, RoadPoint
from xosc.document.node import TO_RIGHT, Node
from xosc.rules.references import KEPT_LANE_OFFSET_UID, OTHER_ENTITY_UID

if TYPE_CHECKING:
    from runner.engine.compile.array_protocols import ArrayRun
    from runner.engine.compile.protocols import Run
    from runner.engine.compile.registry import Context
    from runner.engine.motion.on_roads import Roads
    from runner.engine.participants.rows import EntityRows
    from schemas.common.array_types import BoolArray, FloatArray
    from xodr.graph.network import RoadNetwork

_DEFAULT_ACCELERATION = 0.5
"""Lateral acceleration (m/s²) of a lane offset whose file gives none; the standard names no
default."""
_REST = 0.05
"""Lateral distance (m) from a goal that counts as none"""
_SAME_PLACE = 1e-6
"""Difference (m) between two offsets that counts as none."""


@action("LaneChangeAction")
@dataclass(frozen=True, slots=True)
class LaneChangeAction(PrivateAction):
    """Brings an entity to a lane, and to an offset from that lane's centre.

    A relative target counts lanes from the one that the reference is on, positive to the
    reference's left, the centre lane not counted; where `from_own`, as in scenarios for CARLA, from
    the entity's own lane whatever the reference. The entity's speed is that along its slanting
    path. Lanes are those of the target's `layer`. Without one, a relative target counts on the
    reference's layer, and an absolute one is on the layer that the entity prefers or else keeps to,
    if it is there.
    """

    domains: ClassVar[tuple[str, ...]] = (LATERAL,)

    node: Node
    dynamics: TransitionDynamics
    reference: Entity | None
    value: int
    offset: float
    from_own: bool = False
    layer: str | None = None

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> LaneChangeAction:
        """Build from a LaneChangeAction element."""
        dynamics = TransitionDynamics.from_xml(
            node.need("LaneChangeActionDynamics"), context.version
        )
        target = node.need("LaneChangeTarget").only()
        reference = context.entity(target) if target.tag == "RelativeTargetLane" else None
        value = target.int("value")
        if reference is None and value == 0:
            raise target.invalid("value='0' is the centre lane, which has no width to drive on")
        if context.network is not None:
            _check_lane(target, value, reference is None, context.network)
        from_own = reference is not None and context.document.for_carla
        layer = target.choice("layer", LAYERS, None)
        return cls(
            node, dynamics, reference, value, node.finite("targetLaneOffset", 0.0), from_own, layer
        )

    def references(self) -> Iterable[Entity]:
        """The entity that lanes are counted from."""
        return (self.reference,) if self.reference is not None and not self.from_own else ()

    def start(self, actor: Entity, run: Run) -> Running | None:
        """Express the entity's place in the target lane, and begin to move there."""
        follow_road(actor, run, self.node)
        before = actor.road, actor.kept_lane
        self.aim(actor, run)
        lane = actor.kept_lane
        change = (self.offset - actor.kept_offset) * actor.direction
        if (actor.road, lane) == before and abs(change) <= _SAME_PLACE:
            text = (
                f"{actor.name} is in lane {lane} already, at that offset: the lane "
                "change moves nothing"
            )
            run.remarks.note(self.node.remark(OTHER_ENTITY_UID, text))
        extent = self.dynamics.extent(change)
        goal = self.offset * actor.direction
        over_distance = self.dynamics.dimension == "distance"
        running = _LateralTransition(
            actor,
            run.roads,
            goal,
            self.dynamics.shape,
            extent,
            over_distance=over_distance,
            compensated=True,
        )
        return _begin(running, extent, actor, run)

    def in_arrays(self, actor: EntityRows, run: ArrayRun) -> ArrayProcess:
        """The change of lane; its lane is found run by run."""
        return _LaneChangeArrays(self, actor, run)

    def aim(self, actor: Entity, run: Run) -> None:
        """Express an entity's place in the target lane."""
        follow_road(actor, run, self.node)
        lane = self._lane(actor, run)
        assert actor.road is not None
        actor.kept_offset = actor.t - actor.road.lane_t(actor.s, lane)
        actor.kept_lane = lane

    def _lane(self, actor: Entity, run: Run) -> int:
        """The target lane; the entity keeps to that lane's layer from now on."""
        reference = actor if self.from_own else self.reference
        point, direction = _place(reference, run, self.node) if reference is not None else (None, 1)
        network = run.roads.network
        assert network is not None
        if point is not None:
            point = network.moved(point, self.layer or point.layer)
            self._keep_to(actor, run, point.layer)
        else:
            layer = self.layer or actor.controls.preferred_layer or actor.layer
            self._keep_to(actor, run, layer)
            if (
                self.layer is None
                and actor.road is not None
                and self.value not in actor.road.lane_ids(actor.s)
            ):
                self._keep_to(actor, run, PERMANENT if layer == TEMPORARY else TEMPORARY)
        road = actor.road
        assert road is not None
        there = road.lane_ids(actor.s)
        lane: int | None = self.value
        if point is not None:
            lane = self._counted(actor, run, point, self.value * direction)
        if lane is None or lane not in there:
            target = (
                f"{self.value}"
                if reference is None
                else f"{self.value:+d} from that of {reference.name}"
            )
            raise self.node.invalid(
                f"{actor.name} can't change to lane {target}: road {road.id} at s = {actor.s:.1f} "
                "m has the lanes "
                f"{', '.join(map(str, there))}"
            )
        return lane

    def _counted(self, actor: Entity, run: Run, origin: RoadPoint, steps: int) -> int | None:
        """Lane of the actor's road, a number of lanes towards +t of the lane of an origin; None if
        there is none."""
        road, network = actor.road, run.roads.network
        assert road is not None and network is not None
        lane = origin.lane_id
        if origin.road_id != road.id:
            here = run.roads.road_point(actor)
            relative = network.relative_in_lane(here, origin) if here is not None else None
            if here is not None and relative is not None:
                lane, steps = here.lane_id, relative.lanes + (steps if relative.aligned else -steps)
        return road.lane_beside(actor.s, lane, steps) if lane in road.lane_ids(actor.s) else None

    def _keep_to(self, actor: Entity, run: Run, layer: str) -> None:
        """Have an entity that follows a lane follow that of another layer under it, its place
        unchanged."""
        if actor.layer != layer and run.roads.network is not None:
            point, direction = _place(actor, run, self.node)
            run.roads.follow_lane(
                actor, run.roads.network.moved(point, layer), direction, actor.heading_offset
            )


def _check_lane(target: Node, value: int, absolute: bool, network: RoadNetwork) -> None:
    """Refuse a target lane that is nowhere on the roads."""
    if absolute and value not in network.lane_ids:
        lanes = ", ".join(map(str, sorted(network.lane_ids))) or "none"
        raise target.invalid(f"value='{value}' is no lane of any road; lanes there are: {lanes}")
    if not absolute and abs(value) >= max(network.most_lanes, 1):
        raise target.invalid(
            f"value='{value}' leads beyond the lanes of any road, which has "
            f"{network.most_lanes} at most"
        )


@action("LaneOffsetAction")
@dataclass(frozen=True, slots=True)
class LaneOffsetAction(PrivateAction):
    """Brings an entity to an offset from its lane's centre, absolute or from where another entity
    is across that lane.

    In scenarios for CARLA it is the other entity's offset in its own lane that counts. The duration
    is what the shape needs to stay within the lateral acceleration. Where `continuous`, the offset
    is then kept (to the reference's at any time), and the action never ends by itself. From one's
    own offset, what is kept is the goal of when the action starts: anything else would run away.
    """

    domains: ClassVar[tuple[str, ...]] = (LATERAL,)

    node: Node
    shape: TransitionShape
    acceleration: float
    reference: Entity | None
    value: float
    to_right: bool
    continuous: bool

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> LaneOffsetAction:
        """Build from a LaneOffsetAction element."""
        dynamics = node.need("LaneOffsetActionDynamics")
        acceleration = dynamics.float("maxLateralAcc", _DEFAULT_ACCELERATION)
        if acceleration < 0.0:
            raise dynamics.invalid(f"maxLateralAcc={acceleration:g} must not be negative")
        target = node.need("LaneOffsetTarget").only()
        reference = context.entity(target) if target.tag == "RelativeTargetLaneOffset" else None
        shape = SHAPES[dynamics.choice("dynamicsShape", SHAPES)]
        value, to_right = target.finite("value"), target.has(TO_RIGHT)
        return cls(node, shape, acceleration, reference, value, to_right, node.bool("continuous"))

    def references(self) -> Iterable[Entity]:
        """The entity that the offset is relative to."""
        return (self.reference,) if self.reference is not None else ()

    def start(self, actor: Entity, run: Run) -> Running | None:
        """Begin to move sideways."""
        from_itself = self.reference is actor
        if from_itself and self.continuous and self.value:
            text = (
                f"{actor.name} can't keep {self.value:g} m from its own lane offset; its offset "
                "at the start counts"
            )
            run.remarks.add(self.node.remark(KEPT_LANE_OFFSET_UID, text))
        follow_road(actor, run, self.node)
        run.roads.settle(actor)
        goal = self.goal(actor, run)
        extent = self._duration(goal - actor.kept_offset * actor.direction)
        running = _LateralTransition(
            actor, run.roads, goal, self.shape, extent, over_distance=False, compensated=False
        )
        if not self.continuous:
            return _begin(running, extent, actor, run)
        return _GoalKeeping(
            running,
            lambda: goal if self.reference is None or from_itself else self.goal(actor, run),
            self.reference,
        )

    def in_arrays(self, actor: EntityRows, run: ArrayRun) -> ArrayProcess:
        """The offset from the centre of the own lane; run by run where it is
        relative to an entity.
        """
        return _Shifting(self, actor, run) if self.reference is None else RunByRun(self, actor, run)

    def aim(self, actor: Entity, run: Run) -> None:
        """Have an entity keep to the lane that it is on."""
        follow_road(actor, run, self.node)
        run.roads.settle(actor)

    def durations(self, change: FloatArray, run: ArrayRun) -> FloatArray:
        """Time (s) of changes (m) in many runs (n,)."""
        acceleration = run.value(self.acceleration) * np.ones_like(change)
        way = np.sqrt(
            np.divide(
                self.shape.bend * np.abs(change),
                acceleration,
                out=np.full_like(change, np.inf),
                where=acceleration > 0.0,
            )
        )
        return np.where((change == 0.0) | (self.shape.bend == 0.0), 0.0, way)

    def goal(self, actor: Entity, run: Run) -> float:
        """Offset (m) to be reached, positive to the actor's left."""
        left = -self.value if self.to_right else self.value * actor.direction
        if self.reference is None:
            return left
        there = _place(self.reference, run, self.node)[0]
        aside = there.offset if self.to_right else _aside(actor, there, run)
        return aside * actor.direction + left

    def _duration(self, change: float) -> float:
        if self.shape.bend == 0.0 or change == 0.0:
            return 0.0
        return (
            math.sqrt(self.shape.bend * abs(change) / self.acceleration)
            if self.acceleration > 0.0
            else math.inf
        )


def follow_road(actor: Entity, run: Run, node: Node) -> None:
    """Have an entity follow the lane that it is on, where it does not do so already.

    Raises:
        InvalidFile: the entity is not on a road.
    """
    if actor.on_lane:
        return
    point, direction = _place(actor, run, node)
    run.roads.follow_lane(actor, point, direction)


def _place(entity: Entity, run: Run, node: Node) -> tuple[RoadPoint, int]:
    """Road point of an entity, and +1 where it faces increasing s."""
    need_places(node, entity)
    point = run.roads.road_point(entity)
    if point is None or run.roads.network is None:
        raise node.invalid(f"{entity.name} is not on a road, so it has no lane")
    if entity.on_lane:
        return point, entity.direction
    return point, 1 if math.cos(entity.h - run.roads.network.pose(point).h) >= 0.0 else -1


def _aside(actor: Entity, place: RoadPoint, run: Run) -> float:
    """Offset (m, towards +t) of a place from the centre of an entity's lane; from its own lane's
    where no way leads there."""
    road = actor.road
    assert road is not None and run.roads.network is not None
    if place.road_id == road.id and actor.kept_lane in road.lane_ids(place.s):
        return place.t - road.lane_t(place.s, actor.kept_lane)
    here = RoadPoint(road.id, actor.s, actor.t, actor.kept_lane, actor.kept_offset, actor.layer)
    relative = run.roads.network.relative_in_lane(here, place)
    return place.offset if relative is None else actor.kept_offset + relative.dt


def _begin(running: _LateralTransition, extent: float, actor: Entity, run: Run) -> Running | None:
    """An initial action that takes no time sets the place at time 0."""
    if not run.initialising or extent > 0.0:
        return running
    running.step(0.0)
    actor.controls.motion.advance(actor, 0.0, run.dt)
    running.stop()
    return None


class _LateralTransition(Running):
    """Motion to a lateral goal along a shape, over time (s) or over the distance travelled (m).

    Where the lane bound for does not go on, as at a junction, the entity is on another lane from
    there on: it goes on to the goal in that one, gently (`Easing`).
    """

    __slots__ = (
        "_actor",
        "_asked",
        "_compensated",
        "_easing",
        "_extent",
        "_lane",
        "_origin",
        "_over_distance",
        "_past",
        "_roads",
        "_slope",
        "_start",
        "_value",
        "goal",
    )

    def __init__(
        self, actor: Entity, roads: Roads, goal: float, shape: TransitionShape, extent: float, *,
        over_distance: bool,
        compensated: bool,
    ) -> None:  # fmt: skip
        self.goal = goal
        self._actor, self._roads = actor, roads
        self._start = actor.kept_offset * actor.direction
        self._value = shape.value
        self._extent = extent
        self._over_distance = over_distance
        self._compensated = compensated
        self._origin = actor.odometer
        self._past = 0.0
        self._asked = self._start
        self._slope = 0.0
        self._easing: Easing | None = None
        self._lane: int | None = None

    def step(self, dt: float) -> bool:
        """Ask for the shape's offset at the end of the step, limited to what the entity's motion
        reaches."""
        actor = self._actor
        way, left = abs(actor.speed) * dt, actor.kept_offset * actor.direction
        if abs(left - self._asked) > _SAME_PLACE and actor.controls.target_offset is None:
            self._easing = Easing(self.goal, left, self._slope, actor.speed)
        offset, over = (
            self._next(way, dt) if self._easing is None else self._eased(self._easing, way)
        )
        if self._extent > 0.0:
            offset = min(max(offset, left - way), left + way)
        if way:
            self._slope = (offset - left) / way
        self._asked = offset
        actor.controls.target_offset = offset * actor.direction
        actor.controls.path_compensated = self._compensated
        return over and offset == self.goal

    def _next(self, way: float, dt: float) -> tuple[float, bool]:
        """Return the shape's offset (m) after a step along a way (m) for dt (s), and whether the
        shape ends there."""
        actor = self._actor
        self._past = actor.odometer - self._origin + way if self._over_distance else self._past + dt
        progress = self._past / self._extent if self._extent > 0.0 else 1.0
        over = progress >= 1.0 - EPSILON
        return self.goal if over else self._start + (self.goal - self._start) * self._value(
            progress
        ), over

    def _eased(self, easing: Easing, way: float) -> tuple[float, bool]:
        """Return the same for the way to the goal in the lane that the entity is on now."""
        offset = easing.advance(way)
        return (self.goal if easing.done else offset), easing.done

    def stop(self) -> None:
        """Have the entity keep to the lane that it is on, which may not be the one it was bound for
        or began in."""
        self._lane = self._actor.kept_lane
        self._roads.stay(self._actor)

    def rest(self) -> Rest | None:
        """The offset from the lane that it is bound for; what is left is the way (m) to the side.
        None where that lane ends."""
        actor = self._actor
        lane = actor.kept_lane if self._lane is None else self._lane
        if actor.road is None or lane not in actor.road.lane_ids(actor.s):
            return None
        offset = (actor.t - actor.road.lane_t(actor.s, lane)) * actor.direction
        left = abs(offset - self.goal)
        goal = f"{self.goal:.2f} m left of the centre of lane {lane}"
        return Rest(goal, f"{offset:.2f} m", left, _REST)


class _Sideways(ArrayProcess):
    """`_LateralTransition` of an actor in many runs."""

    compensated: ClassVar[bool]

    def __init__(self, actor: EntityRows, run: ArrayRun, shape: TransitionShape) -> None:
        super().__init__(run)
        self._actor, self._run, self._shape = actor, run, shape
        self._over_distance = self._kept = False
        n = run.n
        self._goal, self._start, self._extent, self._origin, self._past, self._asked = (
            np.zeros(n) for _ in range(6)
        )

    def _aim(self, action: LaneChangeAction | LaneOffsetAction, rows: BoolArray) -> None:
        """Find the lane aimed at: once for all runs in which everyone is in the same lanes."""
        actor, run = self._actor, self._run
        left, references = rows & run.going, [*action.references()]
        while left.any():
            first = int(np.argmax(left))
            alike = actor.alike(first, left)
            for other in references:
                alike &= run.entities[other.name].alike(first, left)
            lanes = actor.section_key[first]
            one = np.arange(run.n) == first
            run.one_by_one(actor, one, references, lambda entity, _: action.aim(entity, run.single))
            if alike[first] and run.going[first] and lanes == actor.section_key[first]:
                actor.change_lane(first, alike & ~one)
                left &= ~alike
            left &= ~one

    def _begin(self, rows: BoolArray, goal: FloatArray, extent: FloatArray) -> BoolArray:
        actor, run = self._actor, self._run
        self._goal[rows], self._extent[rows] = goal[rows], extent[rows]
        self._start[rows] = (actor.kept_offset * actor.direction)[rows]
        self._asked[rows] = self._start[rows]
        self._origin[rows], self._past[rows] = actor.odometer[rows], 0.0
        if run.initialising and not self._kept and (rows & (extent <= 0.0)).any():
            at_once = rows & (extent <= 0.0)
            actor.target_offset[at_once] = (goal * actor.direction)[at_once]
            actor.path_compensated[at_once] = self.compensated
            run.one_by_one(
                actor,
                at_once,
                (),
                lambda entity, _: entity.controls.motion.advance(entity, 0.0, run.dt),
            )
            run.roads.stay_arrays(actor, at_once)
            return rows & ~at_once
        return rows.copy()

    def step(self, dt: float) -> BoolArray:
        """Ask for the shape's offset at the end of the step, limited to what the entity's motion
        reaches."""
        actor, done = self._actor, np.zeros_like(self.active)
        rows = np.flatnonzero(self.active & self._run.going)
        direction, extent = actor.direction[rows], self._extent[rows]
        way, left = np.abs(actor.speed[rows]) * dt, actor.kept_offset[rows] * direction
        moved = np.abs(left - self._asked[rows]) > _SAME_PLACE
        if moved.any():
            eased = rows[moved & np.isnan(actor.target_offset[rows])]  # an Easing follows
            self._run.leave(np.isin(np.arange(len(done)), eased))
        if self._over_distance:
            self._past[rows] = actor.odometer[rows] - self._origin[rows] + way
        else:
            self._past[rows] += dt
        lasts = extent > 0.0
        progress = np.divide(self._past[rows], extent, out=np.ones_like(way), where=lasts)
        over = progress >= 1.0 - EPSILON
        shape = self._shape.values(np.minimum(progress, 1.0))
        start, goal = self._start[rows], self._goal[rows]
        offset = np.where(over, goal, start + (goal - start) * shape)
        bounded = np.minimum(np.maximum(offset, left - way), left + way)
        offset = np.where(lasts, bounded, offset)
        self._asked[rows] = offset
        actor.target_offset[rows] = offset * direction
        actor.path_compensated[rows] = self.compensated
        done[rows] = over & (offset == goal) & (not self._kept)
        return done

    def stop(self, rows: BoolArray) -> None:
        """Have the entity keep to the lane that it is on."""
        self._run.roads.stay_arrays(self._actor, rows)


class _LaneChangeArrays(_Sideways):
    """A LaneChangeAction of an actor in many runs."""

    compensated = True

    def __init__(self, action: LaneChangeAction, actor: EntityRows, run: ArrayRun) -> None:
        super().__init__(actor, run, action.dynamics.shape)
        self._action = action
        self._over_distance = action.dynamics.dimension == "distance"

    def start(self, rows: BoolArray) -> BoolArray:
        """Express the entity's place in the target lane, and begin to move there."""
        action, actor, run = self._action, self._actor, self._run
        self._aim(action, rows)
        offset = run.value(action.offset)
        change = (offset - actor.kept_offset) * actor.direction
        extent = action.dynamics.extent_arrays(change, run.value(action.dynamics.value))
        return self._begin(rows, offset * actor.direction, extent)


class _Shifting(_Sideways):
    """A LaneOffsetAction of an actor in many runs."""

    compensated = False

    def __init__(self, action: LaneOffsetAction, actor: EntityRows, run: ArrayRun) -> None:
        super().__init__(actor, run, action.shape)
        self._action, self._kept = action, action.continuous

    def start(self, rows: BoolArray) -> BoolArray:
        """Begin to move sideways."""
        action, actor, run = self._action, self._actor, self._run
        self._aim(action, rows)
        value = run.value(action.value)
        goal = (-value if action.to_right else value * actor.direction) * np.ones(run.n)
        return self._begin(
            rows, goal, action.durations(goal - actor.kept_offset * actor.direction, run)
        )


class _GoalKeeping(Running):
    """A transition to a goal that may move, and that is then kept."""

    __slots__ = ("_goal", "_reference", "_transition")

    def __init__(
        self, transition: _LateralTransition, goal: Callable[[], float], reference: Entity | None
    ) -> None:
        self._transition = transition
        self._goal = goal
        self._reference = reference

    def follows(self) -> Entity | None:
        """The entity that the offset is relative to."""
        return self._reference

    def step(self, dt: float) -> bool:
        """Move on, or keep."""
        self._transition.goal = self._goal()
        self._transition.step(dt)
        return False

    def stop(self) -> None:
        """Stop the motion and leave the entity where it is, as after any lateral motion."""
        self._transition.stop()
