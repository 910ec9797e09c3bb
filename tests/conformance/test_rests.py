"""Each action that ends says what its goal was; what is left of it is a remark."""

from __future__ import annotations

from pathlib import Path

import pytest

import runner
from tests.conformance.support import events
from tests.runner.files import car, place, scenario, speed_action, story


def rests(result: runner.RunResult) -> list[str]:
    return [remark for remark in result.remarks if "its goal is" in remark]


def played(folder: Path, action: str, performance: str = "", **options: object) -> runner.RunResult:
    entities = [car("Ego"), car("Lead", performance=performance)]
    path = scenario(folder, entities=entities, stories=story("Lead", [(0.5, action)]), stop=8.0)
    return runner.run(path, **{"sut": None, "timestep": 0.05, "world": "kinematic", **options})


SLOW = 'maxSpeed="14" maxAcceleration="10" maxDeceleration="10"'
FOLLOW = 'dynamicsShape="{}" dynamicsDimension="rate" value="5" followingMode="{}"'


def test_a_speed_beyond_the_performance_is_a_rest(tmp_path: Path) -> None:
    (remark,) = rests(played(tmp_path, speed_action(40, FOLLOW.format("linear", "follow")), SLOW))
    assert "the action 'action0' of Lead ends at 1.3" in remark
    assert "its goal is 40.00 m/s, it has reached 14.00 m/s" in remark
    assert "scenario.xosc:" in remark


def test_a_step_beyond_the_performance_is_a_rest(tmp_path: Path) -> None:
    (remark,) = rests(played(tmp_path, speed_action(40, FOLLOW.format("step", "follow")), SLOW))
    assert "its goal is 40.00 m/s, it has reached 14.00 m/s" in remark


def test_a_goal_that_is_reached_is_in_the_log_alone(tmp_path: Path) -> None:
    result = played(tmp_path, speed_action(12, FOLLOW.format("linear", "follow")), SLOW)
    assert rests(result) == []
    (entry,) = events(result, "goal")
    assert entry.text == "Lead: its goal is 12.00 m/s, it has reached 12.00 m/s"


def test_a_jerk_of_the_performance_shapes_a_change_of_speed_that_follows(tmp_path: Path) -> None:
    limited = f'{SLOW} maxAccelerationRate="2" maxDecelerationRate="2"'
    over_time = 'dynamicsShape="linear" dynamicsDimension="time" value="4" followingMode="follow"'
    result = played(tmp_path, speed_action(13, over_time), limited)
    speed = result.recording.tracks["Lead"].columns["speed"]
    jerks = abs(speed[2:] - 2.0 * speed[1:-1] + speed[:-2]) / 0.05**2
    assert jerks.max() <= 2.0 + 1e-6
    assert (speed[89], speed[91]) == (pytest.approx(13.0, abs=0.01), 13.0)


@pytest.mark.parametrize("most", [20, 8])
def test_a_trajectory_that_comes_late_is_a_rest(most: int, tmp_path: Path) -> None:
    """40 m in 4 s are possible with at most 20 m/s, and take a second more with 8 m/s."""
    vertices = "".join(
        f'<Vertex time="{time}"><Position><WorldPosition x="{150 + 10 * time}" '
        'y="-1.75"/></Position></Vertex>'
        for time in (0, 4)
    )
    action = (
        "<PrivateAction><RoutingAction><FollowTrajectoryAction><TrajectoryRef>"
        '<Trajectory name="t" '
        f'closed="false"><Shape><Polyline>{vertices}</Polyline></Shape></Trajectory>'
        '</TrajectoryRef><TimeReference><Timing domainAbsoluteRelative="relative" '
        'offset="0" scale="1"/>'
        '</TimeReference><TrajectoryFollowingMode followingMode="follow"/></FollowTrajectoryAction>'
        "</RoutingAction></PrivateAction>"
    )
    path = scenario(
        tmp_path,
        entities=[
            car("Lead", performance=f'maxSpeed="{most}" maxAcceleration="10" maxDeceleration="10"')
        ],
        init=place("Lead", 150, min(most, 10)),
        stories=story("Lead", [(0.5, action)]),
        stop=8.0,
    )
    result = runner.run(path, sut=None, timestep=0.05, world="kinematic")
    late = [remark for remark in rests(result) if "the end of its trajectory at" in remark]
    assert len(late) == (most < 10)


def test_a_synchronisation_whose_master_jumps_says_what_is_left(tmp_path: Path) -> None:
    synchronise = (
        '<PrivateAction><SynchronizeAction masterEntityRef="Ego" targetTolerance="0" '
        'targetToleranceMaster="0">'
        '<TargetPositionMaster><LanePosition roadId="1" laneId="-1" '
        's="140"/></TargetPositionMaster>'
        '<TargetPosition><LanePosition roadId="1" laneId="-1" s="190"/></TargetPosition>'
        "</SynchronizeAction></PrivateAction>"
    )
    jump = (
        '<PrivateAction><TeleportAction><Position><LanePosition roadId="1" laneId="-1" s="145"/>'
        "</Position></TeleportAction></PrivateAction>"
    )
    hurry = story("Lead", [(0.0, synchronise)]) + story("Ego", [(1.0, jump)]).replace(
        'name="story"', 'name="other"'
    )
    init = place("Ego", 100, 20) + place("Lead", 150, 2)
    result = runner.run(
        scenario(tmp_path, init=init, stories=hurry, stop=4.0),
        sut=None,
        timestep=0.05,
        world="kinematic",
    )
    (remark,) = rests(result)
    assert "its goal is both at their targets" in remark


SMOOTH = 'dynamicsShape="sinusoidal" dynamicsDimension="time" value="6"'
CHANGE = (
    f"<PrivateAction><LateralAction><LaneChangeAction><LaneChangeActionDynamics {SMOOTH}/>"
    '<LaneChangeTarget><AbsoluteTargetLane value="1"/></LaneChangeTarget></LaneChangeAction>'
    "</LateralAction></PrivateAction>"
)
APPROACH = (
    '<PrivateAction><LongitudinalAction><LongitudinalDistanceAction entityRef="Ego" distance="20"'
    ' freespace="false" continuous="{}" displacement="any"><DynamicConstraints maxAcceleration="1"'
    ' maxDeceleration="1" '
    'maxSpeed="40"/></LongitudinalDistanceAction></LongitudinalAction></PrivateAction>'
)
ACQUIRE = (
    "<PrivateAction><RoutingAction><AcquirePositionAction><Position>"
    '<LanePosition roadId="1" laneId="-1" s="400"/></Position></AcquirePositionAction>'
    "</RoutingAction></PrivateAction>"
)
TRAJECTORY = (
    "<PrivateAction><RoutingAction><FollowTrajectoryAction><TrajectoryRef>"
    '<Trajectory name="t" closed="{}"><Shape><Polyline>'
    '<Vertex><Position><WorldPosition x="150" y="-1.75"/></Position></Vertex>'
    '<Vertex><Position><WorldPosition x="450" y="-1.75"/></Position></Vertex>'
    "</Polyline></Shape></Trajectory></TrajectoryRef><TimeReference><None/></TimeReference>"
    '<TrajectoryFollowingMode followingMode="position"/></FollowTrajectoryAction>'
    "</RoutingAction></PrivateAction>"
)
PROFILE = (
    '<PrivateAction><LongitudinalAction><SpeedProfileAction followingMode="position">'
    '<SpeedProfileEntry speed="12" time="2"/><SpeedProfileEntry speed="10" time="4"/>'
    "</SpeedProfileAction></LongitudinalAction></PrivateAction>"
)
SYNCHRONISE = (
    '<PrivateAction><SynchronizeAction masterEntityRef="Ego">'
    '<TargetPositionMaster><LanePosition roadId="1" laneId="-1" s="300"/></TargetPositionMaster>'
    '<TargetPosition><LanePosition roadId="1" laneId="-1" s="280"/></TargetPosition>'
    "</SynchronizeAction></PrivateAction>"
)
UNDER_WAY = {
    "speed": (speed_action(20, SMOOTH), "its goal is 20.00 m/s, it has reached 12.5"),
    "profile": (PROFILE, "10.00 m/s at the end of its profile, it has reached 12.00 m/s 4.00 s"),
    "lane change": (CHANGE, "0.00 m left of the centre of lane 1, it has reached -2.6"),
    "distance": (APPROACH.format("false"), "its goal is its distance, it has reached "),
    "position": (ACQUIRE, "its goal is s = 400.0 m of road 1, it has reached 225.0 m before it"),
    "trajectory": (TRAJECTORY.format("false"), "its goal is the end of its trajectory, it has"),
    "synchronisation": (SYNCHRONISE, "both at their targets, it has reached "),
}


@pytest.mark.parametrize("limit", [True, False], ids=["--max-time", "StopTrigger"])
@pytest.mark.parametrize("action", UNDER_WAY)
def test_an_action_under_way_at_the_end_of_the_run_says_what_is_left(
    action: str, limit: bool, tmp_path: Path
) -> None:
    xml, expected = UNDER_WAY[action]
    path = scenario(tmp_path, stories=story("Lead", [(0.5, xml)]), stop=8.0 if limit else 2.5)
    result = runner.run(path, sut=None, timestep=0.05, world="kinematic", max_time=2.5)
    (remark,) = rests(result)
    assert "the action 'action0' of Lead is under way when the run stops at 2.50 s: " in remark
    assert expected in remark


@pytest.mark.parametrize("xml", [TRAJECTORY.format("true"), APPROACH.format("true")])
def test_an_action_without_an_end_is_not_said_to_be_under_way(xml: str, tmp_path: Path) -> None:
    path = scenario(tmp_path, stories=story("Lead", [(0.5, xml)]), stop=2.5)
    assert rests(runner.run(path, sut=None, timestep=0.05, world="kinematic")) == []


def test_a_trajectory_that_is_driven_back_ends_at_its_beginning(tmp_path: Path) -> None:
    """100 m along it at the start, and 2.5 s back at 10 m/s."""
    faced = TRAJECTORY.format("false").replace('y="-1.75"/>', 'y="-1.75" h="0"/>')
    faced = faced.replace(
        "<FollowTrajectoryAction>", '<FollowTrajectoryAction initialDistanceOffset="100">'
    )
    init = place("Ego", 600, 0) + place("Lead", 150, -10)
    path = scenario(tmp_path, init=init, stories=story("Lead", [(0.0, faced)]), stop=2.5)
    (remark,) = rests(runner.run(path, sut=None, timestep=0.05, world="kinematic"))
    assert "it has reached 75.0 m before it" in remark
