"""Positions in the world frame, and relative to an entity's pose."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from runner.contracts import registry
from runner.contracts.position import FixedPosition, Position
from runner.motion.placement import Placement
from runner.motion.surface import in_world
from runner.positions.orientation import Orientation
from xodr.model import Pose

if TYPE_CHECKING:
    from runner.contracts.context import Context
    from runner.contracts.run import Surroundings
    from runner.participants.entity import Entity
    from xosc.node import Node


@registry.position("WorldPosition")
class WorldPosition(FixedPosition):
    """x, y, z, h, p, r in the world; without z on the surface of the road there, without angles 0."""

    def __init__(self, node: Node, placement: Placement) -> None:
        super().__init__(node, placement)
        self.oriented = node.has("h")
        self.grounded = not node.has("z")

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> WorldPosition:
        """Read the attributes."""
        pose = Pose(node.finite("x"), node.finite("y"), *(node.finite(name, 0.0) for name in ("z", "h", "p", "r")))
        return cls(node, in_world(context.network, pose, z_known=node.has("z")))


class _RelativePosition(Position):
    """Base of the positions relative to an entity's pose; their orientation is relative to the entity's."""

    def __init__(self, node: Node, context: Context) -> None:
        super().__init__(node)
        self.entity = context.entity(node)
        self.dx, self.dy, self.dz = node.finite("dx"), node.finite("dy"), node.finite("dz", 0.0)
        self.orientation = Orientation.from_xml(node, context)
        self.grounded = False

    def references(self) -> tuple[Entity, ...]:
        """The entity referred to."""
        return (self.entity,)

    def _placement(self, run: Surroundings | None, x: float, y: float) -> Placement:
        entity, orientation = self.entity, self.orientation
        h = orientation.heading(entity.h)
        pitch, roll = orientation.pitch, orientation.roll
        if not orientation.absolute:
            pitch, roll = pitch + entity.pitch, roll + entity.roll
        pose = Pose(x, y, entity.z + self.dz, h, pitch, roll)
        return in_world(run.roads.network if run else None, pose, hint=run.roads.road_point(entity) if run else None)


@registry.position("RelativeWorldPosition")
class RelativeWorldPosition(_RelativePosition):
    """dx, dy, dz along the world's axes from an entity's reference point."""

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> RelativeWorldPosition:
        """Read the attributes."""
        return cls(node, context)

    def resolve(self, run: Surroundings | None, actor: Entity | None = None) -> Placement:
        """Where that is now."""
        entity = self.current(self.entity)
        return self._placement(run, entity.x + self.dx, entity.y + self.dy)


@registry.position("RelativeObjectPosition")
class RelativeObjectPosition(_RelativePosition):
    """dx forward, dy to the left and dz upward in an entity's own frame, from its reference point."""

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> RelativeObjectPosition:
        """Read the attributes."""
        return cls(node, context)

    def resolve(self, run: Surroundings | None, actor: Entity | None = None) -> Placement:
        """Where that is now."""
        entity = self.current(self.entity)
        c, s = math.cos(entity.h), math.sin(entity.h)
        return self._placement(run, entity.x + c * self.dx - s * self.dy, entity.y + s * self.dx + c * self.dy)
