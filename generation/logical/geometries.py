"""Roads that the logical scenarios take place on, and the speeds and gaps that suit them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

from generation.logical.courses import Course, Lane
from generation.logical.roads import ROADS, LibraryRoad

Limits = tuple[float, float]


@dataclass(frozen=True)
class Geometry:
    """A road with two neighbouring lanes, and the place where manoeuvres begin.

    It is long enough for all values of the parameters.

    Attributes:
        file: name of the road's file in `xodr/library`.
        description: where that is.
        road, left, right: the road's id, and those of the two lanes as their traffic sees them.
        spot: s (m) of the leader when the manoeuvre begins; of a manoeuvre's end where `ends_there`.
        side: +1 where the lanes lead towards increasing s, −1 where against.
        turn: the course of a right turn from the right lane; None without a junction.
        speeds, gaps: limits of the parameters, m/s and m; as wide as recordings are, where the road is long enough.
        ego_speed, gap: defaults.
    """

    file: str
    description: str
    road: str
    left: int
    right: int
    spot: float
    side: int = 1
    ends_there: bool = False
    turn: Course | None = None
    speeds: Limits = (10.0, 40.0)
    gaps: Limits = (0.5, 80.0)
    ego_speed: float = 30.0
    gap: float = 20.0

    @property
    def map(self) -> LibraryRoad:
        """The road file."""
        return ROADS[self.file]

    @property
    def is_motorway(self) -> bool:
        """Whether it is a motorway; labelling rules take all others for town."""
        return "RoadTypeMotorway" in self.map.types


_straight = partial(Geometry, "highway_straight", "on a straight motorway", "1", -1, -2, speeds=(5.0, 42.0))
_rural = partial(Geometry, speeds=(5.0, 20.0), gaps=(0.5, 60.0), ego_speed=17.0, gap=13.0)
_urban = partial(Geometry, speeds=(4.0, 15.0), gaps=(0.5, 40.0), ego_speed=12.0, gap=10.0)
_arm = partial(_urban, road="3", left=1, right=2, spot=5.0, side=-1, ends_there=True, turn=Course(Lane("3", 2), Lane("4", -2)))

GEOMETRIES = {
    "highway": _straight(spot=650.0, gaps=(0.5, 150.0)),
    "free_highway": _straight(spot=750.0, gaps=(170.0, 300.0), gap=200.0),
    "on_ramp": Geometry("highway_on_ramp", "on a motorway where an on-ramp joins", "2", -2, -3, 500.0),
    "off_ramp": Geometry("highway_off_ramp", "on a motorway before an off-ramp", "1", -2, -3, 980.0),
    "exit_lane": Geometry("highway_off_ramp", "on a motorway before an off-ramp", "1", -2, -3, 1070.0),
    "sharp_curve": _rural("sharp_curve", "in a sharp curve", "1", -1, -2, 280.0),
    "narrow_road": _urban("narrow_road", "on a narrow road", "1", -1, -2, 250.0),
    "four_way_intersection": _arm("intersection_four_way_two_lanes", "before an intersection"),
    "t_junction": _arm("t_junction_two_lanes", "before a T junction"),
}
"""Geometries by name; the first five are motorways, of which most manoeuvres need only the first."""
