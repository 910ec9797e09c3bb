"""Projection of the coordinates of a map: to longitude, latitude and height, and back."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from schemas.common.array_types import FloatArray
from schemas.common.errors import UsageError
from xodr.formats.maps.lane_map import LaneMap
from xodr.lookup.geo import without_files


class Projector:
    """A projection with the offset of a map in it.

    Args:
        projection: PROJ string or code.
        offset: x, y, z (m) and heading (rad), as in OpenDRIVE's header.

    Raises:
        UsageError: PROJ does not understand the projection.
        Unsupported: it needs files.
    """

    def __init__(self, projection: str, offset: tuple[float, float, float, float]) -> None:
        import pyproj

        try:
            # What a map names, as grids of a projection, may not be read from this disk.
            crs = pyproj.CRS.from_user_input(without_files(projection, Path("map")))
            self._transformer = pyproj.Transformer.from_crs("EPSG:4326", crs, always_xy=True)
        except pyproj.exceptions.ProjError as error:
            raise UsageError(f"the projection {projection!r} is not understood: {error}") from None
        self._x, self._y, self._z, heading = offset
        self._cos, self._sin = math.cos(heading), math.sin(heading)

    @classmethod
    def of(cls, lane_map: LaneMap) -> Projector | None:
        """The projection of a map; None where it has none."""
        return (
            cls(lane_map.projection, lane_map.offset) if lane_map.projection is not None else None
        )

    def to_geodetic(self, line: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Longitude and latitude (degrees) and height (m) of points (n, 3)."""
        # OpenDRIVE's offset: first the turn, then the move.
        easting = self._x + self._cos * line[:, 0] - self._sin * line[:, 1]
        northing = self._y + self._sin * line[:, 0] + self._cos * line[:, 1]
        longitude, latitude = self._transformer.transform(easting, northing, direction="INVERSE")
        return np.asarray(longitude), np.asarray(latitude), line[:, 2] + self._z

    def to_map(self, line: FloatArray) -> FloatArray:
        """Coordinates (n, 3) of the map of longitudes, latitudes (degrees) and
        heights (m), (n, 3).
        """
        easting, northing = self._transformer.transform(line[:, 0], line[:, 1])
        dx, dy = np.asarray(easting) - self._x, np.asarray(northing) - self._y
        return np.column_stack(
            [self._cos * dx + self._sin * dy, self._cos * dy - self._sin * dx, line[:, 2] - self._z]
        )
