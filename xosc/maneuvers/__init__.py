"""Typed builders of scenarios and catalogues, on scenariogeneration.

They return scenariogeneration's objects (`Any`: it carries no types), so that whatever it can build besides can be mixed in;
`scenario` and `catalog` make documents of them, valid by the official XSD of the version asked for.
"""

from xosc.files import Header
from xosc.maneuvers.actions import (
    STEP,
    Dynamics,
    Reaction,
    add_entity,
    assign_route,
    delete_entity,
    event,
    follow_path,
    follow_trajectory,
    keep_distance,
    lane_change,
    lane_position,
    maneuver,
    relative_lane_position,
    route,
    speed,
    speed_profile,
    teleport,
    trajectory,
    trajectory_position,
    world_position,
)
from xosc.maneuvers.base import Number
from xosc.maneuvers.entities import controller, obstacle, parameter, pedestrian, reference, vehicle
from xosc.maneuvers.files import CATALOG_KINDS, catalog, scenario, storyboard, trajectory_catalog
from xosc.maneuvers.forms import Form, extended
from xosc.maneuvers.triggers import (
    Condition,
    Conditions,
    collision,
    distance,
    element_state,
    relative_distance,
    simulation_time,
    time_headway,
    time_to_collision,
)

__all__ = [
    "CATALOG_KINDS",
    "STEP",
    "Condition",
    "Conditions",
    "Dynamics",
    "Form",
    "Header",
    "Number",
    "Reaction",
    "add_entity",
    "assign_route",
    "catalog",
    "collision",
    "controller",
    "delete_entity",
    "distance",
    "element_state",
    "event",
    "extended",
    "follow_path",
    "follow_trajectory",
    "keep_distance",
    "lane_change",
    "lane_position",
    "maneuver",
    "obstacle",
    "parameter",
    "pedestrian",
    "reference",
    "relative_distance",
    "relative_lane_position",
    "route",
    "scenario",
    "simulation_time",
    "speed",
    "speed_profile",
    "storyboard",
    "teleport",
    "time_headway",
    "time_to_collision",
    "trajectory",
    "trajectory_catalog",
    "trajectory_position",
    "vehicle",
    "world_position",
]
