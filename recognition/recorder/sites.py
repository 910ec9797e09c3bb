"""Where the recorder records: maps, traffic and how much of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import permutations
from typing import Literal, NamedTuple

from recognition.recorder.demand import Flow, Lane
from recognition.recorder.fleet import MOTORWAY, TOWN, Fleet
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
    """

    name: str
    layout: Layout
    road_map: Callable[[], RoadMap]
    view: View
    flows: tuple[Flow, ...]
    fleet: Fleet
    recordings: int
    minutes: float


def _motorway(name: str, lanes: int, limit: float, rate: float, recordings: int, minutes: float) -> Site:
    """Both carriageways of a straight motorway; the limit in km/h, the rate in vehicles per hour and direction."""
    build = partial(straight_highway, lanes=lanes, opposite_lanes=lanes, length=1400.0, speed_limit=limit / 3.6)
    flows = (Flow(("1", -1), ("1", -1), rate), Flow(("1", 2), ("1", 2), rate))
    return Site(name, "highD", build, View(400.0, -30.0, 1250.0, 40.0), flows, MOTORWAY, recordings, minutes)


def _arterial(name: str, build: Callable[[], RoadMap], view: View, rate: float, recordings: int, minutes: float) -> Site:
    """A road with several lanes each way through a town."""
    flows = (Flow(("1", -1), ("1", -1), rate), Flow(("1", 1), ("1", 1), rate))
    return Site(name, "INTERACTION", build, view, flows, TOWN, recordings, minutes)


def _crossing(
    name: str, build: Callable[[], RoadMap], reach: float, arms: dict[str, float], recordings: int, minutes: float
) -> Site:
    """Roads that lead away from a place, with the rate at which vehicles come from each; they go evenly to the others."""

    def way(here: str, there: str) -> tuple[Lane, Lane]:
        return (here, 1), (there, -1)

    flows = tuple(
        Flow(*way(here, there), arms[here] * arms[there] / (sum(arms.values()) - arms[here]))
        for here, there in permutations(arms, 2)
    )
    return Site(name, "INTERACTION", build, View(-reach, -reach, reach, reach), flows, TOWN, recordings, minutes)


def _named(name: str, build: Callable[[], RoadMap]) -> RoadMap:
    return replace(build(), name=name)


def _ramp(name: str, build: Callable[[], RoadMap], view: View, flows: tuple[Flow, ...], recordings: int, minutes: float) -> Site:
    return Site(name, "INTERACTION", build, view, flows, MOTORWAY, recordings, minutes)


_IN = (Flow(("1", -1), ("2", -1), 2000.0), Flow(("3", -1), ("2", -1), 600.0))
_OUT = (Flow(("1", -1), ("2", -1), 2000.0), Flow(("1", -1), ("3", -1), 600.0))

SITES: dict[str, Site] = {
    site.name: site
    for site in (
        _motorway("motorway_sparse", 3, 130.0, 700.0, 20, 5.0),
        _motorway("motorway_two_lanes", 2, 120.0, 2400.0, 20, 5.0),
        _motorway("motorway_three_lanes", 3, 130.0, 4200.0, 20, 5.0),
        _ramp("on_ramp", partial(on_ramp, lanes=2, ramp=300.0), View(330.0, -60.0, 1200.0, 30.0), _IN, 20, 5.0),
        _ramp("off_ramp", partial(off_ramp, lanes=2, ramp=300.0), View(330.0, -60.0, 1250.0, 30.0), _OUT, 20, 5.0),
        _arterial(
            "arterial", partial(narrow_road, lanes=3, opposite_lanes=3, lane_width=3.25, length=700.0, speed_limit=50 / 3.6),
            View(120.0, -40.0, 620.0, 40.0), 2000.0, 20, 5.0,
        ),
        _arterial(
            "arterial_curve",
            partial(sharp_curve, radius=150.0, angle=1.2, lanes=2, opposite_lanes=2, approach=250.0, speed_limit=70 / 3.6),
            View(100.0, -40.0, 520.0, 270.0), 1300.0, 20, 5.0,
        ),
        _crossing("roundabout", roundabout, 120.0, dict.fromkeys("1234", 350.0), 20, 5.0),
        _crossing(
            "roundabout_five_arms", partial(roundabout, arms=5, radius=22.0), 120.0, dict.fromkeys("12345", 300.0), 20, 5.0
        ),
        _crossing("crossing", four_way_intersection, 120.0, {"1": 300.0, "2": 150.0, "3": 300.0, "4": 150.0}, 20, 5.0),
        _crossing("t_junction", t_junction, 120.0, {"1": 400.0, "3": 400.0, "4": 250.0}, 20, 5.0),
    )
}  # fmt: skip
"""By name."""
