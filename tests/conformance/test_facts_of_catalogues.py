"""Small inputs with one answer by the standard: entries of every kind of
catalogue, with parameters and expressions.

Each case names the class of the OpenSCENARIO XML reference that it tests.
"""

from __future__ import annotations

from pathlib import Path

import pytest

import runner
from tests.conformance.scenes import TELEPORT, lane_position, start
from tests.conformance.support import at, events, track
from tests.runner.files import HEADER, at_time, car, place, scenario, speed_action, story

KINDS = (
    "Vehicle",
    "Controller",
    "Pedestrian",
    "MiscObject",
    "Environment",
    "Maneuver",
    "Trajectory",
    "Route",
)


def entry(folder: Path, kind: str, content: str) -> None:
    """Write a catalogue `Things` with one entry in the folder of its kind."""
    path = folder / kind / "catalog.xosc"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(
        f'<OpenSCENARIO>{HEADER}<Catalog name="Things">{content}</Catalog></OpenSCENARIO>',
        encoding="utf-8",
    )


def declared(**values: str) -> str:
    return "".join(
        f'<ParameterDeclaration name="{name}" parameterType="double" value="{value}"/>'
        for name, value in values.items()
    )


def reference(name: str = "thing", **assigned: str) -> str:
    inner = "".join(
        f'<ParameterAssignment parameterRef="{key}" value="{value}"/>'
        for key, value in assigned.items()
    )
    inner = f"<ParameterAssignments>{inner}</ParameterAssignments>" if inner else ""
    return f'<CatalogReference catalogName="Things" entryName="{name}">{inner}</CatalogReference>'


def run(
    folder: Path, stories: str, kind: str, init: str = "", **parameters: float
) -> runner.RunResult:
    path = scenario(
        folder,
        entities=[car("Ego"), car("Lead")],
        init=init or place("Ego", 100, 10) + place("Lead", 600, 0),
        stories=stories,
        stop=6.0,
        parameters=parameters or {"Base": 4.0},
    )
    location = f'<{kind}Catalog><Directory path="{kind}"/></{kind}Catalog>'
    text = path.read_text(encoding="utf-8")
    path.write_text(
        text.replace("<CatalogLocations/>", f"<CatalogLocations>{location}</CatalogLocations>"),
        encoding="utf-8",
    )
    return runner.run(path, sut=None, world="kinematic", timestep=0.05)


def routing(inside: str) -> str:
    return f"<PrivateAction><RoutingAction>{inside}</RoutingAction></PrivateAction>"


FOLLOW = (
    "<FollowTrajectoryAction><TrajectoryRef>{}</TrajectoryRef><TimeReference><None/></TimeReference>"
    '<TrajectoryFollowingMode followingMode="position"/></FollowTrajectoryAction>'
)
ASSIGNED = {
    "default": ({}, 6.0),
    "number": ({"Y": "8"}, 8.0),
    "parameter": ({"Y": "$Base"}, 4.0),
    "expression": ({"Y": "${2 * $Base + 1}"}, 9.0),
    "functions": ({"Y": "${round(pow($Base, 2) / 3) + max(1, 2)}"}, 7.0),
    "negative": ({"Y": "${-$Base}"}, -4.0),
    "remainder": ({"Y": "${11 % $Base}"}, 3.0),
}


@pytest.mark.parametrize("case", ASSIGNED)
def test_a_trajectory_takes_what_its_reference_assigns(case: str, tmp_path: Path) -> None:
    """ParameterAssignment: values, parameters and expressions of the place of the reference."""
    assigned, y = ASSIGNED[case]
    vertices = "".join(
        f'<Vertex><Position><WorldPosition x="{x}" y="$Y"/></Position></Vertex>' for x in (200, 300)
    )
    entry(
        tmp_path,
        "Trajectory",
        '<Trajectory name="thing" '
        f'closed="false"><ParameterDeclarations>{declared(Y="6")}</ParameterDeclarations>'
        f"<Shape><Polyline>{vertices}</Polyline></Shape></Trajectory>",
    )
    action = routing(FOLLOW.format(reference(**assigned)))
    ego = track(run(tmp_path, story("Ego", [(1.0, action)]), "Trajectory"), "Ego")
    assert (at(ego, 3.0, "x"), at(ego, 3.0, "y")) == pytest.approx((220.0, y), abs=0.01)


def test_an_entry_computes_with_its_own_parameters(tmp_path: Path) -> None:
    """ParameterDeclaration in a catalogue: expressions in an entry see its parameters."""
    vertices = "".join(
        f'<Vertex><Position><WorldPosition x="{x}" y="${{$Y / 2}}"/></Position></Vertex>'
        for x in (200, 300)
    )
    entry(
        tmp_path,
        "Trajectory",
        '<Trajectory name="thing" '
        f'closed="false"><ParameterDeclarations>{declared(Y="6")}</ParameterDeclarations>'
        f"<Shape><Polyline>{vertices}</Polyline></Shape></Trajectory>",
    )
    action = routing(FOLLOW.format(reference(Y="${3 * $Base}")))
    ego = track(run(tmp_path, story("Ego", [(1.0, action)]), "Trajectory"), "Ego")
    assert at(ego, 3.0, "y") == pytest.approx(6.0, abs=0.01)


def test_a_parameter_that_an_entry_does_not_have_is_named(tmp_path: Path) -> None:
    """ParameterAssignment: parameterRef names a parameter of the entry."""
    entry(
        tmp_path,
        "Trajectory",
        '<Trajectory name="thing" '
        'closed="false"><Shape><Polyline><Vertex><Position><WorldPosition x="1" y="1"/>'
        '</Position></Vertex><Vertex><Position><WorldPosition x="9" '
        'y="1"/></Position></Vertex></Polyline></Shape>'
        "</Trajectory>",
    )
    action = routing(FOLLOW.format(reference(Wrong="1")))
    result = run(tmp_path, story("Ego", [(1.0, action)]), "Trajectory")
    assert any("Wrong" in remark for remark in result.remarks), result.remarks


def maneuver(parameters: str, events_: str) -> str:
    return (
        "<Maneuver "
        f'name="thing"><ParameterDeclarations>{parameters}</ParameterDeclarations>{events_}</Maneuver>'
    )


def with_maneuver(ref: str) -> str:
    text = story("Ego", [(1.0, speed_action(1))])
    first, rest = text.split("<Maneuver name", 1)
    return first + ref + rest.split("</Maneuver>", 1)[1]


def test_a_maneuver_of_a_catalogue_acts_for_the_actors_of_its_group(tmp_path: Path) -> None:
    """CatalogReference in a ManeuverGroup: an entry takes the place of a Maneuver."""
    event = (
        '<Event name="e" priority="parallel"><Action name="a">'
        + speed_action("$Fast")
        + f"</Action><StartTrigger>{at_time(1).replace('value=' + chr(34) + '1', 'value=' + chr(34) + '$When')}</StartTrigger></Event>"
    )
    entry(tmp_path, "Maneuver", maneuver(declared(Fast="12", When="1"), event))
    stories = with_maneuver(reference(Fast="${4 * $Base}", When="3"))
    ego = track(run(tmp_path, stories, "Maneuver"), "Ego")
    assert (at(ego, 2.9, "speed"), at(ego, 3.2, "speed")) == pytest.approx((10.0, 16.0))


def test_a_route_of_a_catalogue(tmp_path: Path) -> None:
    """RouteRef: an entry of a RouteCatalog, with parameters in its waypoints."""
    waypoints = "".join(
        "<Waypoint "
        f'routeStrategy="shortest"><Position>{lane_position(-1, 0).replace(chr(34) + "0" + chr(34), chr(34) + s + chr(34), 1)}'
        "</Position></Waypoint>"
        for s in ("100", "$End")
    )
    entry(
        tmp_path,
        "Route",
        '<Route name="thing" '
        f'closed="false"><ParameterDeclarations>{declared(End="900")}</ParameterDeclarations>'
        f"{waypoints}</Route>",
    )
    position = (
        f"<RoutePosition><RouteRef>{reference(End='500')}</RouteRef><InRoutePosition>"
        '<FromLaneCoordinates pathS="250" laneId="-2"/></InRoutePosition></RoutePosition>'
    )
    stories = story("Ego", [(2.0, TELEPORT.format(position))])
    ego = track(run(tmp_path, stories, "Route"), "Ego")
    assert (at(ego, 2.0, "x"), at(ego, 2.0, "y")) == pytest.approx((350.0, -5.25), abs=0.01)


def test_an_environment_of_a_catalogue(tmp_path: Path) -> None:
    """EnvironmentAction: an entry of an EnvironmentCatalog; its clock runs."""
    entry(
        tmp_path,
        "Environment",
        "<Environment "
        f'name="thing"><ParameterDeclarations>{declared(Rain="1")}</ParameterDeclarations>'
        '<TimeOfDay animation="true" dateTime="2026-06-01T12:00:00"/><Weather><Precipitation'
        ' precipitationType="rain" precipitationIntensity="$Rain"/></Weather></Environment>',
    )
    init = f"<GlobalAction><EnvironmentAction>{reference(Rain='${$Base / 2}')}</EnvironmentAction></GlobalAction>"
    clock = (
        '<ConditionGroup><Condition name="c" delay="0" '
        'conditionEdge="none"><ByValueCondition><TimeOfDayCondition'
        ' dateTime="2026-06-01T12:00:03" '
        'rule="greaterOrEqual"/></ByValueCondition></Condition></ConditionGroup>'
    )
    stories = story("Ego", [(99.0, speed_action(4))]).replace(at_time(99.0), clock)
    result = run(
        tmp_path, stories, "Environment", init + place("Ego", 100, 10) + place("Lead", 600, 0)
    )
    (begun,) = events(result, "startTransition", "event0")
    assert begun.time == pytest.approx(3.0, abs=0.051)


@pytest.mark.parametrize(
    ("lane", "s"), [("${-1}", "${100 + 50}"), ("${1 - 3}", "${pow(10, 2) + sqrt(2500)}")]
)
def test_whole_numbers_may_be_expressions(lane: str, s: str, tmp_path: Path) -> None:
    """Expressions: an int attribute takes an expression with a whole value."""
    init = start(
        "Ego",
        lane_position(-1, 0)
        .replace('laneId="-1"', f'laneId="{lane}"')
        .replace('s="0"', f's="{s}"'),
        0,
    )
    ego = track(run(tmp_path, "", "Vehicle", init + place("Lead", 600, 0)), "Ego")
    assert at(ego, 0.0, "x") == pytest.approx(150.0)
