"""What all position kinds share: orientations, and world poses with the road under them.

Orientation (OpenSCENARIO XML 1.3, class Orientation): angles are absolute (world frame) or relative to a reference
direction. Absent angles are 0, an absent type is relative (absolute before version 1.2), an absent element means the
reference direction itself. The reference is the lane's direction of traffic for lane positions, the +s direction for road
positions, the direction of travel for routes, the tangent for trajectories, and the entity's orientation for positions
relative to its pose.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, NamedTuple

from runner.motion.placement import Placement, wrap
from xodr.model import Pose, RoadPoint

if TYPE_CHECKING:
    from runner.interpreter.compiler import Context
    from runner.interpreter.simulation import Simulation
    from runner.participants.entity import Entity
    from xodr.network import RoadNetwork
    from xodr.road import Road
    from xosc.node import Node

_ACROSS = 1e-6
"""Angle (rad) within which a heading counts as across the road."""
_OTHER_LEVEL = 2.0
"""Height (m) above or below a road's surface from which a pose has nothing to do with that road."""


class Position(ABC):
    """A position of the standard.

    Attributes:
        node: its element, for complaints.
        fixed: where it is, for positions that are the same throughout every run.
        oriented: whether the file prescribes an orientation.
        grounded: whether the height is that of the road's surface.
    """

    def __init__(self, node: Node) -> None:
        self.node = node
        self.fixed: Placement | None = None
        self.oriented = node.find("Orientation") is not None
        self.grounded = True

    @abstractmethod
    def resolve(self, sim: Simulation | None, actor: Entity | None = None) -> Placement:
        """Where it is now.

        Args:
            sim: the running simulation; positions with `fixed` need none.
            actor: the entity concerned, for shapes that begin where it is.

        Raises:
            InvalidFile: there is no such place at the moment: with the line of the position's element.
        """

    def references(self) -> tuple[Entity, ...]:
        """Entities whose place must be known before this position can be resolved."""
        return ()

    def current(self, entity: Entity) -> Entity:
        """The entity referred to, once it has a place."""
        if not entity.placed:
            raise self.node.invalid(f"the position is relative to {entity.name!r}, which has no position yet")
        return entity


class FixedPosition(Position):
    """A position that does not depend on anything that happens."""

    fixed: Placement

    def __init__(self, node: Node, placement: Placement) -> None:
        super().__init__(node)
        self.fixed = placement

    def resolve(self, sim: Simulation | None, actor: Entity | None = None) -> Placement:
        """The place."""
        return self.fixed


class Orientation(NamedTuple):
    """Angles (rad), absolute or relative to a reference direction."""

    h: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0
    absolute: bool = False

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> Orientation:
        """The Orientation of a position's element."""
        orientation = node.find("Orientation")
        if orientation is None:
            return cls()
        h, pitch, roll = (wrap(orientation.finite(name, 0.0)) for name in ("h", "p", "r"))
        usual = "absolute" if context.version < (1, 2) else "relative"
        return cls(h, pitch, roll, orientation.choice("type", ("absolute", "relative"), usual) == "absolute")

    def heading(self, reference: float) -> float:
        """World heading, given that of the reference direction (rad)."""
        return self.h if self.absolute else reference + self.h


def network_of(node: Node, context: Context) -> RoadNetwork:
    """The road network, for positions that make no sense without one."""
    if context.network is None:
        raise node.invalid("the position needs a road network, but the scenario has no RoadNetwork/LogicFile")
    return context.network


def tilted(pose: Pose, h: float) -> tuple[float, float]:
    """Pitch and roll (rad) of something that stands on a surface and faces h, given the pose along the road."""
    if not (pose.pitch or pose.roll):
        return 0.0, 0.0
    turn = h - pose.h
    cos, sin = math.cos(turn), math.sin(turn)
    return pose.pitch * cos - pose.roll * sin, pose.pitch * sin + pose.roll * cos


def surface(network: RoadNetwork, point: RoadPoint, h: float) -> tuple[float, float, float]:
    """z (m), pitch and roll (rad) of something that stands on the road at a point and faces h."""
    pose = network.pose(point)
    return pose.z, *tilted(pose, h)


def on_road(network: RoadNetwork, point: RoadPoint, reference: float, orientation: Orientation) -> Placement:
    """A placement on the road's surface.

    Args:
        point: where.
        reference: heading that relative orientations count from, rad.
    """
    pose = network.pose(point)
    h = orientation.heading(reference)
    pitch, roll = tilted(pose, h)
    if not orientation.absolute:  # on roads the surface decides; angles of the file come on top (a fallen pedestrian)
        pitch, roll = pitch + orientation.pitch, roll + orientation.roll
    else:
        pitch, roll = orientation.pitch or pitch, orientation.roll or roll
    return facing(Placement(pose.x, pose.y, pose.z, h, pitch, roll), network.road(point.road_id), point)


def facing(placement: Placement, road: Road, point: RoadPoint) -> Placement:
    """The placement tied to a road point, with `along` and `heading_offset` as its heading says.

    Whoever stands across the road faces the way that the lane's traffic drives.
    """
    heading = road.heading(point.s)
    along = road.direction(point.lane_id, point.s) if point.lane_id else 1
    turn = wrap(placement.h - heading - (0.0 if along > 0 else math.pi))
    if abs(turn) > math.pi / 2 + _ACROSS:
        along, turn = -along, wrap(turn + math.pi)
    return placement._replace(point=point, along=along, heading_offset=turn)


def in_world(network: RoadNetwork | None, pose: Pose, z_known: bool = True, hint: RoadPoint | None = None) -> Placement:
    """A placement at a world pose, tied to the road under it where there is one.

    Args:
        pose: where; its z counts where `z_known`, else z, pitch and roll are the surface's.
        hint: a road point close by.
    """
    placement = Placement(*pose)
    if network is None:
        return placement
    point = network.locate(pose.x, pose.y, pose.z if z_known else None, pose.h, hint)
    if not network.on_road(point):
        return placement
    surface = network.pose(point)
    if not z_known:
        pitch, roll = tilted(surface, pose.h)
        placement = placement._replace(z=surface.z, pitch=pose.pitch or pitch, roll=pose.roll or roll)
    elif abs(surface.z - pose.z) > _OTHER_LEVEL:
        return placement
    return facing(placement, network.road(point.road_id), point)
