"""Roads as arrays, for plots, replays and everything that looks at many places at once."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from xodr.array_types import FloatArray
from xodr.road import Road

Points = FloatArray
"""World coordinates: one row x, y, z [m] for each place."""


def sample(road: Road, s: ArrayLike, t: ArrayLike = 0.0) -> Points:
    """World coordinates of many (s, t); the two are broadcast against each other."""
    at_s, at_t = (values.ravel().tolist() for values in np.broadcast_arrays(np.asarray(s, float), np.asarray(t, float)))
    return np.array([road.pose(*place)[:3] for place in zip(at_s, at_t, strict=True)], float).reshape(-1, 3)


def stations(road: Road, longest: float = 5.0) -> FloatArray:
    """s [m] from 0 to the road's length: denser where the line bends, never further apart than `longest`."""
    knots = {0.0, road.length, *(section.s for section in road.sections), *road.line.knots()}
    inside = sorted(s for s in knots if 0.0 <= s <= road.length)
    pieces = [np.linspace(a, b, int(np.ceil((b - a) / longest)), endpoint=False) for a, b in pairwise(inside)]
    return np.append(np.concatenate(pieces), road.length)


def lane_borders(road: Road, longest: float = 5.0) -> list[tuple[int, Points, Points]]:
    """For every lane of every section its id and its inner and outer border as polylines."""
    everywhere = stations(road, longest)
    borders = []
    for section in road.sections:
        inside = [section.s, *(s for s in everywhere.tolist() if section.s < s < section.end), section.end]
        for lane_id in (*section.left, *section.right):
            lane = section.lanes[lane_id]
            inner, outer = (sample(road, inside, [side(s) for s in inside]) for side in (lane.inner, lane.outer))
            borders.append((lane_id, inner, outer))
    return borders
