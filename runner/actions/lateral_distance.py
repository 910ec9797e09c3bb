"""LateralDistanceAction: keep a distance to the left or right of another entity."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from runner.actions.lateral import follow_road, settle_lane
from runner.actions.longitudinal_distance import read_system
from runner.contracts.element import LATERAL, PrivateAction, need_places
from runner.contracts.registry import action
from runner.contracts.run import Running
from runner.motion.dynamics import GapController, read_constraints
from runner.motion.placement import wrap
from runner.participants.boxes import box_corners
from runner.participants.declaration import Performance
from runner.participants.entity import Entity
from runner.spacing import distances
from xosc.node import Node

if TYPE_CHECKING:
    from runner.contracts.registry import Context
    from runner.contracts.run import Run

_SIDES = {"leftToReferencedEntity": 1, "rightToReferencedEntity": -1, "any": 0}
_REACHED = 0.01
"""Error (m) below which a lateral distance counts as reached."""


@action("LateralDistanceAction")
@dataclass(frozen=True, slots=True)
class LateralDistanceAction(PrivateAction):
    """Keeps a lateral distance to a reference entity; without `distance`, the one that it has at the action's start.

    Where there is no road, it moves across the direction that it faces, which is that of the reference.
    Without DynamicConstraints the distance holds at once and rigidly; with them a controller within the limits moves
    the entity sideways. Where `continuous`, it never ends by itself. Sides are those of the reference.
    """

    domains: ClassVar[tuple[str, ...]] = (LATERAL,)

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
            raise node.invalid(f"distance={distance:g} must not be negative; displacement says on which side")
        return cls(
            node=node,
            reference=context.entity(node),
            distance=distance,
            freespace=node.bool("freespace"),
            system=read_system(node),
            side=_SIDES[node.choice("displacement", _SIDES, "any")],
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
        settle_lane(actor)
        return running if self.continuous else None


def _both_ways(limits: Performance | None) -> Performance | None:
    """Limits of lateral motion, where left and right are alike: the smaller of acceleration and deceleration."""
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
        self._controller = GapController(action.constraints) if action.constraints is not None else None
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
        return distances.lateral(self._run.roads, action.reference, self._actor, action.system, False)

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
        """Return the offset (m) to the actor's own left that is left to move; None if the distance is undefined."""
        left = self._left()
        if left is None or self._distance is None:
            return None
        error = self._side * (self._distance + self._cover()) - left
        return error if math.cos(self._actor.h - self._action.reference.h) >= 0.0 else -error

    def step(self, dt: float) -> bool:
        """Ask for the offset at the end of the step."""
        error, actor = self._error(), self._actor
        if error is None:
            return False
        step = error if self._controller is None else self._limited(self._controller, error, dt)
        if not actor.on_lane:
            actor.x, actor.y = actor.x - step * math.sin(actor.h), actor.y + step * math.cos(actor.h)
            h = self._action.reference.h
            actor.h = h if math.cos(actor.h - h) >= 0.0 else wrap(h + math.pi)
            return not self._action.continuous and abs(error) < _REACHED
        actor.controls.target_offset = actor.offset + actor.direction * step
        actor.controls.path_compensated = self._controller is not None
        return not self._action.continuous and abs(error) < _REACHED

    def _limited(self, controller: GapController, error: float, dt: float) -> float:
        """Sideways step (m) of a controlled motion; like a driver, it sees where the reference is, not what it is up to."""
        self._speed = controller.speed(error, self._speed, 0.0, dt)
        return self._speed * dt

    def stop(self) -> None:
        """The entity belongs to the lane that it is on."""
        settle_lane(self._actor)
