"""Orientations, and positions in the world frame, relative to an entity's pose, and geographic
ones.

Geographic positions are projected as the road network says (`geoReference`).

Orientation (OpenSCENARIO XML 1.3, class Orientation): angles are absolute (world frame) or relative
to a reference direction. Absent angles are 0, an absent type is relative (absolute before version
1.2), an absent element means the reference direction itself. The reference is the lane's direction
of traffic for lane positions, the +s direction for road positions, the direction of travel for
routes, the tangent for trajectories, and the entity's orientation for positions relative to its
pose.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

from runner.engine.compile import registry
from runner.engine.compile.element import FixedPosition, Position
from runner.engine.motion.placement import Placement, facing, in_world, tilted, wrap
from xodr.model import WorldPose

if TYPE_CHECKING:
    from runner.engine.compile.protocols import Surroundings
    from runner.engine.compile.registry import Context
    from runner.engine.participants.entity import Entity
    from xodr.graph.network import RoadNetwork
    from xodr.lookup.geo import GeoReference
    from xodr.model import RoadPoint
    from xosc.document.node import Node


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
        return cls(
            h,
            pitch,
            roll,
            orientation.choice("type", ("absolute", "relative"), usual) == "absolute",
        )

    def heading(self, reference: float) -> float:
        """World heading, given that of the reference direction (rad)."""
        return self.h if self.absolute else reference + self.h


def on_road(
    network: RoadNetwork, point: RoadPoint, reference: float, orientation: Orientation
) -> Placement:
    """A placement on the road's surface.

    Args:
        point: where.
        reference: heading that relative orientations count from, rad.
    """
    pose = network.pose(point)
    h = orientation.heading(reference)
    pitch, roll = tilted(pose, h)
    if (
        not orientation.absolute
    ):  # on roads the surface decides; angles of the file come on top (a fallen pedestrian)
        pitch, roll = pitch + orientation.pitch, roll + orientation.roll
    else:
        pitch, roll = orientation.pitch or pitch, orientation.roll or roll
    along = (
        None
        if orientation.absolute
        else reference
        if math.cos(reference - pose.h) >= 0.0
        else reference - math.pi
    )
    return facing(
        Placement(pose.x, pose.y, pose.z, h, pitch, roll), network.road(point.road_id), point, along
    )


@registry.position("WorldPosition")
class WorldPosition(FixedPosition):
    """x, y, z, h, p, r in the world; without z on the surface of the road there,
    without angles 0.
    """

    def __init__(self, node: Node, placement: Placement) -> None:
        super().__init__(node, placement)
        self.oriented = node.has("h")
        self.grounded = not node.has("z")

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> WorldPosition:
        """Read the attributes."""
        pose = WorldPose(
            node.finite("x"),
            node.finite("y"),
            *(node.finite(name, 0.0) for name in ("z", "h", "p", "r")),
        )
        network = context.network
        # Vertices of trajectories are poses alone: the search for their road is spared where it
        # changes no height.
        if network is not None and _is_vertex(node) and (node.has("z") or network.flat):
            network = None
        return cls(node, in_world(network, pose, z_known=node.has("z")))


def _is_vertex(node: Node) -> bool:
    """Whether a position is that of a vertex of a trajectory."""
    return next(node.element.iterancestors("Vertex"), None) is not None


class _RelativePosition(Position):
    """Base of the positions relative to an entity's pose; their orientation is relative to the
    entity's."""

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
        pose = WorldPose(x, y, entity.z + self.dz, h, pitch, roll)
        return in_world(
            run.roads.network if run else None,
            pose,
            hint=run.roads.road_point(entity) if run else None,
        )


@registry.position("RelativeWorldPosition")
class RelativeWorldPosition(_RelativePosition):
    """dx, dy, dz along the world's axes from an entity's reference point."""

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> RelativeWorldPosition:
        """Read the attributes."""
        return cls(node, context)

    def resolve(self, run: Surroundings | None, actor: Entity | None = None) -> Placement:
        """Return the current place."""
        entity = self.current(self.entity)
        return self._placement(run, entity.x + self.dx, entity.y + self.dy)


@registry.position("RelativeObjectPosition")
class RelativeObjectPosition(_RelativePosition):
    """dx forward, dy to the left and dz upward in an entity's own frame, from
    its reference point.
    """

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> RelativeObjectPosition:
        """Read the attributes."""
        return cls(node, context)

    def resolve(self, run: Surroundings | None, actor: Entity | None = None) -> Placement:
        """Return the current place."""
        entity = self.current(self.entity)
        c, s = math.cos(entity.h), math.sin(entity.h)
        return self._placement(
            run, entity.x + c * self.dx - s * self.dy, entity.y + s * self.dx + c * self.dy
        )


_SKY = 1e5
"""A height (m) above every road, to find the topmost of several."""


@lru_cache(maxsize=8)
def _projection(network: RoadNetwork) -> GeoReference:
    from xodr.lookup.geo import GeoReference

    return GeoReference(network)


@registry.position("GeoPosition")
class GeoPosition(FixedPosition):
    """Latitude and longitude (WGS 84), in degrees (`latitudeDeg`, `longitudeDeg`) or radians
    (`latitude`, `longitude`, 1.1).

    `altitude` (m) is above the surface of the topmost road there, `height` (1.1) above the
    projection's zero level. Relative orientations count from the road's +s direction, off road from
    the world's x axis.
    """

    def __init__(self, node: Node, placement: Placement) -> None:
        super().__init__(node, placement)
        self.grounded = not (node.has("height") or node.finite("altitude", 0.0))

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> GeoPosition:
        """Read the attributes and project them."""
        from xodr.lookup.geo import Geodetic

        network = context.need_network(node)
        if node.int("verticalRoadSelection", 0):
            raise node.unsupported(
                "only the topmost road (verticalRoadSelection 0) can be selected"
            )
        latitude, longitude = _angle(node, "latitude", 90.0), _angle(node, "longitude", 180.0)
        x, y, height = _projection(network).to_world(
            Geodetic(latitude, longitude, node.finite("height", 0.0))
        )
        if not (math.isfinite(x) and math.isfinite(y)):
            raise node.invalid(
                "the position is outside the area of the road network's map projection"
            )
        orientation, altitude = Orientation.from_xml(node, context), node.finite("altitude", 0.0)
        point = network.locate(x, y, height if node.has("height") else _SKY)
        if network.on_road(point):
            placement = on_road(network, point, network.pose(point).h, orientation)
            altitude += placement.z
        else:
            placement = Placement(x, y, 0.0, orientation.h, orientation.pitch, orientation.roll)
        return cls(node, placement._replace(z=height if node.has("height") else altitude))


def _angle(node: Node, name: str, limit: float) -> float:
    """Latitude or longitude in degrees."""
    degrees = node.finite(f"{name}Deg", None)
    if degrees is None:
        degrees = math.degrees(node.finite(name))
    if not -limit <= degrees <= limit:
        raise node.invalid(f"the {name} of {degrees:g}° is not between -{limit:g}° and {limit:g}°")
    return float(degrees)
