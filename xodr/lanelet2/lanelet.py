"""Lanelets: pieces of lanes between two bounds, whatever map format they come from."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
"""Points of a line, (n, 2), m."""


class Neighbour(NamedTuple):
    """A lanelet beside another one, and whether it leads the same way."""

    id: str
    same_direction: bool


@dataclass(frozen=True, eq=False)
class Lanelet:
    """A piece of a lane that leads from the first to the last points of its bounds.

    Attributes:
        left, right: its bounds, (n, 2) and (m, 2), m.
        predecessors, successors: lanelets before and after it; naming one of a pair is enough.
        beside_left, beside_right: neighbours that share a whole bound.
        type: lane type of OpenDRIVE, e.g. "driving", "biking", "sidewalk".
        road_type: road type of OpenDRIVE, e.g. "town", "rural", "motorway".
        speed_limit: in m/s, infinite for none.
        left_mark, right_mark: road marks of OpenDRIVE on the bounds.
    """

    id: str
    left: Points
    right: Points
    predecessors: tuple[str, ...] = ()
    successors: tuple[str, ...] = ()
    beside_left: Neighbour | None = None
    beside_right: Neighbour | None = None
    type: str = "driving"
    road_type: str = "town"
    speed_limit: float = 50 / 3.6
    left_mark: str = "none"
    right_mark: str = "none"


_OBLIQUE = 2.0
"""A lanelet's first or last points are taken for a piece of a bound where they lie this much more along than across it."""


def squared(lanelet: Lanelet) -> Lanelet:
    """The lanelet with the shorter bound led on to the other's end where the line between the two runs along the lanelet.

    That is how lanelets end that are drawn up to the side of another one: they then taper off.
    """
    left, right = lanelet.left, lanelet.right
    for place in (0, -1):
        ahead, aside = _obliqueness(left, right, place)
        if abs(ahead) > _OBLIQUE * abs(aside):
            shorter_left = (ahead > 0.0) == (place == -1)
            left, right = (_led_on(left, right, place), right) if shorter_left else (left, _led_on(right, left, place))
    return lanelet if left is lanelet.left and right is lanelet.right else replace(lanelet, left=left, right=right)


def _obliqueness(left: Points, right: Points, place: int) -> tuple[float, float]:
    """How far the right bound begins or ends ahead of the left one, and beside it, m."""
    step = sum(line[place] - line[1 if place == 0 else -2] for line in (left, right)) * (1 if place == -1 else -1)
    way = step / np.hypot(*step)
    dx, dy = right[place] - left[place]
    return float(dx * way[0] + dy * way[1]), float(dy * way[0] - dx * way[1])


def _led_on(line: Points, other: Points, place: int) -> Points:
    return np.concatenate([line, other[-1:]] if place == -1 else [other[:1], line])
