"""Where the recorder records: maps, traffic and how much of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import permutations
from typing import Literal, NamedTuple

from recognition.recorder.demand import Flow, Parking
from recognition.recorder.fleet import MOTORWAY, TOWN, Fleet
from recognition.recorder.maps import kerbside
from recognition.recorder.sensor import EXACT, Sensor
from xodr.builders import (
    RoadMap,
    four_way_intersection,
    narrow_road,
    off_ramp,
    on_ramp,
    roundabout,
    sharp_curve,
    straight_highway,
    t_junction,
)

Layout = Literal["highD", "INTERACTION"]


class View(NamedTuple):
    """What the camera sees, a rectangle of the map, m."""

    left: float
    bottom: float
    right: float
    top: float


@dataclass(frozen=True)
class Site:
    """A place with its usual traffic.

    Attributes:
        layout: format of its recordings. highD takes straight motorways along the x axis only.
        flows: traffic on an average day; each recording has some more or less of it.
        recordings, minutes: number of recordings and length of each at scale 1.
        parking: rows of vehicles that stand at the kerb.
        sensor: what records.
    """

    name: str
    layout: Layout
    road_map: Callable[[], RoadMap]
    view: View
    flows: tuple[Flow, ...]
    fleet: Fleet
    recordings: int
    minutes: float
    parking: tuple[Parking, ...] = ()
    sensor: Sensor = EXACT


def _motorway(name: str, lanes: int, limit: float, rate: float, recordings: int, minutes: float) -> Site:
    """Both carriageways of a straight motorway; the limit in km/h, the rate in vehicles per hour and direction."""
    build = partial(straight_highway, lanes=lanes, opposite_lanes=lanes, length=1400.0, speed_limit=limit / 3.6)
    flows = (Flow(("1", -1), ("1", -1), rate), Flow(("1", 2), ("1", 2), rate))
    return Site(name, "highD", build, View(400.0, -30.0, 1250.0, 40.0), flows, MOTORWAY, recordings, minutes)


def _street(
    name: str, build: Callable[[], RoadMap], view: View, rate: float, recordings: int, minutes: float,
    parking: tuple[Parking, ...] = (),
) -> Site:  # fmt: skip
    """A street through a town, with the rate of each direction."""
    flows = (Flow(("1", -1), ("1", -1), rate), Flow(("1", 1), ("1", 1), rate))
    return Site(name, "INTERACTION", build, view, flows, TOWN, recordings, minutes, parking)


def junction(
    name: str, build: Callable[[], RoadMap], reach: float, flows: dict[str, float], recordings: int, minutes: float
) -> Site:
    """Roads that lead away from a place; "12": 300 are 300 vehicles per hour from road 1 to road 2."""
    found = tuple(Flow((way[0], 1), (way[1], -1), rate) for way, rate in flows.items())
    return Site(name, "INTERACTION", build, View(-reach, -reach, reach, reach), found, TOWN, recordings, minutes)


def evenly(arms: str, rate: float) -> dict[str, float]:
    """The same traffic from each road, evenly to all others."""
    return {f"{here}{there}": rate / (len(arms) - 1) for here, there in permutations(arms, 2)}


def _ramp(name: str, build: Callable[[], RoadMap], flows: tuple[Flow, ...], recordings: int, minutes: float) -> Site:
    return Site(name, "INTERACTION", build, View(330.0, -60.0, 1200.0, 30.0), flows, MOTORWAY, recordings, minutes)


_ENTERING = (Flow(("1", -1), ("2", -1), 1500.0), Flow(("3", -1), ("2", -1), 800.0))
_EXITING = (Flow(("1", -1), ("2", -1), 2000.0), Flow(("1", -1), ("3", -1), 1000.0))
_KERB = tuple(Parking(("1", 2 * side), 235.0, 515.0, 14.0, ("1", side)) for side in (-1, 1))

SITES: dict[str, Site] = {
    site.name: site
    for site in (
        _motorway("motorway_sparse", 3, 130.0, 700.0, 12, 3.0),
        _motorway("motorway_two_lanes", 2, 120.0, 2400.0, 12, 3.0),
        _motorway("motorway_three_lanes", 3, 130.0, 4200.0, 12, 3.0),
        _ramp("on_ramp", partial(on_ramp, ramp=300.0), _ENTERING, 44, 5.0),
        _ramp("off_ramp", partial(off_ramp, ramp=300.0), _EXITING, 40, 5.0),
        _street(
            "arterial", partial(narrow_road, lanes=3, opposite_lanes=3, lane_width=3.25, length=700.0, speed_limit=50 / 3.6),
            View(120.0, -40.0, 580.0, 40.0), 2000.0, 20, 2.0,
        ),
        _street(
            "arterial_curve",
            partial(sharp_curve, radius=500.0, angle=0.7, lanes=2, opposite_lanes=2, approach=250.0, speed_limit=70 / 3.6),
            View(120.0, -40.0, 660.0, 250.0), 1300.0, 20, 2.0,
        ),
        _street(
            "kerbside", partial(kerbside, lanes=1, kerb=300.0, speed_limit=70 / 3.6),
            View(120.0, -40.0, 630.0, 40.0), 700.0, 375, 1.0, _KERB,
        ),
        junction("roundabout", roundabout, 120.0, evenly("1234", 350.0), 22, 2.5),
        junction("roundabout_five_arms", partial(roundabout, arms=5, radius=22.0), 120.0, evenly("12345", 300.0), 22, 2.5),
        junction("crossing", four_way_intersection, 120.0, evenly("1234", 300.0), 90, 4.0),
        junction(
            "t_junction", t_junction, 120.0, {"31": 700.0, "41": 350.0, "13": 200.0, "14": 60.0, "34": 60.0, "43": 60.0}, 80, 6.0
        ),
    )
}  # fmt: skip
"""By name."""
