"""The coordinates of a Lanelet2 map: those of the tracks that were recorded on it.

As in Lanelet2 and INTERACTION, x and y are those of the UTM zone of an origin, minus those of the origin itself. Maps whose
nodes have the tags local_x and local_y bring their coordinates along.
"""

from __future__ import annotations

import math

from schemas.errors import InvalidFile, UsageError
from xodr.builders.elements import Geo
from xodr.lanelet2.reading.osm import Osm

LARGEST = 1e7
"""Farthest coordinate that is believed, m."""


class Projection:
    """From the nodes of a map to x, y [m].

    Args:
        osm: the map.
        origin: latitude and longitude of the origin, degrees. Where none is given, local coordinates are taken where every
            node has them, else the origin of INTERACTION is, 0, 0.

    Attributes:
        geo: what the road map says of it, None for local coordinates.

    Raises:
        UsageError: the origin is no place on Earth.
        InvalidFile: some nodes have neither kind of coordinates.
    """

    def __init__(self, osm: Osm, origin: tuple[float, float] | None) -> None:
        self.local = origin is None and all(node.local is not None for node in osm.nodes.values())
        latitude, longitude = origin or (0.0, 0.0)
        if not (abs(latitude) <= 84.0 and abs(longitude) <= 180.0):
            raise UsageError(f"the origin ({latitude:g}, {longitude:g}) has no UTM zone")
        self.geo = None if self.local else _geo(latitude, longitude)

    def points(self, osm: Osm) -> dict[str, tuple[float, float]]:
        """x and y of every node by its id, m.

        Raises:
            InvalidFile: a node has no such coordinates, or is too far away.
        """
        if self.geo is None:
            points = {name: node.local for name, node in osm.nodes.items() if node.local is not None}
        else:
            points = _projected(osm, self.geo)
        for name, (x, y) in points.items():
            if not abs(x) + abs(y) < LARGEST:
                raise InvalidFile("it is too far away from the map's origin", line=osm.nodes[name].line, element=f"node {name}")
        return points


def utm_zone(longitude: float) -> int:
    """The UTM zone of a longitude, degrees."""
    return int((longitude + 180.0) // 6.0) % 60 + 1


def _geo(latitude: float, longitude: float) -> Geo:
    import pyproj

    projection = f"+proj=utm +zone={utm_zone(longitude)} {'+south ' if latitude < 0.0 else ''}+ellps=WGS84 +units=m +no_defs"
    easting, northing = pyproj.Proj(projection)(longitude, latitude)
    return Geo(projection, (easting, northing))


def _projected(osm: Osm, geo: Geo) -> dict[str, tuple[float, float]]:
    import pyproj

    names, places = [], []
    for name, node in osm.nodes.items():
        if node.place is None:
            raise InvalidFile("it has no lat and lon", line=node.line, element=f"node {name}")
        names.append(name)
        places.append(node.place)
    latitudes, longitudes = zip(*places, strict=True) if places else ((), ())
    eastings, northings = pyproj.Proj(geo.projection)(longitudes, latitudes)
    x0, y0 = geo.origin
    found = {name: (x - x0, y - y0) for name, x, y in zip(names, eastings, northings, strict=True)}
    return {name: point if math.isfinite(sum(point)) else (math.inf, math.inf) for name, point in found.items()}
