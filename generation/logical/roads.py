"""The roads of the library, and what OpenLABEL's ontology has for them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from xodr import builders
from xodr.builders import RoadMap
from xosc import tags
from xosc.tags import ASAM, Tag


@dataclass(frozen=True)
class LibraryRoad:
    """A road file of the library.

    Attributes:
        build: makes the map.
        description: its geometry.
        types: classes of OpenLABEL's ontology.
    """

    build: Callable[[], RoadMap]
    description: str
    types: tuple[str, ...]

    @property
    def tags(self) -> list[Tag]:
        """Its tags."""
        return [*(Tag(each, None, ASAM) for each in self.types), Tag("RoadGeometry", self.description)]


_MOTORWAY = ("RoadTypeMotorway", "HorizontalStraights")
_CROSSROAD = ("HorizontalStraights", "IntersectionCrossroad", "JunctionIntersection", "RoadTypeMinor")
_T_JUNCTION = ("HorizontalStraights", "IntersectionTJunction", "JunctionIntersection", "RoadTypeMinor")

ROADS = {
    "highway_straight": LibraryRoad(builders.straight_highway, "straight motorway", _MOTORWAY),
    "highway_on_ramp": LibraryRoad(
        partial(builders.on_ramp, acceleration=850.0, upstream=100.0, downstream=600.0),
        "motorway with an on-ramp", (*_MOTORWAY, "RoadTypeSlip"),
    ),
    "highway_off_ramp": LibraryRoad(
        partial(builders.off_ramp, upstream=900.0, deceleration=400.0, ramp=500.0, downstream=800.0),
        "motorway with an off-ramp", (*_MOTORWAY, "RoadTypeSlip"),
    ),
    "sharp_curve": LibraryRoad(
        partial(builders.sharp_curve, radius=80.0, lanes=2, approach=280.0, speed_limit=70 / 3.6),
        "sharp curve", ("HorizontalCurves", "RoadTypeMinor"),
    ),
    "narrow_road": LibraryRoad(
        partial(builders.narrow_road, lanes=2, lane_width=2.75, length=700.0),
        "narrow road", ("HorizontalStraights", "RoadTypeMinor"),
    ),
    "intersection_four_way": LibraryRoad(builders.four_way_intersection, "four-way intersection", _CROSSROAD),
    "intersection_four_way_two_lanes": LibraryRoad(
        partial(builders.four_way_intersection, lanes=2, arm=400.0), "four-way intersection of two-lane roads", _CROSSROAD
    ),
    "t_junction_two_lanes": LibraryRoad(
        partial(builders.t_junction, lanes=2, arm=400.0), "T junction of two-lane roads", _T_JUNCTION
    ),
    "roundabout": LibraryRoad(
        partial(builders.roundabout, arm=400.0), "roundabout", ("JunctionRoundabout", "RoadTypeMinor", "RoundaboutNormal")
    ),
}  # fmt: skip
"""By the names of their files in `xodr/library`."""


def write_roads(folder: Path, annotator: str) -> list[Path]:
    """Write all of them, each with its OpenLABEL tags beside; their paths."""
    written = []
    for name, road in ROADS.items():
        path, beside = road.build().write(folder / f"{name}.xodr"), folder / f"{name}.openlabel.json"
        beside.write_bytes(tags.to_bytes(road.tags, path.name, annotator))
        written += [path, beside]
    return written
