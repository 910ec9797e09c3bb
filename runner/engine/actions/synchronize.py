"""SynchronizeAction: reach a position at the same time as a master entity reaches another one.

The master's arrival time is that of its present speed. The profile to the target is planned anew at
every step from the present state, so that it follows the master's changes of speed; while the
master holds its speed, the plan is the same at every step. Of all speed profiles that cover the way
in the time, it is that with the smallest greatest acceleration: one stretch of acceleration a and
one of −a (or the other way round), or, where even that would mean driving backwards, a stop with a
wait. To arrive in time is the action's purpose, so no Performance bounds it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from runner.engine.actions.speed import RELATIVE
from runner.engine.compile.element import LONGITUDINAL, PrivateAction, need_places
from runner.engine.compile.protocols import Rest, Running
from runner.engine.compile.registry import action
from runner.engine.motion.placement import Placement
from runner.engine.participants.entity import Entity
from runner.engine.positions.lane import travel_s
from xosc.document.node import Node

if TYPE_CHECKING:
    from runner.engine.compile.protocols import Run
    from runner.engine.compile.registry import Context

_STEP_TOLERANCE = 0.1
"""Way (m) to a target that counts as none, beside that of a step"""
_STILL = 1e-6
"""Speed (m/s) below which an entity is taken to stand."""


class SteadyState(NamedTuple):
    """Phase of constant final speed before the target: length in m, or duration in s."""

    distance: float = 0.0
    time: float = 0.0


@dataclass(frozen=True, slots=True)
class FinalSpeed:
    """FinalSpeed: absolute, or relative to the master's; and the steady state before the target."""

    value: float
    relation: str
    steady: SteadyState

    @classmethod
    def from_xml(cls, node: Node) -> FinalSpeed:
        """Read the child of a FinalSpeed element."""
        speed = node.only()
        relation = (
            speed.choice("speedTargetValueType", RELATIVE)
            if speed.tag == "RelativeSpeedToMaster"
            else ""
        )
        return cls(speed.finite("value"), relation, _read_steady(speed))

    def speed(self, master: Entity) -> float:
        """The final speed as of now, m/s; synchronised entities do not drive backwards."""
        return max(
            RELATIVE[self.relation](master.speed, self.value) if self.relation else self.value, 0.0
        )


def _read_steady(node: Node) -> SteadyState:
    length, time = node.find("TargetDistanceSteadyState"), node.find("TargetTimeSteadyState")
    steady = SteadyState(
        length.finite("distance") if length else 0.0, time.finite("time") if time else 0.0
    )
    if min(steady) < 0.0:
        raise node.invalid("the steady state must not be negative")
    return steady


@action("SynchronizeAction")
@dataclass(frozen=True, slots=True)
class SynchronizeAction(PrivateAction):
    """Times an entity's arrival at its target by a master's arrival at another one, optionally at a
    final speed.

    It ends when either has arrived, within its tolerance. Both move along the way that they are on:
    lane and route, or trajectory.
    """

    domains: ClassVar[tuple[str, ...]] = (LONGITUDINAL,)
    run_by_run: ClassVar[bool] = True

    node: Node
    master: Entity
    master_target: Any
    target: Any
    master_tolerance: float
    tolerance: float
    final: FinalSpeed | None

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> SynchronizeAction:
        """Build from a SynchronizeAction element."""
        final = node.find("FinalSpeed")
        tolerances = node.finite("targetToleranceMaster", 0.0), node.finite("targetTolerance", 0.0)
        if min(tolerances) < 0.0:
            raise node.invalid("tolerances must not be negative")
        return cls(
            node,
            context.entity(node, "masterEntityRef"),
            context.position(node.need("TargetPositionMaster")),
            context.position(node.need("TargetPosition")),
            *tolerances,
            FinalSpeed.from_xml(final) if final is not None and final.children() else None,
        )

    def references(self) -> Iterable[Entity]:
        """The master, and entities that the targets are relative to."""
        return (self.master, *self.master_target.references(), *self.target.references())

    def start(self, actor: Entity, run: Run) -> Running:
        """Begin; a target that is not on its entity's way yet is looked for again at every step."""
        need_places(self.node, actor, self.master)
        ways = (
            _WayAhead(self.master, self.master_target.resolve(run, self.master), run),
            _WayAhead(actor, self.target.resolve(run, actor), run),
        )
        for way in ways:
            if way.left is None:
                run.note(
                    "synchronise",
                    way.entity.name,
                    "its target position is not on the way that it follows yet",
                )
        return _Synchronisation(self, actor, run, *ways)


class _WayAhead:
    """Way (m) that is left to a target on the way that an entity is on.

    Where that leads round, a target that is behind when the action starts lies ahead by the rest of
    the lap, more than half of which hides it from distances by the shorter way.

    Attributes:
        left: way to the target, m; negative once passed, None where there is no way.
    """

    __slots__ = ("_lap", "_target", "entity", "left")

    def __init__(self, entity: Entity, target: Placement, run: Run) -> None:
        self.entity, self._target = entity, target
        self.left = entity.controls.motion.distance_to(entity, target)
        self._lap = 0.0
        if self.left is not None and self.left < -_STEP_TOLERANCE:
            self._lap = _lap(entity, target, self.left, run)
            self.left += self._lap

    def update(self, dt: float) -> float | None:
        """Measure anew, after a step (s)."""
        left = self.entity.controls.motion.distance_to(self.entity, self._target)
        if left is not None and self._lap and self.left is not None:
            expected = self.left - abs(self.entity.speed) * dt
            left += self._lap if expected - left > 0.5 * self._lap else 0.0
        self.left = left
        return left


def _lap(entity: Entity, target: Placement, left: float, run: Run) -> float:
    """Length (m) of the closed way that leads an entity to a target; 0 where its way does not lead
    round to that."""
    network, here = run.roads.network, run.roads.road_point(entity)
    if network is None or here is None or not entity.on_lane or entity.speed < 0.0:
        return 0.0
    there = target.point or network.locate(target.x, target.y, target.z)
    path = network.route([here, there])
    if path is None:
        return 0.0
    route = entity.controls.route
    choose = route.foresee if route is not None else network.straightest
    reached, _, rest = travel_s(network, here, entity.direction * path.length, choose)
    apart = network.relative(reached, there)
    leads = not rest and apart is not None and abs(apart.ds) < _STEP_TOLERANCE
    return path.length - left if leads else 0.0


class _Synchronisation(Running):
    """Drive to the target; the speed stays while no way leads there, as for an
    entity off its road.
    """

    __slots__ = ("_action", "_actor", "_left", "_master_way", "_own_way", "_run")

    def __init__(
        self,
        action: SynchronizeAction,
        actor: Entity,
        run: Run,
        master_way: _WayAhead,
        way: _WayAhead,
    ) -> None:
        self._action = action
        self._actor = actor
        self._run = run
        self._master_way = master_way
        self._own_way = way
        self._left = math.inf, math.inf

    def rest(self) -> Rest:
        """Both at their targets: what is left is the longer way (m) beyond a step of driving."""
        own, other = (max(left, 0.0) for left in self._left)
        reached = (
            f"{own:.2f} m before its target, with {other:.2f} m left to {self._action.master.name}"
            if max(own, other) < math.inf
            else "no place from which ways lead to both"
        )
        return Rest("both at their targets", reached, max(own, other), _STEP_TOLERANCE + self._way)

    @property
    def _way(self) -> float:
        """Way (m) of the faster of the two in a step."""
        return max(abs(self._actor.speed), abs(self._action.master.speed)) * self._run.dt

    def follows(self) -> Entity | None:
        """The master."""
        return self._action.master

    def step(self, dt: float) -> bool:
        """Ask for the planned speed at the end of the step."""
        action, actor, master = self._action, self._actor, self._action.master
        left, master_left = self._own_way.update(dt), self._master_way.update(dt)
        if left is None or master_left is None or not master.active:
            return False
        left, master_left = left - action.tolerance, master_left - action.master_tolerance
        self._left = left, master_left
        arrived = left <= 0.0 or master_left <= 0.0
        time = master_left / abs(master.speed) if abs(master.speed) > _STILL else math.inf
        if action.final is None:
            actor.controls.target_speed = (
                actor.speed if arrived else free_speed(actor.speed, left, time, dt)
            )
            return arrived
        final, steady = action.final.speed(master), action.final.steady
        way = left - max(steady.distance, steady.time * final)
        hold = max(steady.time, steady.distance / final if final > 0.0 else 0.0)
        actor.controls.target_speed = (
            final if arrived else planned_speed(actor.speed, final, way, time - hold, dt)
        )
        return arrived


def free_speed(speed: float, way: float, time: float, dt: float) -> float:
    """Speed (m/s) after dt (s) on the way (m) to be covered in a time (s), with a free speed at its
    end.

    The acceleration is constant; where that would end in driving backwards, the entity stops before
    the target.
    """
    if time <= dt:
        return speed
    if speed * time > 2.0 * way:
        return max(speed - 0.5 * speed * speed / way * dt, 0.0)
    return max(speed + 2.0 * (way - speed * time) / (time * time) * dt, 0.0)


def planned_speed(speed: float, final: float, way: float, time: float, dt: float) -> float:
    """Speed (m/s) after dt (s) on the way (m) to be covered in a time (s), ending at the speed
    `final`.

    With D = way − (speed + final)/2 · time, the distance that a linear profile lacks, and Δ = final
    − speed, the smallest greatest acceleration is a = (2 D ± √(4 D² + time² Δ²)) / time², with the
    sign of D; it changes its sign after (time + Δ/a)/2. A turning speed below zero means to stop,
    wait, and leave again, each at (speed² + final²) / (2 way).
    """
    if way <= 0.0 or time <= dt:
        return final
    change, lacking = final - speed, way - 0.5 * (speed + final) * time
    if lacking == 0.0 or time == math.inf:
        rate = change / time
    else:
        rate = (
            2.0 * lacking + math.copysign(math.hypot(2.0 * lacking, time * change), lacking)
        ) / (time * time)
    if time == math.inf or speed + final + rate * time < 0.0:
        braking = (speed * speed + final * final) / (2.0 * way)
        return max(speed - braking * dt, 0.0)
    turn = 0.5 * (time + change / rate) if rate else time
    return speed + rate * (dt if turn >= dt else 2.0 * max(turn, 0.0) - dt)
