"""Orientations of positions, and places on the surface of a road.

Orientation (OpenSCENARIO XML 1.3, class Orientation): angles are absolute (world frame) or relative to a reference
direction. Absent angles are 0, an absent type is relative (absolute before version 1.2), an absent element means the
reference direction itself. The reference is the lane's direction of traffic for lane positions, the +s direction for road
positions, the direction of travel for routes, the tangent for trajectories, and the entity's orientation for positions
relative to its pose.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from runner.motion.placement import Placement, facing, tilted, wrap

if TYPE_CHECKING:
    from runner.contracts.context import Context
    from xodr.model import RoadPoint
    from xodr.network import RoadNetwork
    from xosc.node import Node


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
    along = None if orientation.absolute else reference if math.cos(reference - pose.h) >= 0.0 else reference - math.pi
    return facing(Placement(pose.x, pose.y, pose.z, h, pitch, roll), network.road(point.road_id), point, along)
