"""Builders for the maps of the field: each returns a `RoadMap` that writes itself as OpenDRIVE 1.7.

`straight_highway`, `on_ramp`, `off_ramp`, `sharp_curve`, `narrow_road`, `four_way_intersection`,
`t_junction` and `roundabout`. Lengths in m, speeds in m/s, angles in rad; `rule` is RHT or LHT;
descriptions and lane ids are those of right-hand traffic, the left-hand map is its mirror image
with the signs of all lane ids changed. The same arguments give the same bytes.

Modules:

- `elements`: designs of roads: pieces of their reference lines, lanes by width
- `intersections`: four-way intersection, T junction and roundabout
- `roads_and_ramps`: single roads, motorway ramps, lane layouts

Example::

    roundabout().write("roundabout.xodr")
"""

from xodr.builders.elements import RoadMap
from xodr.builders.intersections import four_way_intersection, roundabout, t_junction
from xodr.builders.roads_and_ramps import (
    narrow_road,
    off_ramp,
    on_ramp,
    sharp_curve,
    straight_highway,
)

__all__ = [
    "RoadMap",
    "four_way_intersection",
    "narrow_road",
    "off_ramp",
    "on_ramp",
    "roundabout",
    "sharp_curve",
    "straight_highway",
    "t_junction",
]
