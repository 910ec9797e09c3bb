"""The road of a site as pictures, drawn once, from which the grids take what lies about an ego."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from recognition.grids.config import Grid
from xodr.array_types import FloatArray
from xodr.graph.ways import DRIVABLE
from xodr.lookup.sampling import lane_borders
from xodr.network import RoadNetwork
from xodr.road import Road

Singles = NDArray[np.float32]
_PIXEL = 0.5
"""Edge of a pixel, m."""
_LARGEST = 20_000
"""Most pixels along one edge of a picture: 10 km."""


@dataclass(frozen=True)
class Picture:
    """Drivable area and lane borders of a site: uint8 (rows, columns, 2), of which pixel (0, 0) begins at x, y (m).

    A pixel's values are the shares of the cell around it that are area and border, 0 to 255.
    """

    pixels: NDArray[np.uint8]
    x: float
    y: float

    def at(self, x: Singles, y: Singles) -> NDArray[np.uint8]:
        """Both values, in a last axis, of places x, y (m) from the picture's beginning; 0 outside of the picture."""
        rows, columns, _ = self.pixels.shape
        column, row = (np.clip(place * (1.0 / _PIXEL), 0, last - 1).astype(np.int32) for place, last in ((x, columns), (y, rows)))
        both = self.pixels.reshape(-1, 2).view(np.uint16)[row * columns + column]  # one look-up for the two
        return both.view(np.uint8)


@lru_cache(maxsize=8)
def picture(network: RoadNetwork, cell: float) -> Picture:
    """Draw the drivable lanes of a road network, smoothed over the size of a cell (m)."""
    from scipy.ndimage import uniform_filter

    lanes = [lane for road in network.roads.values() for lane in _lanes(road)]
    corners = np.concatenate([line for lane in lanes for line in lane]) if lanes else np.zeros((1, 2))
    margin = 2.0 * cell + 2.0 * _PIXEL  # empty, also after smoothing: positions outside are clipped to it
    low, high = corners.min(axis=0) - margin, corners.max(axis=0) + margin
    columns, rows = np.minimum(np.ceil((high - low) / _PIXEL), _LARGEST).astype(int)
    planes = np.zeros((2, rows, columns), np.uint8)
    for inner, outer in lanes:
        share = np.linspace(0.0, 1.0, 2 + int(1.5 * np.abs(outer - inner).max() / _PIXEL))[:, None, None]
        _draw(planes[0], (1.0 - share) * inner + share * outer, low)
        _draw(planes[1], np.stack([inner, outer]), low)
    size = max(1, round(cell / _PIXEL))
    smooth = np.stack([uniform_filter(plane, size, mode="constant") for plane in planes], axis=-1)
    return Picture(smooth, float(low[0]), float(low[1]))


def _lanes(road: Road) -> list[tuple[FloatArray, FloatArray]]:
    """Inner and outer borders of the drivable lanes, at places that are less than a pixel apart: (n, 2) each."""
    sections = [section.lanes[lane_id] for section in road.sections for lane_id in (*section.left, *section.right)]
    return [
        _refined(inner[:, :2], outer[:, :2])
        for lane, (_, inner, outer) in zip(sections, lane_borders(road, 2.0), strict=True)
        if lane.type in DRIVABLE
    ]


def _refined(inner: FloatArray, outer: FloatArray) -> tuple[FloatArray, FloatArray]:
    steps = [np.hypot(*np.diff(line, axis=0).T) for line in (inner, outer)]
    count = 2 + int(1.5 * max(step.sum() for step in steps) / _PIXEL)
    given = np.concatenate([[0.0], np.cumsum(np.maximum(*steps))])
    stations = np.linspace(0.0, given[-1], count)
    first, second = (np.stack([np.interp(stations, given, line[:, k]) for k in (0, 1)], axis=1) for line in (inner, outer))
    return first, second


def _draw(plane: NDArray[np.uint8], points: FloatArray, low: FloatArray) -> None:
    column, row = (((points[..., k] - low[k]) / _PIXEL).astype(np.int64) for k in (0, 1))
    inside = (row < plane.shape[0]) & (column < plane.shape[1])
    plane[row[inside], column[inside]] = 255


def cell_centres(grid: Grid) -> tuple[Singles, Singles]:
    """Coordinates of the cells' centres, ahead and to the left of the ego (m): shape rows × columns each."""
    rows, columns = grid.cells
    along = (np.arange(columns) + 0.5) * grid.cell_length - 0.5 * grid.length + grid.ahead
    left = 0.5 * grid.width - (np.arange(rows) + 0.5) * grid.cell_width
    across, ahead = np.meshgrid(left.astype(np.float32), along.astype(np.float32), indexing="ij")
    return ahead, across
