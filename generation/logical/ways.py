"""Where ways through junctions meet."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from generation.logical.courses import Course, Crossing
from schemas.errors import UsageError
from xodr.array_types import FloatArray
from xodr.network import RoadNetwork

_STEP, _REACH = 0.1, 120.0
"""Distance of the points of ways, and how far they are looked at, m."""
_SAME = 1.0
"""Ways that come closer than this meet, m."""

Points = FloatArray


class Meeting(NamedTuple):
    """Where two ways meet.

    Attributes:
        x, y: place, m.
        ego, other: how far that is from where each one's arm ends, along its way, m; 0 for pedestrians.
    """

    x: float
    y: float
    ego: float
    other: float


def meeting(network: RoadNetwork, ego: Course, other: Course | Crossing) -> Meeting:
    """The first place where the ego's way meets another one.

    Raises:
        UsageError: they do not meet.
    """
    mine = _points(network, ego)
    theirs = _across(network, other) if isinstance(other, Crossing) else _points(network, other)
    apart = np.hypot(mine[:, None, 0] - theirs[:, 0], mine[:, None, 1] - theirs[:, 1])
    near = np.flatnonzero(apart.min(axis=1) < _SAME)
    if not len(near):
        raise UsageError(f"the ways {ego} and {other} do not meet")
    row = int(near[0] + apart[near[0] : near[0] + round(2 * _SAME / _STEP)].min(axis=1).argmin())
    x, y = mine[row].tolist()
    along = 0.0 if isinstance(other, Crossing) else _STEP * float(apart[row].argmin())
    return Meeting(round(x, 3), round(y, 3), round(_STEP * row, 1), round(along, 1))


def _points(network: RoadNetwork, course: Course) -> Points:
    """x and y (n, 2) along a course from where its arm ends."""
    start, end = (network.lane_point(road, lane, 0.0) for road, lane in course)
    path = network.route([start, end])
    if path is None:
        raise UsageError(f"no way leads along {course}")
    distances = _STEP * np.arange(round(_REACH / _STEP))
    poses = [network.pose(network.travel(start, distance, False, path.choose).point) for distance in distances.tolist()]
    return np.array([(pose.x, pose.y) for pose in poses])


def _across(network: RoadNetwork, crossing: Crossing) -> Points:
    """x and y (1, 2) of the middle of the lane that a pedestrian crosses."""
    pose = network.pose(network.lane_point(*crossing.lane, crossing.s))
    return np.array([(pose.x, pose.y)])
