"""What exports to older versions leave out or say otherwise: each with a remark, the motion as
before, refused where strict.
"""

from __future__ import annotations

from pathlib import Path

import pytest

import schemas
from schemas.common.errors import InvalidFile, Unsupported
from tests.runner.files import car, place, scenario, speed_action, story
from tests.xosc.test_exports import motion
from xosc.exports import carla, standard
from xosc.exports.draft import ExportSettings, Folder
from xosc.exports.omissions import OMISSIONS, SAID_OTHERWISE

CONTROLLER = """<ObjectController name="own"><Controller name="c" controllerType="all"><Properties/></Controller>
    </ObjectController>"""
VEHICLE = (
    car("Ego")
    .replace("</Axles>", '</Axles><TrailerCoupler dx="0"/><TrailerHitch dx="-1"/>')
    .replace('vehicleCategory="car"', 'vehicleCategory="car" role="police" model3d="police.osgb"')
    .replace("</Vehicle>", f"</Vehicle>{CONTROLLER}{CONTROLLER.replace('own', 'other')}")
)
TOWING = car("Lead").replace(
    "</Axles>", '</Axles><TrailerHitch dx="-1"/><Trailer><TrailerRef entityRef=""/></Trailer>'
)  # fmt: skip
WALKER = """<ScenarioObject name="Walker"><Pedestrian name="walker" pedestrianCategory="pedestrian" mass="70" model="w"
    model3d="w.osgb"><BoundingBox><Center x="0" y="0" z="0.9"/><Dimensions width="0.5" length="0.6" height="1.8"/></BoundingBox>
    </Pedestrian></ScenarioObject>"""
WEATHER = """<GlobalAction><EnvironmentAction><Environment name="wet"><Weather fractionalCloudCover="sevenOktas" temperature="280"
    atmosphericPressure="100000"><Sun illuminance="30000" azimuth="0" elevation="1"/>
    <Precipitation precipitationType="rain" precipitationIntensity="10"/><Wind direction="0" speed="3"/></Weather>
    <RoadCondition frictionScaleFactor="0.8" wetness="moist"/></Environment></EnvironmentAction></GlobalAction>"""
CONTROL = """<PrivateAction><ControllerAction>
    <ActivateControllerAction objectControllerRef="own" lateral="false"/></ControllerAction></PrivateAction>"""
AHEAD = """<PrivateAction><RoutingAction><FollowTrajectoryAction>
    <TrajectoryRef><Trajectory name="t" closed="false"><Shape><Polyline>
    <Vertex><Position><WorldPosition x="100" y="-2"/></Position></Vertex>
    <Vertex><Position><WorldPosition x="300" y="-1"/></Position></Vertex>
    </Polyline></Shape></Trajectory></TrajectoryRef><TimeReference><None/></TimeReference>
    <TrajectoryFollowingMode followingMode="position"/></FollowTrajectoryAction></RoutingAction></PrivateAction>"""
SET = (
    '<GlobalAction><VariableAction variableRef="Phase"><SetAction '
    'value="2"/></VariableAction></GlobalAction>'
)

_ABSENT = ("never starts", "takes longer", "TrailerRef")
NOT_HERE = {
    each.reason
    for each in (*OMISSIONS, *SAID_OTHERWISE)
    if any(text in each.reason for text in _ABSENT)
}
"""Kinds of what the scenario does not have"""


def condition(content: str) -> str:
    """A Trigger's content."""
    return (
        f'<ConditionGroup><Condition name="${{c}}" delay="0" '
        f'conditionEdge="none">{content}</Condition></ConditionGroup>'
    )


def entity_condition(content: str) -> str:
    """A Trigger's content: one of Lead."""
    return condition(
        '<ByEntityCondition><TriggeringEntities triggeringEntitiesRule="any"><EntityRef '
        'entityRef="Lead"/></TriggeringEntities>'
        f"<EntityCondition>{content}</EntityCondition></ByEntityCondition>"
    )


def event(name: str, action: str, trigger: str) -> str:
    started = f"<StartTrigger>{trigger}</StartTrigger>"
    return (
        f'<Event name="{name}" priority="parallel"><Action '
        f'name="{name}">{action}</Action>{started}</Event>'
    )


@pytest.fixture
def recent(tmp_path: Path) -> Path:
    """A scenario of 1.3 with everything that is left out before, where events
    depend on each other.
    """
    near = "".join(
        entity_condition(
            '<TimeHeadwayCondition entityRef="Ego" value="9" freespace="false" rule="lessThan" '
            f'coordinateSystem="{system}" '
            'relativeDistanceType="longitudinal"/>'
        )
        for system in ("road", "entity")
    )
    near += entity_condition(
        '<RelativeDistanceCondition entityRef="Ego" value="5" freespace="false" rule="lessThan" '
        'coordinateSystem="lane" '
        'relativeDistanceType="longitudinal"/>'
    )
    phase = condition(
        '<ByValueCondition><VariableCondition variableRef="Phase" value="2" '
        'rule="equalTo"/></ByValueCondition>'
    )
    events = event("set", SET, near) + event("drive", AHEAD, phase)
    stories = (
        '<Story name="s"><Act name="a"><ManeuverGroup name="g" maximumExecutionCount="1"><Actors '
        'selectTriggeringEntities="0">'
        '<EntityRef entityRef="Lead"/></Actors><Maneuver '
        f'name="m">{events}</Maneuver></ManeuverGroup></Act></Story>'
    )
    walker = place("Walker", 180, 0, -2)
    init = WEATHER + place("Ego", 100, 20, more=CONTROL) + place("Lead", 90, 25, -2) + walker
    path = scenario(tmp_path, entities=[VEHICLE, TOWING, WALKER], init=init, stories=stories)
    variables = (
        '<VariableDeclarations><VariableDeclaration name="Phase" variableType="int" '
        'value="1"/></VariableDeclarations>'
    )
    path.write_text(
        path.read_text().replace("<CatalogLocations/>", f"{variables}<CatalogLocations/>")
    )
    return path


@pytest.mark.parametrize("version", ["1.0", "1.1", "1.2"])
def test_nothing_moves_otherwise_for_what_is_left_out(
    version: str, recent: Path, tmp_path: Path
) -> None:
    remarks = standard.export(recent, version, Folder(tmp_path / "out"))
    before = tuple(int(each) for each in version.split("."))
    expected = {
        each.reason
        for each in (*OMISSIONS, *SAID_OTHERWISE)
        if before < each.before <= (1, 3) and each.reason not in NOT_HERE
    }
    assert {
        reason for reason in expected if any(remark.endswith(f": {reason}") for remark in remarks)
    } == expected
    exported = tmp_path / "out" / recent.name
    assert [each for each in schemas.check(exported) if each.level == "error"] == []
    rows = motion(recent)
    assert rows["Lead"][-1][1] > rows["Lead"][0][1] + 0.01, "the trajectory is followed"
    assert all((rows[name] == got).all() for name, got in motion(exported).items())


@pytest.mark.parametrize("version", ["1.0", "1.1", "1.2"])
def test_strict_exports_leave_nothing_out(version: str, recent: Path, tmp_path: Path) -> None:
    with pytest.raises(
        Unsupported,
        match=f"can't be said in OpenSCENARIO {version}|plain text in OpenSCENARIO {version}",
    ):
        standard.export(recent, version, Folder(tmp_path / "out"), ExportSettings(strict=True))
    assert not (tmp_path / "out").exists()


def test_a_storyboard_without_stories_gets_one_that_does_nothing(
    recent: Path, tmp_path: Path
) -> None:
    path = scenario(tmp_path / "bare")
    (remark,) = standard.export(path, "1.1", Folder(tmp_path / "out"))
    assert "never starts" in remark
    exported = tmp_path / "out" / path.name
    assert [each for each in schemas.check(exported) if each.level == "error"] == []
    assert all((rows == motion(exported)[name]).all() for name, rows in motion(path).items())


@pytest.mark.parametrize("dimension", ["time", "rate", "distance"])
def test_transitions_that_keep_to_their_dynamics_are_told(dimension: str, tmp_path: Path) -> None:
    slowly = speed_action(5, f'dynamicsShape="linear" dynamicsDimension="{dimension}" value="2"')
    path = scenario(tmp_path, stories=story("Lead", [(0.5, slowly)]))
    (remark,) = standard.export(path, "1.1", Folder(tmp_path / "out"))
    assert (
        "SpeedActionDynamics: before 1.2 it takes longer where the vehicle's "
        "Performance asks for that"
    ) in remark
    assert standard.export(path, "1.2", Folder(tmp_path / "new")) == []


def test_a_trailer_of_no_name_is_left_out_for_carla_too(tmp_path: Path) -> None:
    hitch = '</Axles><TrailerHitch dx="-1"/><Trailer><TrailerRef entityRef=""/></Trailer>'
    path = scenario(tmp_path, entities=[car("Ego"), car("Lead").replace("</Axles>", hitch)])
    assert any(
        "it tows nothing" in remark
        for remark in carla.export(path, "carla", Folder(tmp_path / "out"))
    )


def test_a_trailer_that_is_towed_stays_a_refusal(tmp_path: Path) -> None:
    trailer = (
        car("Box")
        .replace("</Axles>", '</Axles><TrailerCoupler dx="4"/>')
        .replace('Category="car"', 'Category="trailer"')
    )
    tractor = car("Lead").replace(
        "</Axles>",
        '</Axles><TrailerHitch dx="-1"/><Trailer><TrailerRef entityRef="Box"/></Trailer>',
    )
    path = scenario(tmp_path, entities=[car("Ego"), tractor, trailer])
    with pytest.raises(Unsupported, match="Trailer"):
        standard.export(path, "1.1", Folder(tmp_path / "out"))


@pytest.mark.parametrize("version", ["1.0", "1.1", "1.3"])
def test_what_a_catalogue_has_of_later_versions_is_left_out_where_it_does_nothing(
    version: str, tmp_path: Path
) -> None:
    """As in a catalogue that many projects copy: of 1.1, with a hitch and a
    trailer that a parameter may name.
    """
    vehicle = (
        car("")
        .partition(">")[2]
        .rpartition("</ScenarioObject>")[0]
        .replace("</Vehicle>", "<Properties/></Vehicle>")
    )
    declared = (
        '<ParameterDeclarations><ParameterDeclaration name="Towed" parameterType="string" '
        'value=""/></ParameterDeclarations>'
    )
    towing = '</Axles><TrailerHitch dx="-1"/><Trailer><EntityRef entityRef="$Towed"/></Trailer>'
    used = vehicle.replace("<BoundingBox>", f"{declared}<BoundingBox>").replace("</Axles>", towing)
    unused = vehicle.replace('name="car"', 'name="other" role="police"').replace(
        "</Axles>", "</Axles><Trailer/>"
    )
    header = (
        '<FileHeader revMajor="1" revMinor="1" date="2026-01-01T00:00:00" '
        'description="" author=""/>'
    )
    text = f'<OpenSCENARIO>{header}<Catalog name="Vehicles">{used}{unused}</Catalog></OpenSCENARIO>'
    (tmp_path / "vehicles.xosc").write_text(text, encoding="utf-8")
    lead = (
        '<ScenarioObject name="Lead"><CatalogReference catalogName="Vehicles" '
        'entryName="car"/></ScenarioObject>'
    )
    path = scenario(tmp_path, entities=[car("Ego"), lead])
    located = (
        "<CatalogLocations><VehicleCatalog><Directory "
        'path="."/></VehicleCatalog></CatalogLocations>'
    )
    path.write_text(
        path.read_text(encoding="utf-8").replace("<CatalogLocations/>", located), encoding="utf-8"
    )
    remarks = standard.export(path, version, Folder(tmp_path / "out"))
    hitch = [] if version == "1.3" else ["TrailerHitch: nothing is towed by it"]
    for expected in ("values stand in the place of parameters", "Trailer: it tows nothing", *hitch):
        assert any(expected in remark for remark in remarks), remarks
    exported = tmp_path / "out" / path.name
    assert [each for each in schemas.check(exported) if each.level == "error"] == []
    assert all((rows == motion(exported)[name]).all() for name, rows in motion(path).items())
    with pytest.raises(InvalidFile):
        standard.export(path, version, Folder(tmp_path / "strict"), ExportSettings(strict=True))


@pytest.mark.parametrize("minor", ["1", "3"])
def test_a_trailer_inside_its_tractor_keeps_what_couples_it(minor: str, tmp_path: Path) -> None:
    trailer = (
        car("")
        .partition(">")[2]
        .rpartition("</ScenarioObject>")[0]
        .replace('Category="car"', 'Category="trailer"')
    )
    trailer = trailer.replace("</Axles>", '</Axles><TrailerCoupler dx="4"/>')
    tractor = car("Lead").replace(
        "</Axles>",
        '</Axles><TrailerHitch dx="-1"/><Trailer><Trailer '
        f'name="Box">{trailer}</Trailer></Trailer>',
    )
    path = scenario(tmp_path, entities=[car("Ego"), tractor])
    path.write_text(
        path.read_text(encoding="utf-8").replace('revMinor="3"', f'revMinor="{minor}"'),
        encoding="utf-8",
    )
    with pytest.raises(Unsupported, match="Trailer"):
        standard.export(path, "1.1", Folder(tmp_path / "out"))


@pytest.mark.parametrize(
    "empty", ["<PrivateAction/>", "<PrivateAction><RoutingAction/></PrivateAction>", ""]
)
@pytest.mark.parametrize("version", ["1.0", "1.3"])
def test_an_action_without_content_does_nothing_by_what_it_holds(
    version: str, empty: str, tmp_path: Path
) -> None:
    path = scenario(tmp_path, stories=story("Lead", [(0.5, empty), (1.0, speed_action(5))]))
    remarks = standard.export(path, version, Folder(tmp_path / "out"))
    assert any(remark.endswith("without an action it does nothing") for remark in remarks)
    exported = tmp_path / "out" / path.name
    assert [each for each in schemas.check(exported) if each.level == "error"] == []
    assert all((rows == motion(exported)[name]).all() for name, rows in motion(path).items())
    with pytest.raises(InvalidFile, match="not valid in its own version"):
        standard.export(path, version, Folder(tmp_path / "strict"), ExportSettings(strict=True))


@pytest.mark.parametrize("version", ["1.0", "1.3"])
def test_an_act_without_a_group_does_nothing_by_what_it_holds(version: str, tmp_path: Path) -> None:
    path = scenario(tmp_path, stories='<Story name="s"><Act name="a"><StartTrigger/></Act></Story>')
    (remark,) = [
        each
        for each in standard.export(path, version, Folder(tmp_path / "out"))
        if "Act" in each and "group" in each
    ]
    assert remark.endswith("Act: without a group it does nothing")
    exported = tmp_path / "out" / path.name
    assert [each for each in schemas.check(exported) if each.level == "error"] == []
    assert all((rows == motion(exported)[name]).all() for name, rows in motion(path).items())
