"""Positions: one class per position kind of the standard, each resolved to a `Placement` when it is asked for.

World, road and lane positions are the same whenever they are asked for; they are resolved, and checked against the road
network, when the scenario is compiled. The others depend on where entities are, and say what is wrong when they are asked for.
"""

from runner.contracts.position import Position
from runner.positions.geo import GeoPosition
from runner.positions.lane import LanePosition, RelativeLanePosition, RelativeRoadPosition, RoadPosition
from runner.positions.path import RoutePosition, TrajectoryPosition
from runner.positions.world import RelativeObjectPosition, RelativeWorldPosition, WorldPosition

__all__ = [
    "GeoPosition",
    "LanePosition",
    "Position",
    "RelativeLanePosition",
    "RelativeObjectPosition",
    "RelativeRoadPosition",
    "RelativeWorldPosition",
    "RoadPosition",
    "RoutePosition",
    "TrajectoryPosition",
    "WorldPosition",
]
