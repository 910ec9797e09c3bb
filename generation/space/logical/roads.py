"""Roads of the library: lanes and courses through junctions, points where courses meet, places
where manoeuvres begin."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scenariogeneration import xosc as sg

import xosc
from recognition.catalogue.writing.write import ontology_tags
from recognition.labels import Label
from schemas.common.array_types import FloatArray
from schemas.common.errors import UsageError
from xodr import builders
from xodr.builders import RoadMap
from xodr.graph.network import RoadNetwork
from xosc.writing import maneuvers, tags
from xosc.writing.maneuvers import Dynamics, FileHeader
from xosc.writing.tags import ASAM, Tag, properties

SPEED_SHAPE = "sinusoidal"
"""Shape of changes of speed in scenarios of the library: no acceleration at both ends, and over the
same time and way as a line"""


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
        """Tags of scenarios on the road."""
        return [
            *(Tag(kind, None, ASAM) for kind in self.types),
            Tag("RoadGeometry", self.description),
        ]


_MOTORWAY = ("RoadTypeMotorway", "HorizontalStraights")
_CROSSROAD = (
    "HorizontalStraights",
    "IntersectionCrossroad",
    "JunctionIntersection",
    "RoadTypeMinor",
)
_T_JUNCTION = (
    "HorizontalStraights",
    "IntersectionTJunction",
    "JunctionIntersection",
    "RoadTypeMinor",
)

ROADS = {
    "highway_straight": LibraryRoad(builders.straight_highway, "straight motorway", _MOTORWAY),
    "highway_on_ramp": LibraryRoad(
        partial(builders.on_ramp, acceleration=850.0, upstream=100.0, downstream=600.0),
        "motorway with an on-ramp", (*_MOTORWAY, "RoadTypeSlip"),
    ),
    "highway_off_ramp": LibraryRoad(
        partial(builders.off_ramp, upstream=900.0, deceleration=400.0, ramp=500.0,
            downstream=800.0),
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
    "intersection_four_way": LibraryRoad(builders.four_way_intersection, "four-way intersection",
        _CROSSROAD),
    "intersection_four_way_two_lanes": LibraryRoad(
        partial(builders.four_way_intersection, lanes=2, arm=400.0),
        "four-way intersection of two-lane roads", _CROSSROAD
    ),
    "t_junction_two_lanes": LibraryRoad(
        partial(builders.t_junction, lanes=2, arm=400.0), "T junction of two-lane roads",
        _T_JUNCTION
    ),
    "roundabout": LibraryRoad(
        partial(builders.roundabout, arm=400.0), "roundabout",
        ("JunctionRoundabout", "RoadTypeMinor", "RoundaboutNormal")
    ),
}  # fmt: skip
"""By the names of their files in `xodr/library`."""


def write_roads(folder: Path, annotator: str) -> list[Path]:
    """Write all of them, each with its OpenLABEL tags beside; their paths."""
    written = []
    for name, road in ROADS.items():
        path, beside = (
            road.build().write(folder / f"{name}.xodr"),
            folder / f"{name}.openlabel.json",
        )
        beside.write_bytes(tags.to_bytes(road.tags, path.name, annotator))
        written += [path, beside]
    return written


_STEP, _REACH = 0.1, 120.0
"""Distance of the points of ways, and how far they are looked at, m."""
_SAME = 1.0
"""Ways that come closer than this meet, m."""


class LaneId(NamedTuple):
    """A lane of an arm: road and lane id."""

    road: str
    lane: int


class Course(NamedTuple):
    """Way of a vehicle, from a lane into the junction to a lane out of it."""

    origin: LaneId
    target: LaneId


class Crossing(NamedTuple):
    """A way of a pedestrian: across an arm, from the right of the lane that leads away on it, `s`
    (m) from the junction."""

    lane: LaneId
    s: float


Points = FloatArray


class Meeting(NamedTuple):
    """Conflict point of two ways.

    Attributes:
        x, y: place, m.
        ego, other: how far that is from where each one's arm ends, along its way, m; 0 for
            pedestrians.
    """

    x: float
    y: float
    ego: float
    other: float


def meeting(network: RoadNetwork, ego: Course, other: Course | Crossing) -> Meeting:
    """The first place where the ego's way meets another one.

    Raises:
        UsageError: they do not meet.
    """
    mine = _points(network, ego)
    theirs = _across(network, other) if isinstance(other, Crossing) else _points(network, other)
    apart = np.hypot(mine[:, None, 0] - theirs[:, 0], mine[:, None, 1] - theirs[:, 1])
    near = np.flatnonzero(apart.min(axis=1) < _SAME)
    if not len(near):
        raise UsageError(f"the ways {ego} and {other} do not meet")
    # The nearest point of the first approach: ways may come close again later.
    row = int(near[0] + apart[near[0] : near[0] + round(2 * _SAME / _STEP)].min(axis=1).argmin())
    x, y = mine[row].tolist()
    # A pedestrian's way is one point here: where it crosses the middle of the lane.
    along = 0.0 if isinstance(other, Crossing) else _STEP * float(apart[row].argmin())
    return Meeting(round(x, 3), round(y, 3), round(_STEP * row, 1), round(along, 1))


def _points(network: RoadNetwork, course: Course) -> Points:
    """x and y (n, 2) along a course from where its arm ends."""
    start, end = (network.lane_point(road, lane, 0.0) for road, lane in course)
    path = network.route([start, end])
    if path is None:
        raise UsageError(f"no way leads along {course}")
    distances = _STEP * np.arange(round(_REACH / _STEP))
    poses = [
        network.pose(network.travel(start, distance, False, path.choose).point)
        for distance in distances.tolist()
    ]
    return np.array([(pose.x, pose.y) for pose in poses])


def _across(network: RoadNetwork, crossing: Crossing) -> Points:
    """x and y (1, 2) of the middle of the lane that a pedestrian crosses."""
    pose = network.pose(network.lane_point(*crossing.lane, crossing.s))
    return np.array([(pose.x, pose.y)])


Limits = tuple[float, float]


@dataclass(frozen=True)
class Geometry:
    """A road with two neighbouring lanes, and the place where manoeuvres begin.

    It is long enough for all values of the parameters.

    Attributes:
        file: name of the road's file in `xodr/library`.
        description: where that is.
        road, left, right: the road's id, and those of the two lanes as their traffic sees them.
        spot: s (m) of the leader when the manoeuvre begins; of a manoeuvre's end where
            `ends_there`.
        side: +1 where the lanes lead towards increasing s, −1 where against.
        turn: the course of a right turn from the right lane; None without a junction.
        speeds, gaps: limits of the parameters, m/s and m; as wide as recordings are, where the road
            is long enough.
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


_straight = partial(
    Geometry, "highway_straight", "on a straight motorway", "1", -1, -2, speeds=(5.0, 42.0)
)
_rural = partial(Geometry, speeds=(5.0, 20.0), gaps=(0.5, 60.0), ego_speed=17.0, gap=13.0)
_urban = partial(Geometry, speeds=(4.0, 15.0), gaps=(0.5, 40.0), ego_speed=12.0, gap=10.0)
_arm = partial(
    _urban,
    road="3",
    left=1,
    right=2,
    spot=5.0,
    side=-1,
    ends_there=True,
    turn=Course(LaneId("3", 2), LaneId("4", -2)),
)

GEOMETRIES = {
    "highway": _straight(spot=650.0, gaps=(0.5, 150.0)),
    "free_highway": _straight(spot=750.0, gaps=(170.0, 300.0), gap=200.0),
    "on_ramp": Geometry(
        "highway_on_ramp", "on a motorway where an on-ramp joins", "2", -2, -3, 500.0
    ),
    "off_ramp": Geometry(
        "highway_off_ramp", "on a motorway before an off-ramp", "1", -2, -3, 980.0
    ),
    "exit_lane": Geometry(
        "highway_off_ramp", "on a motorway before an off-ramp", "1", -2, -3, 1070.0
    ),
    "sharp_curve": _rural("sharp_curve", "in a sharp curve", "1", -1, -2, 280.0),
    "narrow_road": _urban("narrow_road", "on a narrow road", "1", -1, -2, 250.0),
    "four_way_intersection": _arm("intersection_four_way_two_lanes", "before an intersection"),
    "t_junction": _arm("t_junction_two_lanes", "before a T junction"),
}
"""Geometries by name; the first five are motorways, of which most manoeuvres need only the first.
"""


CONTROLLER, ENVIRONMENT, MANEUVER, ROUTE = (
    "controller_catalog",
    "environment_catalog",
    "maneuver_catalog",
    "route_catalog",
)
PEDESTRIAN, VEHICLE = "pedestrian_catalog", "vehicle_catalog"
"""Names of the catalogues."""
DIRECTORIES = {
    kind: f"catalogs/{kind.lower()}s"
    for kind in ("Vehicle", "Pedestrian", "Controller", "Environment", "Maneuver", "Route")
}
"""Their folders by kind, relative to the scenarios."""

SYSTEM = maneuvers.reference(CONTROLLER, "system_under_test")
"""Reference to the controller of the ego."""
ENVIRONMENTS = ("dry_day", "wet_day", "foggy_day", "dry_night")
"""Entries of the catalogue of environments."""
FAR = 399.0
"""Start and end of routes on the arms, s in m."""


def route_name(file: str, course: Course) -> str:
    """Name of a route's entry."""
    (origin, lane), (target, _) = course
    return f"{file}_road_{origin}_to_{target}_lane_{lane}"


def take_route(actor: str, file: str, course: Course) -> tuple[str, Any]:
    """The actor and its manoeuvre of taking a route at once: in the story, as CARLA's
    scenario_runner knows no routes in Init."""
    route = maneuvers.assign_route(maneuvers.reference(ROUTE, route_name(file, course)))
    event = maneuvers.event(
        f"{actor} takes route", [route], maneuvers.simulation_time(0.0, "greaterOrEqual")
    )
    return actor, maneuvers.maneuver(f"{actor} route", [event])


def write_catalogs(folder: Path, courses: Iterable[tuple[str, Course]]) -> list[Path]:
    """Write the catalogues into folders of this folder, with a route for each road file and course;
    their paths."""
    written = []
    for name, kind, description, entries in _catalogs(courses):
        path = folder / DIRECTORIES[kind] / f"{name}.xosc"
        path.parent.mkdir(parents=True, exist_ok=True)
        said = header(description, [Tag("Catalogue", kind.lower()), Tag("Entries", len(entries))])
        written.append(path)
        xosc.write(maneuvers.catalog(path, said, name, entries), path)
    return written


def _catalogs(courses: Iterable[tuple[str, Course]]) -> Iterator[tuple[str, str, str, list[Any]]]:
    system = maneuvers.controller(
        "system_under_test",
        {"role": "drives the ego; which system that is, is up to the simulator"},
    )
    yield CONTROLLER, "Controller", "Controllers", [system]
    yield ENVIRONMENT, "Environment", "Environments", [_environment(name) for name in ENVIRONMENTS]
    yield MANEUVER, "Maneuver", "Manoeuvres", [_change_speed()]
    routes = {route_name(file, course): _route(file, course) for file, course in courses}
    yield (
        ROUTE,
        "Route",
        "Routes through the library's junctions",
        [routes[name] for name in sorted(routes)],
    )


def _route(file: str, course: Course) -> Any:
    return maneuvers.route(
        route_name(file, course),
        [maneuvers.lane_position(road, lane, FAR) for road, lane in course],
    )


def _change_speed() -> Any:
    """The entry by which a participant reaches a speed evenly, after a delay."""
    values = {"Delay_s": 1.0, "Duration_s": 3.0, "EndSpeed_mps": 5.0}
    start = replace(maneuvers.simulation_time(0.0, "greaterOrEqual"), delay="$Delay_s")
    change = maneuvers.speed("$EndSpeed_mps", Dynamics("linear", "time", "$Duration_s"))
    declared = [maneuvers.parameter(name, "double", value) for name, value in values.items()]
    return maneuvers.maneuver(
        "change_speed", [maneuvers.event("change speed", [change], start)], declared
    )


def _environment(name: str) -> Any:
    """An environment: time of day, weather, and how much less the tyres hold than on a dry road."""
    state, _, time = name.partition("_")
    is_day = time == "day"
    # At night the sun is below the horizon, and too weak for any shadow.
    sun = sg.Sun(
        100_000.0 if is_day else 0.1,
        math.pi if is_day else 0.0,
        math.radians(60.0 if is_day else -30.0),
    )
    clouds = (
        sg.FractionalCloudCover.zeroOktas if state == "dry" else sg.FractionalCloudCover.eightOktas
    )
    fog = sg.Fog(80.0 if state == "foggy" else 10_000.0)
    wet = state == "wet"
    rain = sg.Precipitation(
        sg.PrecipitationType.rain if wet else sg.PrecipitationType.dry, 5.0 if wet else 0.0
    )
    weather = sg.Weather(clouds, sun=sun, fog=fog, precipitation=rain)
    clock = sg.TimeOfDay(False, 2026, 6, 21, 12 if is_day else 23, 0, 0)
    return sg.Environment(name, clock, weather, sg.RoadCondition(0.7 if wet else 1.0))


COMMAND = "python -m studies.library"
"""Command that writes the files."""
AUTHOR = "xosc-toolchain"
_DATE = datetime(2026, 11, 21)


def header(description: str, tags: Sequence[Tag]) -> FileHeader:
    """A file's header, with its tags as properties."""
    return FileHeader(description, AUTHOR, _DATE, properties([*tags, Tag("MadeBy", COMMAND)]))


def scenario_tags(
    name: str, situation: str, label: Label | None, road: Sequence[Tag], categories: Iterable[str]
) -> list[Tag]:
    """The tags of a scenario.

    Args:
        situation: what happens, in a word or two.
        label: its class for the ego, where it is one of the 17.
        road: tags of its road.
        categories: of its participants.
    """
    title = label.title if label is not None else ""
    tags = [
        *ontology_tags(title, categories),
        *road,
        Tag("scenarioName", name, ASAM),
        Tag("Situation", situation),
    ]
    tags += [Tag("Class", title)] if title else []
    # Each tag once: road and class may bring the same.
    return list(dict.fromkeys([*tags, Tag("Ego", "Ego")]))
