"""Actions that are executed run by run in a batch in arrays, and values that conditions compare
there, are those of the interpreter.
"""

from pathlib import Path

import pytest

import runner
from benchmarks.arrays import differences, played
from runner.batch.arrays import obstacle, structures
from runner.judging.settings import RunSettings
from tests.runner.document_case import BASE, ROADS

SETTINGS = RunSettings(world="kinematic", sut="none", max_time=8.0)
ACTION = BASE[BASE.index("<PrivateAction", BASE.index("<Event")) : BASE.index("</Action>")]
GLOBAL = "<GlobalAction><VariableAction variableRef='level'>{}</VariableAction></GlobalAction>"
LEVEL = """<Condition name="level" delay="0" conditionEdge="none"><ByValueCondition>
<VariableCondition variableRef="level" rule="greaterThan" value="$Varied"/></ByValueCondition></Condition>"""
TRAJECTORY = """<PrivateAction><RoutingAction><FollowTrajectoryAction><TrajectoryRef>
<Trajectory name="way" closed="false"><ParameterDeclarations/><Shape><Polyline>
<Vertex><Position><WorldPosition x="160" y="-6"/></Position></Vertex>
<Vertex><Position><WorldPosition x="${160 + 2 * $Varied}" y="$Varied"/></Position></Vertex>
</Polyline></Shape></Trajectory></TrajectoryRef><TimeReference><None/></TimeReference>
<TrajectoryFollowingMode followingMode="position"/></FollowTrajectoryAction></RoutingAction></PrivateAction>"""
MEETING = """<PrivateAction><SynchronizeAction masterEntityRef="Ego">
<TargetPositionMaster><LanePosition roadId="1" laneId="-1" s="${150 + $Varied}"/></TargetPositionMaster>
<TargetPosition><LanePosition roadId="1" laneId="-2" s="190"/></TargetPosition>
<FinalSpeed><AbsoluteSpeed value="12"/></FinalSpeed></SynchronizeAction></PrivateAction>"""
PROFILE = """<PrivateAction><LongitudinalAction><SpeedProfileAction followingMode="follow">
<SpeedProfileEntry speed="${5 + $Varied}" time="2"/><SpeedProfileEntry speed="8" time="2"/>
</SpeedProfileAction></LongitudinalAction></PrivateAction>"""
KEPT = """<PrivateAction><LongitudinalAction><LongitudinalDistanceAction entityRef="Ego"
 distance="$Varied" freespace="true" continuous="true" displacement="leadingReferencedEntity"
 coordinateSystem="lane"><DynamicConstraints maxAcceleration="3" maxDeceleration="4" maxSpeed="30"/>
</LongitudinalDistanceAction></LongitudinalAction></PrivateAction>"""
GAP_IN_TIME = (
    KEPT.replace('distance="$Varied" ', 'timeGap="${$Varied / 10}" ')
    .replace("leading", "trailing")
    .replace('freespace="true" continuous="true"', 'freespace="false" continuous="false"')
    .replace('maxSpeed="30"', 'maxSpeed="30" maxAccelerationRate="3" maxDecelerationRate="$Varied"')
)
IN_ITS_AXES = KEPT.replace('System="lane"', 'System="entity"').replace('maxDeceleration="4" ', "")
TELEPORT = """<PrivateAction><TeleportAction><Position>
<LanePosition roadId="1" laneId="-2" s="${160 + $Varied}"/></Position></TeleportAction></PrivateAction>"""
BESIDE = """<PrivateAction><LateralAction><LaneOffsetAction continuous="false">
<LaneOffsetActionDynamics dynamicsShape="sinusoidal" maxLateralAcc="2"/><LaneOffsetTarget>
<RelativeTargetLaneOffset entityRef="Ego" value="${$Varied / 10}"/></LaneOffsetTarget>
</LaneOffsetAction></LateralAction></PrivateAction>"""


DECLARED = """<ParameterDeclarations><ParameterDeclaration name="Varied" parameterType="double" value="9"/>
</ParameterDeclarations><VariableDeclarations>
<VariableDeclaration name="level" variableType="double" value="$Varied"/></VariableDeclarations>"""


def case(folder: Path, action: str, later: str = "") -> Path:
    """A scenario with a parameter and a variable, in which Other acts at 1 s,
    and later in a second event.
    """
    text = BASE.format(road=ROADS / "straight.xodr")
    text = text.replace("<ParameterDeclarations/>", DECLARED, 1)
    begin = text.index("<PrivateAction", text.index("<Event "))
    text = text[:begin] + action + text[text.index("</Action>", begin) :]
    text = text.replace("</Maneuver>", f"{later}</Maneuver>", 1)
    path = folder / "case.xosc"
    path.write_text(text, encoding="utf-8")
    return path


def compared(path: Path, *values: float) -> list[float]:
    """Last places of Other along the road (m) by value of the parameter, once
    all are those of the interpreter.
    """
    sets = [{"Varied": str(value)} for value in values]
    together = played(path, sets, SETTINGS)
    assert sorted(together) == list(range(len(sets)))
    ends = []
    for number, parameters in enumerate(sets):
        single = runner.run(path, SETTINGS, parameters=parameters)
        assert list(differences(*together[number], single)) == []
        ends.append(float(single.recording.tracks["Other"].columns["x"][-1]))
    return ends


@pytest.mark.parametrize(
    "action",
    [TRAJECTORY, MEETING, PROFILE, KEPT, GAP_IN_TIME, IN_ITS_AXES],
    ids=("trajectory", "meeting", "profile", "kept", "gap in time", "in its axes"),
)
def test_actions_that_are_executed_run_by_run_are_those_of_the_interpreter(
    tmp_path: Path, action: str
) -> None:
    assert len(set(compared(case(tmp_path, action), 4.0, 9.0, 11.5))) == 3


def test_a_teleport_in_the_course_of_a_run_shows_at_its_time(tmp_path: Path) -> None:
    """The instant of the event has the new place, at which motion goes on from there; leaps of more
    than 10 m are left to the interpreter."""
    assert len(set(compared(case(tmp_path, TELEPORT), 4.0, 6.0, 8.0))) == 3
    assert played(case(tmp_path, TELEPORT), [{"Varied": "11.5"}], SETTINGS) == {}


def test_an_offset_relative_to_another_entity_is_that_of_the_interpreter(tmp_path: Path) -> None:
    compared(case(tmp_path, BESIDE), 4.0, 9.0)


LATER = """<Event name="later" priority="parallel"><Action name="brake"><PrivateAction><LongitudinalAction>
<SpeedAction><SpeedActionDynamics dynamicsShape="step" value="0" dynamicsDimension="time"/><SpeedActionTarget>
<AbsoluteTargetSpeed value="2"/></SpeedActionTarget></SpeedAction></LongitudinalAction></PrivateAction></Action>
<StartTrigger><ConditionGroup>{}</ConditionGroup><ConditionGroup>
<Condition name="late" delay="0" conditionEdge="none"><ByValueCondition>
<SimulationTimeCondition value="4" rule="greaterThan"/></ByValueCondition></Condition>
</ConditionGroup></StartTrigger></Event>"""


@pytest.mark.parametrize(
    ("change", "brakes"),
    [
        ('<SetAction value="$Varied"/>', [False, False]),
        ('<SetAction value="10"/>', [True, False]),
        ('<ModifyAction><Rule><AddValue value="3"/></Rule></ModifyAction>', [True, True]),
        (
            '<ModifyAction><Rule><MultiplyByValue value="0.5"/></Rule></ModifyAction>',
            [False, False],
        ),
    ],
)
def test_variables_that_actions_change_are_compared_as_by_the_interpreter(
    tmp_path: Path, change: str, brakes: list[bool]
) -> None:
    path = case(tmp_path, GLOBAL.format(change), LATER.format(LEVEL))
    assert [end < 180.0 for end in compared(path, 9.0, 11.0)] == brakes


def test_an_action_that_a_set_makes_impossible_leaves_that_set_to_the_interpreter(
    tmp_path: Path,
) -> None:
    path = case(tmp_path, PROFILE.replace('time="2"', 'time="${$Varied - 5}"', 1))
    assert sorted(played(path, [{"Varied": "9"}, {"Varied": "4"}], SETTINGS)) == [0]
    assert not obstacle(path, SETTINGS)


def test_sets_that_break_a_constraint_are_left_to_the_interpreter(tmp_path: Path) -> None:
    path = case(tmp_path, PROFILE)
    limited = """value="9"><ConstraintGroup><ValueConstraint rule="lessThan" value="10"/></ConstraintGroup>
</ParameterDeclaration>"""
    path.write_text(path.read_text("utf-8").replace('value="9"/>', limited, 1), "utf-8")
    sets = [{"Varied": value} for value in ("8", "12", "9")]
    found = structures(path, sets, SETTINGS)
    assert [each.members.tolist() for each in found] == [[0, 2]]
