"""Typed builders: what they build is valid in the versions that can say it, and
says what was asked for.
"""

from __future__ import annotations

import math
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import canonicalize

import pytest
from scenariogeneration import xosc as sg

import xosc
from schemas.common.errors import InvalidFile, Unsupported, UsageError
from schemas.validate import violations
from schemas.versions.registry import OPENSCENARIO, schema_for
from xosc.writing import maneuvers as m

VERSIONS = [(1, 0), (1, 1), (1, 2), (1, 3)]
HEADER = m.FileHeader("a test", "a tester", datetime(2024, 1, 31, 12))
RAMP = m.Dynamics("sinusoidal", "time", 4)


def is_valid(document: xosc.Document) -> bool:
    schema = schema_for(OPENSCENARIO, document.version)
    return schema is not None and not violations(document.root.getroottree(), schema)


def driven(events: list[Any], version: tuple[int, int] = (1, 3), **parts: Any) -> xosc.Document:
    car = m.vehicle("sedan", 4.8, 1.9, 1.5)
    init = [m.teleport(m.lane_position("1", -1, 50)), m.speed(20)]
    entities = {
        "Ego": car,
        "Target": m.vehicle("lorry", 12, 2.5, 3.8, category="truck", wheelbase=6, mass=9000),
    }
    if version == (1, 0):
        entities.pop("Target")
    return m.scenario(
        "scenario.xosc",
        HEADER,
        road="road.xodr",
        entities=entities,
        init={"Ego": init},
        maneuvers=[("Ego", m.maneuver("drive", events))],
        version=version,
        **parts,
    )


ACTIONS = {
    "speed": m.speed(10, m.Dynamics("linear", "rate", 2)),
    "speed_profile": m.speed_profile([(10, 2), (20, 3.5)], "follow"),
    "speed_profile with jerk": m.speed_profile([(10, 2)], "follow", 2.5),
    "lane_change": m.lane_change(-2, RAMP, offset=0.2),
    "relative lane_change": m.lane_change(1, RAMP, relative_to="Ego"),
    "teleport": m.teleport(m.world_position(1, 2, 3, 0.5)),
    "follow_trajectory": m.follow_trajectory(
        m.trajectory("t", [0, 1], [0, 10], [0, 0], [0, 0], [0, 0.1])
    ),
    "follow_trajectory of a catalogue": m.follow_trajectory(
        m.reference("paths", "t"), domain="absolute"
    ),
    "relative teleport": m.teleport(m.relative_lane_position("Ego", 1, -20)),
    "assign_route": m.assign_route(
        m.route("r", [m.world_position(0, 0), m.lane_position("1", -1, 9)])
    ),
    "add_entity": m.add_entity("Ego", m.world_position(0, 0)),
    "delete_entity": m.delete_entity("Ego"),
}


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("action", ACTIONS.values(), ids=ACTIONS)
def test_every_action_is_valid_where_the_version_has_it(
    action: Any, version: tuple[int, int]
) -> None:
    events = [m.event("e", [action], m.simulation_time(1))]
    if isinstance(action, sg.SpeedProfileAction) and version < (1, 2):
        with pytest.raises(Unsupported, match="SpeedProfileAction"):
            driven(events, version)
    else:
        document = driven(events, version)
        assert document.version == version and document.kind == "scenario" and is_valid(document)


@pytest.mark.parametrize("version", VERSIONS)
def test_places_along_a_trajectory_came_with_1_1(version: tuple[int, int]) -> None:
    path = m.reference("paths", "t")
    actions = [m.teleport(m.trajectory_position(path, 12.5)), m.follow_path(path, 12.5)]
    if version == (1, 0):
        with pytest.raises(Unsupported, match="can't be said in OpenSCENARIO"):
            driven([m.event("e", actions, m.simulation_time(1))], version)
    else:
        document = driven([m.event("e", actions, m.simulation_time(1))], version)
        followed = next(document.root.iter("FollowTrajectoryAction"))
        assert is_valid(document) and followed.get("initialDistanceOffset") == "12.5"
        assert followed.find("TimeReference/None") is not None


TRIGGERS = {
    "simulation_time": m.simulation_time(3),
    "element_state": m.element_state("event", "first"),
    "collision": m.collision("Ego", "Target"),
    "distance": m.distance("Ego", m.world_position(1, 2), 20, "greaterThan"),
    "relative_distance": m.relative_distance("Ego", "Target", 20, edge="rising"),
    "time_headway": m.time_headway("Ego", "Target", 1.5),
    "time_to_collision": m.time_to_collision("Ego", "Target", "$Ttc"),
    "all of them": [m.simulation_time(3), m.time_headway("Ego", "Target", 1.5, edge="rising")],
    "one of them": [[m.simulation_time(3)], [m.time_headway("Ego", "Target", 1.5)]],
    "later": replace(m.simulation_time(3), delay=1.5),
}


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("trigger", TRIGGERS.values(), ids=TRIGGERS)
def test_every_trigger_is_valid_in_every_version(trigger: Any, version: tuple[int, int]) -> None:
    assert is_valid(
        driven([m.event("e", [m.speed(1)], trigger)], version, stop=m.simulation_time(60))
    )


def test_conditions_of_a_group_hold_together_and_one_group_is_enough() -> None:
    first, second, third = (replace(m.simulation_time(time), delay="$Delay") for time in (1, 2, 3))

    def groups(start: Any) -> list[int]:
        trigger = driven([m.event("e", [m.speed(1)], start)]).node.need(
            "Storyboard", "Story", "Act", "ManeuverGroup"
        )
        return [len(group.children()) for group in next(trigger.iter("StartTrigger")).children()]

    assert (groups(first), groups([first, second]), groups([[first], [second, third]])) == (
        [1],
        [2],
        [1, 2],
    )


def test_a_manoeuvre_of_a_catalogue_takes_its_parameters_from_the_scenario() -> None:
    document = m.scenario(
        "s.xosc",
        HEADER,
        road="road.xodr",
        entities={"Ego": m.reference("vehicles", "car")},
        init={},
        maneuvers=[("Ego", m.reference("maneuvers", "swerve", {"Width": "$Width", "Times": 2}))],
        controllers={"Ego": m.reference("controllers", "driver")},
    )
    assert is_valid(document)
    group = document.node.need("Storyboard", "Story", "Act", "ManeuverGroup")
    assigned = {
        each.get("parameterRef"): each.get("value") for each in group.iter("ParameterAssignment")
    }
    assert (group.get("name"), assigned) == ("swerve of Ego", {"Width": "$Width", "Times": "2"})
    assert (
        document.node.need("Entities", "ScenarioObject", "ObjectController")
        .children()[0]
        .get("entryName")
        == "driver"
    )


def test_an_environment_holds_from_the_beginning() -> None:
    drive = m.event("drive", [m.speed(9)], m.simulation_time(1))
    document = driven(
        [drive], catalogs={"Environment": "weather"}, environment=m.reference("weather", "rain")
    )
    assert is_valid(document)
    found = document.root.find(
        "Storyboard/Init/Actions/GlobalAction/EnvironmentAction/CatalogReference"
    )
    assert found is not None and found.get("entryName") == "rain"


def test_coordinate_systems_came_with_1_1() -> None:
    trigger = m.time_headway("Ego", "Target", 1.5, kind="longitudinal", coordinates="road")
    assert is_valid(driven([m.event("e", [m.speed(1)], trigger)], (1, 1)))
    with pytest.raises(Unsupported, match="TimeHeadwayCondition"):
        driven([m.event("e", [m.speed(1)], trigger)], (1, 0))


def test_the_reference_point_is_the_rear_axle() -> None:
    node = driven([m.event("e", [m.speed(1)], m.simulation_time(1))]).node
    boxes = {v.get("name"): v for v in node.iter("Vehicle")}
    sedan, lorry = boxes["sedan"], boxes["lorry"]
    assert sedan.need("Axles", "RearAxle").float("positionX") == 0
    assert sedan.need("Axles", "FrontAxle").float("positionX") == pytest.approx(0.6 * 4.8)
    assert sedan.need("BoundingBox", "Center").float("x") == pytest.approx(0.3 * 4.8)
    assert sedan.need("BoundingBox", "Center").float("z") == pytest.approx(0.75)
    assert sedan.need("BoundingBox", "Dimensions").float("length") == 4.8
    assert lorry.need("BoundingBox", "Center").float("x") == 3
    assert lorry.get("vehicleCategory") == "truck" and lorry.float("mass") == 9000


def test_a_written_scenario_resolves_with_its_parameters(tmp_path: Path) -> None:
    groups = [[("greaterThan", 0), ("lessOrEqual", "${$Limit}")], [("equalTo", 99)]]
    document = m.scenario(
        tmp_path / "scenario.xosc",
        m.FileHeader("a test", "a tester", datetime(2024, 1, 31), {"tag": "cut-in"}),
        road="road.xodr",
        entities={
            "Ego": m.vehicle("car", 4, 2, 1.5),
            "Other": sg.CatalogReference("vehicles", "van"),
        },
        init={"Ego": [m.speed("$Speed")]},
        parameters=[
            m.parameter("Speed", "double", 12.5, groups),
            m.parameter("Limit", "double", 30),
            m.parameter("On", "boolean", True),
        ],
        catalogs={"Vehicle": "catalogs"},
    )
    xosc.write(document, document.path)
    (tmp_path / "catalogs").mkdir()
    vans = m.catalog(
        tmp_path / "catalogs" / "vans.xosc",
        HEADER,
        "vehicles",
        [m.vehicle("van", 5.5, 2, 2.5, category="van")],
    )
    xosc.write(vans, vans.path)
    resolved = xosc.resolve(xosc.load(document.path), {"Speed": 20})
    assert next(resolved.node.iter("AbsoluteTargetSpeed")).float("value") == 20
    assert [vehicle.get("name") for vehicle in resolved.node.iter("Vehicle")] == ["car", "van"]
    assert resolved.node.need("FileHeader", "Properties", "Property").get("value") == "cut-in"
    assert resolved.logic_file == tmp_path / "road.xodr"
    assert xosc.resolve(xosc.load(document.path), {"Speed": 99})
    with pytest.raises(InvalidFile, match="Speed = 31"):
        xosc.resolve(xosc.load(document.path), {"Speed": 31})


def test_the_same_call_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("one", "two"):
        xosc.write(
            driven([m.event("e", [ACTIONS["follow_trajectory"]], m.simulation_time(1))]),
            tmp_path / name,
        )
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()


ROUTE = m.route("r", [m.world_position(0, 0), m.world_position(9, 0)])
ENTRIES = {
    "Vehicle": m.vehicle("v", 4, 2, 1.5),
    "Pedestrian": m.pedestrian("p", 0.5, 0.6, 1.8),
    "MiscObject": m.obstacle("o", 1, 1, 2),
    "Controller": m.controller("c", {"driver": "human"}),
    "Environment": sg.Environment("e", timeofday=sg.TimeOfDay(True, 2024, 1, 1, 12, 0, 0)),
    "Maneuver": m.maneuver(
        "m",
        [m.event("e", [m.speed("$V")], m.simulation_time(1))],
        [m.parameter("V", "double", 1.0)],
    ),
    "Trajectory": m.trajectory("t", [0, 1], [0, 10], [0, 0]),
    "Route": ROUTE,
}


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("kind", m.CATALOG_KINDS)
def test_catalogues_of_all_kinds_are_valid_in_every_version(
    kind: str, version: tuple[int, int]
) -> None:
    def made() -> xosc.Document:
        return m.catalog("catalog.xosc", HEADER, "mine", [ENTRIES[kind]], version)

    if kind == "Environment" and version == (1, 0):  # which wants all of weather and road in it
        with pytest.raises(Unsupported, match="Environment"):
            made()
        return
    document = made()
    assert document.kind == "catalog" and is_valid(document)
    assert [child.tag for child in document.node.need("Catalog").children()] == [kind]


def test_the_global_version_of_scenariogeneration_is_put_back() -> None:
    sg.VersionBase().setVersion(1, 0)
    try:
        assert driven([m.event("e", [m.speed(1)], m.simulation_time(1))]).version == (1, 3)
        assert sg.VersionBase.version_minor == 0
        with pytest.raises(AttributeError):
            m.catalog("catalog.xosc", HEADER, "mine", [None])
        assert sg.VersionBase.version_minor == 0
    finally:
        sg.VersionBase().setVersion(1, 3)


WRONG = {
    "a word that the standard does not have": (
        lambda: m.speed(1, m.Dynamics("quick", "time", 1)),
        "DynamicsShapes has no 'quick'",
    ),
    "a text for a number": (lambda: m.speed("fast"), "neither a number nor"),
    "NaN": (lambda: m.speed(math.nan), "not a finite number"),
    "a vehicle without size": (
        lambda: m.vehicle("v", 0, 1, 1),
        "the length of the vehicle 'v' must be positive",
    ),
    "no such category": (
        lambda: m.vehicle("v", 1, 1, 1, category="ufo"),
        "VehicleCategory has no 'ufo'",
    ),
    "arrays of different lengths": (
        lambda: m.trajectory("t", [0, 1], [0], [0, 1]),
        "arrays of one length",
    ),
    "a trajectory of one point": (lambda: m.trajectory("t", [0], [0], [0]), "two points"),
    "a trajectory back in time": (
        lambda: m.trajectory("t", [1, 0], [0, 1], [0, 1]),
        "must not go back",
    ),
    "an event that nothing starts": (
        lambda: m.event("e", [m.speed(1)], []),
        "a start trigger needs at least one condition",
    ),
    "a group of no conditions": (
        lambda: m.event("e", [m.speed(1)], [[]]),
        "a start trigger needs at least one condition",
    ),
    "a route to nowhere": (lambda: m.route("r", [m.world_position(0, 0)]), "two waypoints"),
    "an empty profile": (lambda: m.speed_profile([]), "at least one entry"),
    "an actor that is no entity": (
        lambda: m.scenario("s.xosc", HEADER, road="r", entities={}, init={"Ego": []}),
        "'Ego' is not among the entities",
    ),
    "a catalogue of nothing": (lambda: m.catalog("c.xosc", HEADER, "mine", []), "not none"),
    "a mixed catalogue": (
        lambda: m.catalog("c.xosc", HEADER, "mine", [ENTRIES["Vehicle"], ROUTE]),
        "entries of one kind",
    ),
    "twins in a catalogue": (
        lambda: m.catalog("c.xosc", HEADER, "mine", [ROUTE, ROUTE]),
        "same name",
    ),
    "no such catalogue": (
        lambda: m.scenario("s.xosc", HEADER, road="r", entities={}, init={}, catalogs={"Ufo": "."}),
        "no catalogues of 'Ufo'",
    ),
}


@pytest.mark.parametrize(("build", "message"), WRONG.values(), ids=WRONG)
def test_wrong_use_is_refused_in_words(build: Any, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        build()


@pytest.mark.parametrize("version", VERSIONS)
def test_catalogues_of_trajectories_are_written_as_their_documents_would_be(
    version: tuple[int, int],
) -> None:
    odd = 'a "b" <c> & d\'e\n\tü'
    entries = [
        m.trajectory(odd, [0, 0.1, 1e-5 + 1], [-0.0, 1e-7, 1e17], [0, 1 / 3, 2]),
        m.trajectory("h", [0, 1], [0, 1], [0, 1], h=[3, -3]),
    ]
    document = m.catalog("c.xosc", HEADER, "TrajectoryCatalog", entries, version)
    assert is_valid(document)
    assert same(m.trajectory_catalog(HEADER, entries, version), xosc.document.to_bytes(document))


def same(one: bytes, other: bytes) -> bool:
    """Whether two files are the same but for the blanks between elements."""
    return canonicalize(one.decode(), strip_text=True) == canonicalize(
        other.decode(), strip_text=True
    )


def _following(
    names: tuple[str, ...], speeds: tuple[m.Number, ...], version: tuple[int, int]
) -> xosc.Document:
    """A scenario in which some follow trajectories of a catalogue."""
    follow = {
        name: m.follow_trajectory(
            m.reference("TrajectoryCatalog", name), "follow", domain="absolute"
        )
        for name in names
    }
    return m.scenario(
        "s.xosc",
        HEADER,
        road="r.xodr",
        entities={name: m.reference("VehicleCatalog", name) for name in names},
        init={name: [m.speed(speed)] for name, speed in zip(names, speeds, strict=True)},
        maneuvers=[
            (name, m.maneuver("go", [m.event("go", [action], m.simulation_time(speed))]))
            for (name, action), speed in zip(follow.items(), speeds, strict=True)
        ],
        version=version,
    )


TAGS = ("ScenarioObject", "Private", "ManeuverGroup")


@pytest.mark.parametrize("version", VERSIONS)
def test_forms_with_values_are_written_as_their_document_would_be(version: tuple[int, int]) -> None:
    names, speeds = ("Ego", 'a "b" <c> & d\'e\n\tü', "{brace} %s"), (1.5, -1e-7, 1e17)
    form = m.Form(_following(("$name",), ("$speed",), version), TAGS)
    more = [
        form.filled({"name": name}, {"speed": speed})
        for name, speed in zip(names[1:], speeds[1:], strict=True)
    ]
    content = m.extended(_following(names[:1], speeds[:1], version), more)
    assert same(content, xosc.document.to_bytes(_following(names, speeds, version)))


def test_forms_refuse_what_is_no_number() -> None:
    form = m.Form(_following(("$name",), ("$speed",), (1, 3)), TAGS)
    with pytest.raises(UsageError, match="nan is not a finite number"):
        form.filled({"name": "Ego"}, {"speed": math.nan})
