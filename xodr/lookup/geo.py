"""Geographic coordinates: latitude and longitude to the world of a road network, and back.

OpenDRIVE 1.8 §8.5: the header's offset turns and shifts local coordinates into those of the
projection in `geoReference`.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import NamedTuple

from schemas.common.errors import InvalidFile, Unsupported
from xodr.graph.network import RoadNetwork


class Geodetic(NamedTuple):
    """A place on Earth (WGS 84): latitude and longitude in degrees, altitude in metres."""

    latitude: float
    longitude: float
    altitude: float


_OF_HEIGHTS = ("geoidgrids", "vunits", "vto_meter")
"""Parameters of PROJ that concern heights, which are taken as they are"""
_NUMBERED = re.compile(
    r"\+?init=(epsg|esri):(\d+)(?:\s+\+?(?:no_defs|type=crs|wktext))*", re.IGNORECASE
)
_READS_FILES = re.compile(
    r"grids|init\s*=|file|pipeline|\bstep\b|shift|catalog|deformation|defmodel|tinshift",
    re.IGNORECASE,
)
"""Parts of a projection that name files, in any of PROJ's languages"""


def without_files(projection: str, path: Path) -> str:
    """Projection without names of files: PROJ would read any file as grid or definition.

    Grids of heights are left out, since heights are taken as they are; `init=epsg:N` is the code
    EPSG:N.

    Args:
        path: the road network's file, for errors.

    Raises:
        Unsupported: the projection needs a file.
    """
    # To PROJ, init=epsg:N is a line of a file of definitions.
    numbered = _NUMBERED.fullmatch(projection.strip())
    if numbered:
        return f"{numbered[1].upper()}:{numbered[2]}"
    if projection.lstrip().startswith("+"):
        names = {term: term.lstrip("+").partition("=")[0] for term in projection.split()}
        # @null is the name for no grid at all.
        projection = " ".join(
            term for term in names if names[term] not in _OF_HEIGHTS and term != "+nadgrids=@null"
        )
    named = _READS_FILES.search(projection)
    if named:
        reason = (
            f"the geoReference reads files ({named[0]}), which is refused: state the projection "
            "by numbers or a code"
        )
        raise Unsupported(reason, path=path, element="geoReference")
    return projection


class GeoReference:
    """The map projection of one road network.

    Attributes:
        crs: the projection, as pyproj has it.

    Raises:
        Unsupported: the network has no geoReference.
        InvalidFile: PROJ does not understand it.
    """

    def __init__(self, network: RoadNetwork) -> None:
        import pyproj  # takes a tenth of a second, and few scenarios need it

        projection = network.geo_reference
        if projection is None:
            raise Unsupported(
                "geographic positions need a geoReference in the road network",
                path=network.path,
                element="header",
            )
        try:
            crs = pyproj.CRS.from_user_input(without_files(projection, network.path))
            self.crs = crs
            # Longitude first, whichever order the projection's own definition has.
            self._transformer = pyproj.Transformer.from_crs("EPSG:4326", crs, always_xy=True)
        except pyproj.exceptions.ProjError as error:
            message = f"geoReference {projection!r} is not understood: {error}"
            raise InvalidFile(message, path=network.path, element="header") from None
        self._x, self._y, self._z, heading = network.header.offset
        self._cos, self._sin = math.cos(heading), math.sin(heading)

    def to_world(self, place: Geodetic) -> tuple[float, float, float]:
        """World coordinates x, y, z [m] of a place; not finite where the projection does not reach
        it."""
        easting, northing = self._transformer.transform(place.longitude, place.latitude)
        # The header's offset turns and shifts map coordinates into the projection (OpenDRIVE 1.9,
        # 8.5); this is the way back.
        dx, dy = easting - self._x, northing - self._y
        return (
            self._cos * dx + self._sin * dy,
            self._cos * dy - self._sin * dx,
            place.altitude - self._z,
        )

    def to_geodetic(self, x: float, y: float, z: float = 0.0) -> Geodetic:
        """Place on Earth of world coordinates (m); not finite where the projection does not reach
        it."""
        easting = self._x + self._cos * x - self._sin * y
        northing = self._y + self._sin * x + self._cos * y
        longitude, latitude = self._transformer.transform(easting, northing, direction="INVERSE")
        return Geodetic(latitude, longitude, z + self._z)
