"""Lanelets: pieces of lanes between two bounds, whatever map format they come from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from xodr.array_types import FloatArray

Points = FloatArray
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
        lights: names of the traffic lights at its end.
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
    lights: tuple[str, ...] = ()
