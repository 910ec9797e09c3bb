"""SpeedAction."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from runner.actions.base import LONGITUDINAL, PrivateAction, Running
from runner.dynamics import EPSILON, TransitionDynamics, within
from runner.entities import Entity, Performance
from runner.registry import action
from xosc.node import Node

if TYPE_CHECKING:
    from runner.scenario import Context
    from runner.simulation import Simulation

RELATIVE: dict[str, Callable[[float, float], float]] = {
    "delta": lambda speed, value: speed + value,
    "factor": lambda speed, value: speed * value,
}
"""SpeedTargetValueType → the target speed (m/s), from the reference's speed and the value."""


@action("SpeedAction")
@dataclass(frozen=True, slots=True)
class SpeedAction(PrivateAction):
    """Brings an entity to a speed, absolute or relative to another entity's.

    A relative target is the reference's speed at the action's start, or, where `continuous`, its speed at any time;
    the action then never ends by itself. followingMode `follow` keeps within the entity's Performance, `position`
    (the default) keeps to the shape.
    """

    domains: ClassVar[tuple[str, ...]] = (LONGITUDINAL,)

    dynamics: TransitionDynamics
    value: float
    reference: Entity | None
    relation: str
    continuous: bool

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> SpeedAction:
        """Build from a SpeedAction element."""
        dynamics = TransitionDynamics.from_xml(node.need("SpeedActionDynamics"))
        target = node.need("SpeedActionTarget").only()
        value = target.finite("value")
        if target.tag == "AbsoluteTargetSpeed":
            return cls(dynamics, value, None, "", False)
        relation = target.choice("speedTargetValueType", RELATIVE)
        return cls(dynamics, value, context.entity(target), relation, target.bool("continuous"))

    def references(self) -> Iterable[Entity]:
        """The entity whose speed the target is relative to."""
        return (self.reference,) if self.reference is not None else ()

    def target(self) -> float:
        """Target speed now, m/s."""
        if self.reference is None:
            return self.value
        return RELATIVE[self.relation](self.reference.speed, self.value)

    def start(self, actor: Entity, sim: Simulation) -> Running | None:
        """Begin; a change that takes no time is complete at once."""
        target = self.target()
        duration = self.dynamics.speed_duration(actor.speed, target)
        limits = None if self.dynamics.strict else actor.performance
        if self.continuous:
            if sim.initialising and duration <= 0.0:
                set_speed(actor, target, sim)
            return _Tracking(self, actor, duration, limits)
        if duration <= 0.0 and (limits is None or sim.initialising):
            set_speed(actor, target, sim)
            return None
        return _Transition(actor, target, duration, self.dynamics, limits)


def set_speed(actor: Entity, speed: float, sim: Simulation) -> None:
    """Have the entity drive at a speed (m/s) from the coming step on; an initial action sets its state as well."""
    actor.demand = speed
    if sim.initialising:
        actor.speed = speed


class _Transition:
    """On the way to a target speed along a shape."""

    __slots__ = ("_actor", "_change", "_duration", "_elapsed", "_limits", "_start", "_target", "_value")

    def __init__(
        self, actor: Entity, target: float, duration: float, dynamics: TransitionDynamics, limits: Performance | None
    ) -> None:
        self._actor = actor
        self._start = actor.speed
        self._target = target
        self._change = target - actor.speed
        self._duration = duration
        self._value = dynamics.shape.value
        self._limits = limits
        self._elapsed = 0.0

    def step(self, dt: float) -> bool:
        """Ask for the profile's speed at the end of the step."""
        self._elapsed += dt
        actor = self._actor
        progress = self._elapsed / self._duration if self._duration > 0.0 else 1.0
        done = progress >= 1.0 - EPSILON
        wanted = self._target if done else self._start + self._change * self._value(progress)
        if self._limits is None:
            actor.demand = wanted
            return done
        actor.demand = within(actor.speed, wanted, self._limits, dt)
        return done and (actor.demand == wanted or abs(actor.demand) >= self._limits.max_speed)

    def stop(self) -> None:
        """The entity keeps the speed that it has."""


class _Tracking:
    """Towards, and then at, a speed that follows another entity's.

    With a rate, the demand moves by at most that rate; with a time or distance, the shape blends into the moving
    target, which is then kept exactly.
    """

    __slots__ = ("_action", "_actor", "_duration", "_elapsed", "_limits", "_start")

    def __init__(self, action: SpeedAction, actor: Entity, duration: float, limits: Performance | None) -> None:
        self._action = action
        self._actor = actor
        self._start = actor.speed
        self._duration = duration
        self._limits = limits
        self._elapsed = 0.0

    def step(self, dt: float) -> bool:
        """Ask for the target's speed as far as it may be reached."""
        self._elapsed += dt
        wanted, dynamics, speed = self._action.target(), self._action.dynamics, self._actor.speed
        if dynamics.dimension == "rate" and dynamics.shape.slope > 0.0:
            reach = dynamics.value * dt
            wanted = min(max(wanted, speed - reach), speed + reach)
        elif self._elapsed < self._duration:
            share = dynamics.shape.value(self._elapsed / self._duration)
            wanted = self._start + (wanted - self._start) * share
        self._actor.demand = wanted if self._limits is None else within(speed, wanted, self._limits, dt)
        return False

    def stop(self) -> None:
        """The entity keeps the speed that it has."""
