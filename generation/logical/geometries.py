"""Roads that the logical scenarios take place on, and the speeds and gaps that suit them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from xodr import builders
from xodr.builders import RoadMap

Limits = tuple[float, float]


@dataclass(frozen=True)
class Geometry:
    """A road with two neighbouring lanes, and the place where manoeuvres begin.

    It is long enough for all values of the parameters.

    Attributes:
        build: makes the map.
        file: its name in `xodr/library`.
        words: where that is.
        road, left, right: the road's id, and those of the two lanes as their traffic sees them.
        spot: s (m) of the leader when the manoeuvre begins; of a manoeuvre's end where `ends_there`.
        side: +1 where the lanes lead towards increasing s, −1 where against.
        turn: road and lane that a right turn from the right lane leads to; None where there is none.
        speeds, gaps: limits of the parameters, m/s and m.
        ego_speed, gap: defaults.
    """

    build: Callable[[], RoadMap]
    file: str
    words: str
    road: str
    left: int
    right: int
    spot: float
    side: int = 1
    ends_there: bool = False
    turn: tuple[str, int] | None = None
    speeds: Limits = (10.0, 40.0)
    gaps: Limits = (5.0, 80.0)
    ego_speed: float = 30.0
    gap: float = 20.0


_rural = partial(Geometry, speeds=(5.0, 20.0), gaps=(5.0, 60.0), ego_speed=17.0, gap=15.0)
_urban = partial(Geometry, speeds=(4.0, 15.0), gaps=(3.0, 40.0), ego_speed=12.0, gap=10.0)
_arm = partial(_urban, road="3", left=1, right=2, spot=5.0, side=-1, ends_there=True, turn=("4", -2))

GEOMETRIES = {
    "highway": Geometry(builders.straight_highway, "highway_straight", "on a straight motorway", "1", -1, -2, 500.0),
    "on_ramp": Geometry(
        partial(builders.on_ramp, acceleration=850.0, upstream=100.0, downstream=600.0),
        "highway_on_ramp", "on a motorway where an on-ramp joins", "2", -2, -3, 500.0,
    ),
    "off_ramp": Geometry(
        partial(builders.off_ramp, upstream=900.0, deceleration=400.0, ramp=500.0, downstream=800.0),
        "highway_off_ramp", "on a motorway before an off-ramp", "1", -2, -3, 980.0,
    ),
    "sharp_curve": _rural(
        partial(builders.sharp_curve, radius=80.0, lanes=2, approach=280.0, speed_limit=70 / 3.6),
        "sharp_curve", "in a sharp curve", "1", -1, -2, 280.0,
    ),
    "narrow_road": _urban(
        partial(builders.narrow_road, lanes=2, lane_width=2.75, length=700.0),
        "narrow_road", "on a narrow road", "1", -1, -2, 250.0,
    ),
    "four_way_intersection": _arm(
        partial(builders.four_way_intersection, lanes=2, arm=400.0), "intersection_four_way_two_lanes", "before an intersection"
    ),
    "t_junction": _arm(partial(builders.t_junction, lanes=2, arm=400.0), "t_junction_two_lanes", "before a T junction"),
}  # fmt: skip
"""Geometries by name; ramps belong to the highway, and only merging and diverging need them."""
