"""The library's catalogues of controllers, environments, manoeuvres and routes."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from scenariogeneration import xosc as sg

import xosc
from generation.logical.courses import Course
from generation.logical.encounters import ENCOUNTERS
from generation.logical.geometries import GEOMETRIES
from generation.logical.header import header
from xosc import maneuvers
from xosc.maneuvers import Dynamics
from xosc.tags import Tag

CONTROLLER, ENVIRONMENT, MANEUVER, ROUTE = "controller_catalog", "environment_catalog", "maneuver_catalog", "route_catalog"
PEDESTRIAN, VEHICLE = "pedestrian_catalog", "vehicle_catalog"
"""Names of the catalogues."""
DIRECTORIES = {
    kind: f"catalogs/{kind.lower()}s" for kind in ("Vehicle", "Pedestrian", "Controller", "Environment", "Maneuver", "Route")
}
"""Their folders by kind, relative to the scenarios."""

SYSTEM = maneuvers.reference(CONTROLLER, "system_under_test")
"""Reference to the controller of the ego."""
ENVIRONMENTS = ("dry_day", "wet_day", "foggy_day", "dry_night")
"""Entries of the catalogue of environments."""
FAR = 399.0
"""Where routes begin and end on the arms, s in m."""


def route_name(file: str, course: Course) -> str:
    """Name of a route's entry."""
    (origin, lane), (target, _) = course
    return f"{file}_road_{origin}_to_{target}_lane_{lane}"


def take_route(actor: str, file: str, course: Course) -> tuple[str, Any]:
    """The actor and its manoeuvre of taking a route at once: in the story, as CARLA's scenario_runner knows no routes in Init."""
    route = maneuvers.assign_route(maneuvers.reference(ROUTE, route_name(file, course)))
    event = maneuvers.event(f"{actor} takes route", [route], maneuvers.simulation_time(0.0, "greaterOrEqual"))
    return actor, maneuvers.maneuver(f"{actor} route", [event])


def write_catalogs(folder: Path) -> list[Path]:
    """Write the catalogues into folders of this folder; their paths."""
    written = []
    for name, kind, description, entries in _catalogs():
        path = folder / DIRECTORIES[kind] / f"{name}.xosc"
        path.parent.mkdir(parents=True, exist_ok=True)
        said = header(description, [Tag("Catalogue", kind.lower()), Tag("Entries", len(entries))])
        written.append(path)
        xosc.write(maneuvers.catalog(path, said, name, entries), path)
    return written


def _catalogs() -> Iterator[tuple[str, str, str, list[Any]]]:
    system = maneuvers.controller("system_under_test", {"role": "drives the ego; which system that is, is up to the simulator"})
    yield CONTROLLER, "Controller", "Controllers", [system]
    yield ENVIRONMENT, "Environment", "Environments", [_environment(name) for name in ENVIRONMENTS]
    yield MANEUVER, "Maneuver", "Manoeuvres", [_change_speed()]
    routes = {route_name(file, course): _route(file, course) for file, course in _courses()}
    yield ROUTE, "Route", "Routes through the library's junctions", [routes[name] for name in sorted(routes)]


def _courses() -> Iterator[tuple[str, Course]]:
    """Road files and courses on them that scenarios refer to."""
    for each in ENCOUNTERS.values():
        yield from ((each.file, course) for course in (each.ego, each.way) if isinstance(course, Course))
    for geometry in GEOMETRIES.values():
        if geometry.turn is not None:
            yield geometry.file, geometry.turn


def _route(file: str, course: Course) -> Any:
    return maneuvers.route(route_name(file, course), [maneuvers.lane_position(road, lane, FAR) for road, lane in course])


def _change_speed() -> Any:
    """The entry by which a participant reaches a speed evenly, after a delay."""
    values = {"Delay_s": 1.0, "Duration_s": 3.0, "EndSpeed_mps": 5.0}
    start = replace(maneuvers.simulation_time(0.0, "greaterOrEqual"), delay="$Delay_s")
    change = maneuvers.speed("$EndSpeed_mps", Dynamics("linear", "time", "$Duration_s"))
    declared = [maneuvers.parameter(name, "double", value) for name, value in values.items()]
    return maneuvers.maneuver("change_speed", [maneuvers.event("change speed", [change], start)], declared)


def _environment(name: str) -> Any:
    """An environment: time of day, weather, and how much less the tyres hold than on a dry road."""
    state, _, time = name.partition("_")
    is_day = time == "day"
    sun = sg.Sun(100_000.0 if is_day else 0.1, math.pi if is_day else 0.0, math.radians(60.0 if is_day else -30.0))
    clouds = sg.FractionalCloudCover.zeroOktas if state == "dry" else sg.FractionalCloudCover.eightOktas
    fog = sg.Fog(80.0 if state == "foggy" else 10_000.0)
    wet = state == "wet"
    rain = sg.Precipitation(sg.PrecipitationType.rain if wet else sg.PrecipitationType.dry, 5.0 if wet else 0.0)
    weather = sg.Weather(clouds, sun=sun, fog=fog, precipitation=rain)
    clock = sg.TimeOfDay(False, 2026, 6, 21, 12 if is_day else 23, 0, 0)
    return sg.Environment(name, clock, weather, sg.RoadCondition(0.7 if wet else 1.0))
