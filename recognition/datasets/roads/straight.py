"""The straight road that the lateral positions of a recording along the x axis show: for NGSIM tables, which have no map.

Lanes are where the data set's own lane ids have their middle, or, without such ids, where most vehicles drive; borders lie half
way between. Lane 7 of NGSIM's motorways is the on-ramp and lane 8 the off-ramp (FHWA, "NGSIM Vehicle Trajectories", 2016).
"""

from __future__ import annotations

import math

import numpy as np

from runner.recording import Recording
from schemas.errors import UsageError
from xodr.array_types import FloatArray, IntArray
from xodr.builders.curves import Pose, line
from xodr.builders.elements import Cubic, Lane, Road, RoadMap, Section

_STRAIGHT = 0.95
"""Least share of the way that goes within `_ALONG` of the x axis."""
_ALONG = math.radians(20.0)
_MOVING = 1.0
_NEAREST = 2.5
"""Lanes whose middles are less than this apart (m) are one."""
_BIN, _SMOOTH = 0.1, 0.5
_LEAST_SHARE = 0.02
"""Least height of a peak over the highest, for it to be a lane."""
_USUAL_WIDTH = 3.66
_ROUND = 10.0
_KINDS = {7: "onRamp", 8: "offRamp"}


def straight_road(recording: Recording, name: str) -> RoadMap:
    """A one-way road in the direction of x with the lanes that a recording shows.

    Raises:
        UsageError: the recording does not go straight along x, or is empty.
    """
    columns = [track.columns for track in recording.tracks.values()]
    x, y, h, speed = (np.concatenate([np.zeros(0), *(one[key] for one in columns)]) for key in ("x", "y", "h", "speed"))
    moving = speed > _MOVING
    if not moving.any() or np.average(np.abs(h[moving]) < _ALONG, weights=speed[moving]) < _STRAIGHT:
        raise UsageError(f"no file has the roads of {name}, and its traffic does not go straight along x")
    numbers = [one["source_lane"] for one in columns if "source_lane" in one]
    middles = _numbered(y, np.concatenate(numbers)) if len(numbers) == len(columns) else _densest(y)
    start, end = _ROUND * math.floor(x.min() / _ROUND), _ROUND * math.ceil(x.max() / _ROUND) + _ROUND
    return _road(name, start, end, middles)


def _numbered(y: FloatArray, number: IntArray) -> dict[float, str]:
    """Middle of each lane from left to right with its type; of lanes at the same place the one with most rows counts."""
    lanes, counts = np.unique(number, return_counts=True)
    kept: dict[float, str] = {}
    for index in np.argsort(-counts, kind="stable").tolist():
        middle = float(np.median(y[number == lanes[index]]))
        if all(abs(middle - other) >= _NEAREST for other in kept):
            kept[middle] = _KINDS.get(int(lanes[index]), "driving")
    return dict(sorted(kept.items(), reverse=True))


def _densest(y: FloatArray) -> dict[float, str]:
    """Lateral positions with most vehicles, from left to right."""
    from scipy.ndimage import gaussian_filter1d
    from scipy.signal import find_peaks

    edges = np.arange(y.min() - 4.0 * _SMOOTH, y.max() + 4.0 * _SMOOTH + _BIN, _BIN)
    density = gaussian_filter1d(np.histogram(y, edges)[0].astype(np.float64), _SMOOTH / _BIN)
    peaks, _ = find_peaks(density, distance=max(1, round(_NEAREST / _BIN)), prominence=_LEAST_SHARE * density.max())
    return {float(edges[peak] + 0.5 * _BIN): "driving" for peak in peaks[::-1].tolist()}


def _road(name: str, start: float, end: float, middles: dict[float, str]) -> RoadMap:
    centres = np.array(list(middles))
    between = 0.5 * (centres[:-1] + centres[1:])
    half = 0.5 * (float(np.median(-np.diff(centres))) if len(centres) > 1 else _USUAL_WIDTH)
    borders = [centres[0] + half, *between.tolist(), centres[-1] - half]
    lanes = {
        -number: Lane(
            kind, (Cubic(0.0, borders[number - 1] - borders[number]),), mark="broken" if number < len(centres) else "solid"
        )
        for number, kind in enumerate(middles.values(), 1)
    }
    section = Section(0.0, lanes, "solid")
    road = Road(1, name, Pose(start, float(borders[0]), 0.0), (line(end - start),), (section,), "motorway", math.inf)
    return RoadMap(name, (road,))
