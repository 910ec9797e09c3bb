"""Geographic positions, by the projection that the road network names."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING

from runner.contracts import registry
from runner.contracts.position import FixedPosition
from runner.motion.placement import Placement
from runner.positions.orientation import Orientation, on_road

if TYPE_CHECKING:
    from runner.contracts.context import Context
    from xodr.lookup.geo import GeoReference
    from xodr.network import RoadNetwork
    from xosc.node import Node

_SKY = 1e5
"""A height (m) above every road, to find the topmost of several."""


@lru_cache(maxsize=8)
def _projection(network: RoadNetwork) -> GeoReference:
    from xodr.lookup.geo import GeoReference

    return GeoReference(network)


@registry.position("GeoPosition")
class GeoPosition(FixedPosition):
    """Latitude and longitude (WGS 84), in degrees (`latitudeDeg`, `longitudeDeg`) or radians (`latitude`, `longitude`, 1.1).

    `altitude` (m) is above the surface of the topmost road there, `height` (1.1) above the projection's zero level.
    Relative orientations count from the road's +s direction, off road from the world's x axis.
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
            raise node.unsupported("only the topmost road (verticalRoadSelection 0) can be selected")
        latitude, longitude = _angle(node, "latitude", 90.0), _angle(node, "longitude", 180.0)
        x, y, height = _projection(network).to_world(Geodetic(latitude, longitude, node.finite("height", 0.0)))
        if not (math.isfinite(x) and math.isfinite(y)):
            raise node.invalid("the position is outside the area of the road network's map projection")
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
