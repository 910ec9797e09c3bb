"""Ways through junctions, as the tables name them."""

from __future__ import annotations

from typing import NamedTuple


class Lane(NamedTuple):
    """A lane of an arm: road and lane id."""

    road: str
    lane: int


class Course(NamedTuple):
    """A way of a vehicle: from a lane that leads to the junction to one that leads away from it."""

    origin: Lane
    target: Lane


class Crossing(NamedTuple):
    """A way of a pedestrian: across an arm, from the right of the lane that leads away on it, `s` (m) from the junction."""

    lane: Lane
    s: float
