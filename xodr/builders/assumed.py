"""Roads of which nothing is known but what is used of them: straight ones, side by side, with the lanes that are asked for."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from xodr.builders.curves import Pose, line
from xodr.builders.elements import Road, RoadMap
from xodr.builders.lanes import for_traffic, require, two_way

_WIDTH, _SPEED_LIMIT = 3.5, 100 / 3.6
_APART = 200.0
"""Distance between the reference lines of two roads, m: nobody on one of them meets anybody on another."""


class RoadUse(NamedTuple):
    """What is used of a road: its length in m, and the number of lanes on its right and left side."""

    road_id: str
    length: float
    right: int
    left: int


def assumed_roads(used: Iterable[RoadUse], *, rule: str = "RHT") -> RoadMap:
    """A straight road for each that is used, not connected with each other.

    Args:
        used: each road once.
        rule: RHT or LHT.
    """
    roads = []
    for number, each in enumerate(used):
        require("length", each.length, 0.1)
        section = two_way(each.right, each.left, _WIDTH)
        start = Pose(0.0, -_APART * number, 0.0)
        name = f"assumed road {each.road_id}"
        roads.append(Road(each.road_id, name, start, (line(each.length),), (section,), "rural", _SPEED_LIMIT))
    return for_traffic(RoadMap("Assumed roads", tuple(roads)), rule)
