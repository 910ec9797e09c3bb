"""Faults of documents that a run repairs: each is named by a check, played with a remark, and
refused where that is asked for.
"""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import NamedTuple

import pytest

import runner
from schemas import check
from schemas.common.errors import InvalidFile
from tests.conformance.support import track

HERE = Path(__file__).parent
BOM = "\ufeff"
DECLARATION = '<?xml version="1.0" encoding="UTF-8"?>\n'
HEADER = (
    '  <FileHeader revMajor="1" revMinor="3" date="2026-01-01T00:00:00" description="Conformance: '
    'what tests break and runs repair" author="xosc-toolchain"/>\n'
)
XML, VALID, TYPED = (
    "xml.valid_xml_document",
    "xml.valid_schema",
    "parameters.parameter_declaration_parameter_type_inference",
)
VALUE, DIRECTORY = (
    "expressions.expression_has_a_value",
    "reference_control.catalogs_referenced_by_directory",
)
EMPTY, ACTORS = (
    "storyboard.elements_are_not_empty",
    "reference_control.valid_actor_reference_in_private_actions",
)
LENGTH, LANE = "positioning.position_is_on_the_road", "reference_control.lane_exists_on_road"
DISTANCE, TIMING = (
    "positioning.relative_lane_position_has_one_distance",
    "routing.trajectory_timing_exists_if_requested",
)
IN_RUNS = {LANE, LENGTH}
"""Rules of which only a run can know that relative positions break them."""
CONTROLLER = "reference_control.resolvable_controller_reference"
DURATION = "data_type.durations_and_radii_are_not_negative"
SIGNAL = "reference_control.traffic_signal_state_references"
ENTRY = "reference_control.catalog_reference_resolvability"
FILE = "reference_control.resolvable_file_reference"
NAMES = "reference_control.unique_element_names_on_same_level"


class Fault(NamedTuple):
    """A replacement in the sound scenario, the rule that it breaks, the line
    that is named, and the speed in the end (m/s).
    """

    old: str
    new: str
    rule: str
    line: int
    speed: float = 7.0


TRAJECTORY = (
    '<PrivateAction><RoutingAction><FollowTrajectoryAction><TrajectoryRef><Trajectory name="t" '
    'closed="false"><Shape><Polyline>'
    '<Vertex><Position><WorldPosition x="300" y="-1.75"/></Position></Vertex>'
    '<Vertex><Position><WorldPosition x="400" '
    'y="-1.75"/></Position></Vertex></Polyline></Shape></Trajectory></TrajectoryRef>'
    '<TimeReference><Timing domainAbsoluteRelative="relative" offset="0" '
    'scale="1"/></TimeReference>'
    "<TrajectoryFollowingMode "
    'followingMode="position"/></FollowTrajectoryAction></RoutingAction></PrivateAction>'
)


STEADY = '<TargetTimeSteadyState time="1"/>'
SYNCHRONISED = (
    "<PrivateAction><SynchronizeAction "
    'masterEntityRef="$Name"><TargetPositionMaster><WorldPosition x="900" y="-1.75"/>'
    '</TargetPositionMaster><TargetPosition><WorldPosition x="900" y="-1.75"/></TargetPosition>\n'
    "<FinalSpeed><AbsoluteSpeed "
    'value="7">{}</AbsoluteSpeed>{}</FinalSpeed></SynchronizeAction></PrivateAction>'
)
SECOND_VERTEX = '<Vertex><Position><WorldPosition x="400" y="-1.75"/></Position></Vertex>'
NAMELESS = (
    "<GlobalAction><EnvironmentAction><Environment><Weather "
    'cloudState="free"/></Environment></EnvironmentAction></GlobalAction>'
)
MODE = '<TrajectoryFollowingMode followingMode="position"/>'
VISIBLE = '<PrivateAction><VisibilityAction traffic="true" sensors="true"/></PrivateAction>'
SIGNALS = (
    '<TrafficSignals><TrafficSignalController name="s"><Phase name="p" duration="9">'
    '<TrafficSignalState trafficSignalId="0" '
    'state="on"/></Phase></TrafficSignalController></TrafficSignals>'
)
ACTIVATION = (
    '<PrivateAction><ControllerAction><ActivateControllerAction objectControllerRef="pilot" '
    'lateral="false"/></ControllerAction>'
    "</PrivateAction>"
)
WEATHER = (
    '<GlobalAction><EnvironmentAction><Environment name="e"><Weather '
    'cloudState="cloudless"/></Environment></EnvironmentAction>'
    "</GlobalAction>"
)
GEAR = (
    "<PrivateAction><ControllerAction><OverrideControllerValueAction><Gear "
    'active="true" value="2"/>'
    "</OverrideControllerValueAction></ControllerAction></PrivateAction>"
)
CONDITION = (
    '<Condition name="later" conditionEdge="none" delay="0"><ByValueCondition>'
    '<SimulationTimeCondition rule="greaterThan" value="0"/></ByValueCondition></Condition>'
)
ENTRY_OF_CAR = """<CatalogReference catalogName="Vehicles" entryName="car">
        <ParameterAssignments>
          <ParameterAssignment parameterRef="MaxSpeed" value="50"/>
        </ParameterAssignments>
      </CatalogReference>"""
AXLE = 'maxSteering="0.5" wheelDiameter="0.6" trackWidth="1.8" positionX="0.0" positionZ="0.3"'
UNBOXED_CAR = (
    '<Vehicle name="v" vehicleCategory="car"><Performance maxSpeed="50" maxAcceleration="5" '
    'maxDeceleration="9"/>'
    f"<Axles><FrontAxle {AXLE}/><RearAxle {AXLE}/></Axles><Properties/></Vehicle>"
)
CAR_WITHOUT_TRAILER = UNBOXED_CAR.replace(
    "<Performance",
    '<BoundingBox><Center x="1.5" y="0" z="0.75"/><Dimensions width="2" length="5" '
    'height="1.5"/></BoundingBox><Performance',
).replace(
    "</Vehicle>",
    '<Trailer><Trailer name="t"><CatalogReference catalogName="Vehicles" '
    'entryName=""/></Trailer></Trailer></Vehicle>',
)
UNBOXED_PEDESTRIAN = (
    '<Pedestrian name="p" mass="80" pedestrianCategory="pedestrian"><Properties/></Pedestrian>'
)


def placed(position: str) -> str:
    """The end of the ego's Private, and another one that moves it to a position."""
    return (
        '</Private>\n<Private entityRef="$Name"><PrivateAction><TeleportAction><Position>'
        f"{position}</Position></TeleportAction></PrivateAction></Private>\n"
    )


def other(position: str) -> str:
    """The same with a position relative to its lane."""
    return placed(f'<RelativeLanePosition entityRef="$Name" {position}/>')


def untimed(rest: str) -> str:
    """An action that follows a trajectory, with only some of what it needs besides."""
    return (
        TRAJECTORY[: TRAJECTORY.index("<TimeReference>")]
        + rest
        + TRAJECTORY[TRAJECTORY.index("</FollowTrajectoryAction>") :]
    )


def joined(value: str) -> str:
    """The declaration of the name, after those of its parts."""
    parts = {"First": "Eg", "Last": "o"}.items()
    declared = "".join(
        f'name="{name}" parameterType="string" value="{part}"/><ParameterDeclaration '
        for name, part in parts
    )
    return f'{declared}name="Name" parameterType="string" value="{value}"'


FAULTS = {
    # values
    "text typed double": Fault(
        'name="Name" parameterType="string"', 'name="Name" parameterType="double"', TYPED, 8
    ),
    "number typed string": Fault(
        'name="Count" parameterType="int"', 'name="Count" parameterType="string"', VALUE, 7
    ),
    "boolean in capitals": Fault('value="false"', 'value="FALSE"', TYPED, 9),
    "integer with a fraction": Fault('value="2"', 'value="2.0"', TYPED, 7),
    "attribute in capitals": Fault('"$Triggering"', '"False"', VALID, 61),
    "dollar in a declared name": Fault(
        'name="Half"', 'name="$Half"', "parameters.declared_name_is_a_name", 6
    ),
    "declared twice": Fault(
        '<ParameterDeclaration name="Half"',
        '<ParameterDeclaration name="Speed" parameterType="double" '
        'value="20"/><ParameterDeclaration name="Half"',
        "parameters.declarations_are_unique",
        6,
        12.0,
    ),
    "assignment of what is not declared": Fault(
        'parameterRef="MaxSpeed"',
        'parameterRef="TopSpeed"',
        "parameters.assigned_parameter_is_declared",
        26,
    ),
    "compared with a boolean in capitals": Fault(
        'SimulationTimeCondition rule="greaterThan" value="1"',
        'ParameterCondition parameterRef="Triggering" rule="equalTo" value="FALSE"',
        "parameters.value_is_of_the_declared_type",
        110,
        10.0,
    ),
    "texts in a sum": Fault(
        'name="Name" parameterType="string" value="Ego"', joined("${$First + $Last}"), VALUE, 8
    ),
    "texts of several expressions": Fault(
        'name="Name" parameterType="string" value="Ego"',
        joined("${$First}${$Last}"),
        "data_type.allowed_operators",
        8,
    ),
    "parameter without a dollar": Fault(
        "${$Half + $Count}", "${Half + $Count}", "data_type.allowed_operators", 72
    ),
    # structure
    "byte-order mark twice": Fault(DECLARATION, BOM + BOM + DECLARATION, XML, 1),
    "XML declaration in the second line": Fault(DECLARATION, "\n" + DECLARATION, XML, 2),
    "document type": Fault(DECLARATION, DECLARATION.strip() + " <!DOCTYPE OpenSCENARIO>\n", XML, 1),
    "attribute twice": Fault('name="later"', 'name="later" name = "later"', XML, 80),
    "namespace": Fault(
        "<OpenSCENARIO>", '<OpenSCENARIO xmlns="http://example.org/xosc">', VALID, 2
    ),
    "hyphens in a comment": Fault("  <Entities>", "  <!-- a -- b --><Entities>", XML, 22),
    "wrong revision": Fault('revMinor="3"', 'revMinor="0"', VALID, 3),
    "later revision": Fault('revMinor="3"', 'revMinor="9"', VALID, 3),
    "later revision with what came later": Fault(
        HEADER,
        HEADER.replace('revMinor="3"', 'revMinor="4"').replace("/>", "><Later/></FileHeader>"),
        VALID,
        3,
    ),
    "no revision": Fault(' revMajor="1" revMinor="3"', "", "xml.version_is_defined", 3),
    "no header": Fault(HEADER, "\n", "xml.fileheader_is_present", 2),
    "date without a time": Fault("T00:00:00", "", VALID, 3),
    "no delay": Fault(' conditionEdge="none" delay="0"', ' conditionEdge="none"', VALID, 92),
    "no edge": Fault('name="begin" conditionEdge="none"', 'name="begin"', VALID, 92),
    "no rule of entities": Fault(' triggeringEntitiesRule="any"', "", VALID, 94),
    "no maximum of executions": Fault(
        ' maximumExecutionCount="1">\n          <Actors', ">\n          <Actors", VALID, 60
    ),
    "no dx": Fault(
        "        </Private>\n",
        placed('<RelativeObjectPosition entityRef="$Name" dy="0"/>'),
        VALID,
        56,
    ),
    "no dy": Fault(
        "        </Private>\n",
        placed('<RelativeWorldPosition entityRef="$Name" dx="0"/>'),
        VALID,
        56,
    ),
    "no ds": Fault(
        "        </Private>\n",
        placed('<RelativeRoadPosition entityRef="$Name" dt="-1"/>'),
        VALID,
        56,
    ),
    "no dt": Fault(
        "        </Private>\n",
        placed('<RelativeRoadPosition entityRef="$Name" ds="1"/>'),
        VALID,
        56,
    ),
    "no dLane": Fault(
        "        </Private>\n",
        placed('<RelativeLanePosition entityRef="$Name" ds="1"/>'),
        VALID,
        56,
    ),
    "no t": Fault("        </Private>\n", placed('<RoadPosition roadId="1" s="300"/>'), VALID, 56),
    "mode in capitals": Fault('conditionEdge="rising"', 'conditionEdge="Rising"', VALID, 80),
    "attribute in capitals of others": Fault("conditionEdge", "conditionedge", VALID, 80),
    "attribute with a letter less": Fault("conditionEdge", "conditionEge", VALID, 80),
    "element with a letter less": Fault("<LogicFile", "<LogicFil", VALID, 20),
    "name of a reference without its end": Fault(
        "<Private entityRef", "<Private entity", VALID, 37
    ),
    "former name of an attribute": Fault('conditionEdge="rising"', 'edge="rising"', VALID, 80),
    "nothing of visibility": Fault(
        "        </Private>\n", "        " + VISIBLE + "</Private>\n", VALID, 55
    ),
    "no type of a relative speed": Fault(
        '<AbsoluteTargetSpeed value="${$Half + $Count}"/>',
        '<RelativeTargetSpeed entityRef="$Name" value="-3" continuous="false"/>',
        VALID,
        72,
    ),
    "element by the name of its type": Fault(
        "<SpeedActionDynamics", "<TransitionDynamics", VALID, 48
    ),
    "no dynamics of a speed": Fault(
        '<SpeedActionDynamics dynamicsShape="step" dynamicsDimension="time" value="0"/>',
        "",
        VALID,
        47,
    ),
    "value that is none": Fault(
        '"override" maximumExecutionCount="1"', '"override" maximumExecutionCount="None"', VALID, 65
    ),
    "name of the attribute beside it": Fault(
        "        </Private>\n", f"        {GEAR}</Private>\n", VALID, 55
    ),
    "any number of executions": Fault(
        '"override" maximumExecutionCount="1"', '"override" maximumExecutionCount="-1"', VALID, 65
    ),
    "type by another name": Fault('parameterType="boolean"', 'parameterType="bool"', VALID, 9),
    "vehicle without a box": Fault(ENTRY_OF_CAR, UNBOXED_CAR, VALID, 24),
    "pedestrian without a box": Fault(ENTRY_OF_CAR, UNBOXED_PEDESTRIAN, VALID, 24),
    "no name of an event": Fault('<Event name="slower" ', "<Event ", VALID, 65),
    "unknown attribute": Fault('name="later"', 'name="later" colour="red"', VALID, 80),
    "unknown element": Fault("  <Entities>", "  <Weather2/><Entities>", VALID, 22),
    "text in an element": Fault("  <Entities>", "  <Entities>text", VALID, 22),
    "attribute that nothing needs": Fault(
        "      <Actions>\n", f"      <Actions>{WEATHER}\n", VALID, 36
    ),
    "element in another place": Fault(
        "          </Maneuver>\n", "<ParameterDeclarations/></Maneuver>\n", VALID, 88
    ),
    "element twice": Fault(
        "    <LogicFile", '    <LogicFile filepath="../roads/straight.xodr"/><LogicFile', VALID, 20
    ),
    "declarations twice": Fault(
        '    <ParameterDeclaration name="Half"',
        '  </ParameterDeclarations><ParameterDeclarations><ParameterDeclaration name="Half"',
        VALID,
        6,
    ),
    "no times of a trajectory": Fault(
        "        </Private>\n", f"        {untimed(MODE)}</Private>\n", VALID, 55
    ),
    "no mode of following": Fault(
        "        </Private>\n",
        f"        {untimed('<TimeReference><None/></TimeReference>')}</Private>\n",
        VALID,
        55,
    ),
    "no value of a step": Fault(
        ' dynamicsDimension="time" value="0"', ' dynamicsDimension="time"', VALID, 48
    ),
    # the storyboard
    "empty private": Fault(
        "        </Private>\n", '        </Private><Private entityRef="$Name"/>\n', EMPTY, 55
    ),
    "empty action": Fault(
        "              <StartTrigger>\n",
        '              <Action name="None"/><StartTrigger>\n',
        EMPTY,
        78,
    ),
    "empty kind of action": Fault(
        "              <StartTrigger>\n",
        "              <Action "
        'name="None"><PrivateAction><RoutingAction/></PrivateAction></Action><StartTrigger>\n',
        EMPTY,
        78,
    ),
    "empty event": Fault(
        "          </Maneuver>\n",
        '<Event name="none" priority="parallel"/></Maneuver>\n',
        EMPTY,
        88,
    ),
    "empty maneuver": Fault(
        "          </Maneuver>\n", '          </Maneuver><Maneuver name="none"/>\n', EMPTY, 88
    ),
    "empty group": Fault(
        "        </ManeuverGroup>\n",
        '</ManeuverGroup><ManeuverGroup name="none" maximumExecutionCount="1"><Actors '
        'selectTriggeringEntities="false"/>'
        "</ManeuverGroup>\n",
        EMPTY,
        89,
    ),
    "empty act": Fault("      </Act>\n", '      </Act><Act name="none"/>\n', EMPTY, 104),
    "empty story": Fault("    </Story>\n", '    </Story><Story name="none"/>\n', EMPTY, 105),
    "no triggering entities": Fault(
        '<TriggeringEntities triggeringEntitiesRule="any">\n                  <EntityRef '
        'entityRef="$Name"/>',
        '<TriggeringEntities triggeringEntitiesRule="all">',
        EMPTY,
        94,
    ),
    "collision with no one": Fault(
        '<SpeedCondition rule="greaterThan" value="1"/>', "<CollisionCondition/>", EMPTY, 98, 10.0
    ),
    "name of the condition beside it": Fault(
        '<Condition name="later"', f'{CONDITION}<Condition name="later"', NAMES, 80
    ),
    "negative duration": Fault(
        '<SpeedCondition rule="greaterThan" value="1"/>',
        '<StandStillCondition duration="-1"/>',
        DURATION,
        98,
        10.0,
    ),
    "empty group of conditions": Fault(
        "    <StopTrigger>\n", "    <StopTrigger><ConditionGroup/>\n", EMPTY, 106
    ),
    "no actors": Fault(
        '            <EntityRef entityRef="$Name"/>\n          </Actors>',
        "          </Actors>",
        ACTORS,
        61,
        10.0,
    ),
    "no element of actors": Fault(
        '          <Actors selectTriggeringEntities="$Triggering">\n            <EntityRef '
        'entityRef="$Name"/>\n'
        "          </Actors>",
        "",
        VALID,
        60,
        10.0,
    ),
    "activation of no controller": Fault(
        "        </Private>\n", f"        {ACTIVATION}</Private>\n", CONTROLLER, 55
    ),
    "state of no signal": Fault(
        'roads/straight.xodr"/>', f'roads/straight.xodr"/>{SIGNALS}', SIGNAL, 20
    ),
    # positions and trajectories
    "s beyond the end": Fault('s="300"', 's="1300"', LENGTH, 41, 0.0),
    "s before the beginning": Fault('s="300"', 's="-3"', LENGTH, 41),
    "no distance along the lane": Fault("        </Private>\n", other('dLane="-1"'), DISTANCE, 56),
    "relative position beyond the end": Fault(
        "        </Private>\n", other('dLane="-1" ds="2000"'), LENGTH, 56, 0.0
    ),
    "along the lane beyond its end": Fault(
        "        </Private>\n", other('dLane="-1" dsLane="2000"'), LENGTH, 56, 0.0
    ),
    "lane beside the road": Fault("        </Private>\n", other('dLane="-3" ds="10"'), LANE, 56),
    "two positions": Fault(
        "        </Private>\n",
        placed('<LanePosition roadId="1" laneId="-1" s="300"/><WorldPosition x="0" y="0"/>'),
        VALID,
        56,
    ),
    "polyline of one vertex": Fault(
        "        </Private>\n",
        "        "
        + untimed(f"<TimeReference><None/></TimeReference>{MODE}").replace(SECOND_VERTEX, "")
        + "</Private>\n",
        VALID,
        55,
    ),
    "environment without a name": Fault(
        "      <Actions>\n", f"      <Actions>{NAMELESS}\n", VALID, 36
    ),
    "value that begins another": Fault('dynamicsShape="step"', 'dynamicsShape="ste"', VALID, 48),
    "dynamics without a dimension": Fault(
        'dynamicsShape="step" dynamicsDimension="time" value="0"',
        'dynamicsShape="linear" value="0"',
        VALID,
        48,
    ),
    "dynamics in an element of their own": Fault(
        '<SpeedActionDynamics dynamicsShape="step" dynamicsDimension="time" value="0"/>',
        '<SpeedActionDynamics>\n<Dynamics dynamicsShape="step" dynamicsDimension="time" '
        'value="0"/></SpeedActionDynamics>',
        VALID,
        49,
    ),
    "steady state beside the speed": Fault(
        "        </Private>\n", SYNCHRONISED.format("", STEADY) + "</Private>\n", VALID, 56
    ),
    "steady state too deep": Fault(
        "        </Private>\n",
        SYNCHRONISED.format(f"<SteadyState>{STEADY}</SteadyState>", "") + "</Private>\n",
        VALID,
        56,
    ),
    "placeholder in a path": Fault(
        'filepath="../roads/straight.xodr"', 'filepath="${ROOT}/roads/straight.xodr"', FILE, 20
    ),
    "times of no trajectory": Fault(
        "        </Private>\n", "        " + TRAJECTORY + "</Private>\n", TIMING, 55
    ),
    # catalogues
    "directory is a file": Fault('path="catalogs"', 'path="catalogs/vehicles.xosc"', DIRECTORY, 13),
    "file is elsewhere": Fault('path="catalogs"', 'path="elsewhere/vehicles.xosc"', DIRECTORY, 13),
    "directory is elsewhere": Fault('path="catalogs"', 'path="../library/catalogs"', DIRECTORY, 13),
    "catalogue by its file": Fault('catalogName="Vehicles"', 'catalogName="vehicles"', ENTRY, 24),
    "trailer without a name": Fault(ENTRY_OF_CAR, CAR_WITHOUT_TRAILER, ENTRY, 24),
    "no such controller": Fault('entryName="driver"', 'entryName="pilot"', ENTRY, 30),
    "no catalogue of controllers": Fault(
        'catalogName="Controllers"', 'catalogName="Pilots"', ENTRY, 30
    ),
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    shutil.copytree(HERE / "repairs", tmp_path / "repairs")
    shutil.copytree(HERE / "roads", tmp_path / "roads")
    return tmp_path / "repairs"


def run(scenario: Path, **options: object) -> runner.RunResult:
    return runner.run(scenario, **{"sut": None, "timestep": 0.05, "world": "kinematic", **options})


def repairs(result: runner.RunResult) -> tuple[str, ...]:
    """The remarks on places in files, without those on actions under way at the end."""
    return tuple(
        remark for remark in result.remarks if ".xosc:" in remark and "its goal is" not in remark
    )


def test_the_sound_scenario_has_no_remark(folder: Path) -> None:
    assert check(folder / "sound.xosc") == []
    result = run(folder / "sound.xosc", strict=True)
    assert repairs(result) == () and track(result, "Ego")["speed"][-1] == 7.0


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_named_repaired_with_a_remark_and_refused_if_strict(
    folder: Path, name: str
) -> None:
    fault = FAULTS[name]
    text = (folder / "sound.xosc").read_text(encoding="utf-8")
    assert fault.old in text
    broken = folder / "broken.xosc"
    broken.write_text(text.replace(fault.old, fault.new, 1), encoding="utf-8")
    if not ("Relative" in fault.new and fault.rule in IN_RUNS):
        assert any(problem.rule.endswith(fault.rule) for problem in check(broken))
    result = run(broken)
    *others, remark = [
        each
        for each in repairs(result)
        if "its private actions have no actor" not in each or fault.rule == ACTORS
    ]
    if name == "wrong revision":
        remark, others = others[0], []
        assert (
            f"{broken}:3: the header has the revision 1.0, the content is that of version "
            "1.1: 1.0 has no expr"
        ) in remark
    assert all(
        "the content is that of version" in each or "it is read as version 1.3" in each
        for each in others
    )
    assert remark.startswith(f"{broken}:{fault.line}: ") and remark.endswith(f":{fault.rule}]")
    assert track(result, "Ego")["speed"][-1] == fault.speed
    with pytest.raises(InvalidFile, match=VALID if others else fault.rule):
        run(broken, strict=True)


def test_a_parameter_may_say_that_there_is_no_value(folder: Path) -> None:
    text = (folder / "sound.xosc").read_text(encoding="utf-8")
    text = text.replace(
        'name="Half"',
        'name="Offset" parameterType="string" value="None"/><ParameterDeclaration name="Half"',
    )
    broken = folder / "broken.xosc"
    broken.write_text(text.replace('offset="0"', 'offset="$Offset"'), encoding="utf-8")
    (remark,) = repairs(run(broken))
    assert remark.startswith(f"{broken}:41: offset='None' is no value; the attribute is left out")
    with pytest.raises(InvalidFile, match="offset='None'"):
        run(broken, strict=True)


def test_a_reference_to_a_name_that_looks_like_an_expression_is_no_expression(folder: Path) -> None:
    name = "${$Name + slows down}"
    state = (
        '<StoryboardElementStateCondition storyboardElementType="event" '
        f'storyboardElementRef="{name}" state="completeState"/>'
    )
    end = (
        '<Condition name="end" conditionEdge="none" '
        f'delay="0"><ByValueCondition>{state}</ByValueCondition></Condition>'
    )
    text = (
        (folder / "sound.xosc")
        .read_text(encoding="utf-8")
        .replace('<Event name="slower"', f'<Event name="{name}"')
    )
    broken = folder / "broken.xosc"
    broken.write_text(
        text.replace(
            "    <StopTrigger>", f"    <StopTrigger><ConditionGroup>{end}</ConditionGroup>"
        ),
        encoding="utf-8",
    )
    result = run(broken)
    (remark,) = repairs(result)
    assert "an element has this name as it stands, and is meant" in remark
    assert result.end_time < run(folder / "sound.xosc").end_time
    with pytest.raises(InvalidFile, match="as it stands"):
        run(broken, strict=True)
