"""One place, reached in five ways: everything that is said of the entity there is the same.

A car gets from lane -2 of a straight road into the middle of lane -1, or is put there. One second
later, others count lanes
from it and are put beside it, and it changes lanes itself.
"""

from __future__ import annotations

from pathlib import Path

import pytest

import runner
from runner.systems import Control, Observation, Participant
from tests.conformance.support import at, track

ROAD = Path(__file__).parent / "roads" / "straight.xodr"
LANE = 3.5
LEFT = -0.5 * LANE
"""t of the middle of lane -1, m"""

OWN_LANE = '<LanePosition roadId="1" laneId="-2" s="50"/>'
WAYS = {
    "lane change": (
        OWN_LANE,
        '<LateralAction><LaneChangeAction><LaneChangeActionDynamics dynamicsShape="cubic" value="3"'
        ' dynamicsDimension="time"/><LaneChangeTarget><AbsoluteTargetLane '
        'value="-1"/></LaneChangeTarget>'
        "</LaneChangeAction></LateralAction>",
    ),
    "lane offset": (
        OWN_LANE,
        '<LateralAction><LaneOffsetAction continuous="false"><LaneOffsetActionDynamics '
        'maxLateralAcc="3"'
        ' dynamicsShape="cubic"/><LaneOffsetTarget><AbsoluteTargetLaneOffset '
        'value="3.5"/></LaneOffsetTarget>'
        "</LaneOffsetAction></LateralAction>",
    ),
    "lane position": ('<LanePosition roadId="1" laneId="-2" s="50" offset="3.5"/>', ""),
    "world position": (f'<WorldPosition x="50" y="{LEFT}" z="0" h="0"/>', ""),
    "trajectory": (
        OWN_LANE,
        '<RoutingAction><FollowTrajectoryAction><TrajectoryRef><Trajectory name="t" '
        'closed="false"><Shape><Polyline>'
        '<Vertex time="0"><Position><WorldPosition x="60" y="-5.25"/></Position></Vertex>'
        f'<Vertex time="3"><Position><WorldPosition x="90" y="{LEFT}"/></Position></Vertex>'
        f'<Vertex time="4"><Position><WorldPosition x="100" y="{LEFT}"/></Position></Vertex>'
        "</Polyline></Shape></Trajectory></TrajectoryRef>"
        '<TimeReference><Timing domainAbsoluteRelative="relative" offset="0" '
        'scale="1"/></TimeReference>'
        "<TrajectoryFollowingMode "
        'followingMode="position"/></FollowTrajectoryAction></RoutingAction>',
    ),
}


def action(name: str, actor: str, body: str, time: float) -> str:
    return f"""<ManeuverGroup name="g{name}" maximumExecutionCount="1"><Actors selectTriggeringEntities="false">
    <EntityRef entityRef="{actor}"/></Actors><Maneuver name="m{name}"><Event name="e{name}" priority="override">
    <Action name="a{name}"><PrivateAction>{body}</PrivateAction></Action><StartTrigger><ConditionGroup>
    <Condition name="c" delay="0" conditionEdge="none"><ByValueCondition>
    <SimulationTimeCondition value="{time}" rule="greaterThan"/></ByValueCondition></Condition></ConditionGroup>
    </StartTrigger></Event></Maneuver></ManeuverGroup>"""


def relative_change(reference: str, lanes: int) -> str:
    return f"""<LateralAction><LaneChangeAction><LaneChangeActionDynamics dynamicsShape="step" value="0"
    dynamicsDimension="time"/><LaneChangeTarget><RelativeTargetLane entityRef="{reference}" value="{lanes}"/>
    </LaneChangeTarget></LaneChangeAction></LateralAction>"""


def scenario(start: str, way: str) -> str:
    entities = "".join(
        f"""<ScenarioObject name="{name}"><Vehicle name="car" vehicleCategory="car"><BoundingBox>
        <Center x="1.4" y="0" z="0.75"/><Dimensions length="5" width="2" height="1.5"/></BoundingBox>
        <Performance maxSpeed="70" maxAcceleration="20" maxDeceleration="20"/><Axles>
        <FrontAxle maxSteering="0.5" wheelDiameter="0.6" trackWidth="1.7" positionX="2.8" positionZ="0.3"/>
        <RearAxle maxSteering="0" wheelDiameter="0.6" trackWidth="1.7" positionX="0" positionZ="0.3"/></Axles>
        <Properties/></Vehicle></ScenarioObject>"""
        for name in ("Car", "Follower", "Placed")
    )
    starts = {"Car": start, "Follower": '<LanePosition roadId="1" laneId="-2" s="20"/>'}
    starts["Placed"] = '<LanePosition roadId="1" laneId="1" s="200"/>'
    speeds = {"Car": 10, "Follower": 10, "Placed": 0}
    first = "".join(
        f"""<Private entityRef="{name}"><PrivateAction><TeleportAction><Position>{position}</Position></TeleportAction>
        </PrivateAction><PrivateAction><LongitudinalAction><SpeedAction><SpeedActionDynamics dynamicsShape="step" value="0"
        dynamicsDimension="time"/><SpeedActionTarget><AbsoluteTargetSpeed value="{speeds[name]}"/></SpeedActionTarget>
        </SpeedAction></LongitudinalAction></PrivateAction></Private>"""
        for name, position in starts.items()
    )
    teleport = (
        '<TeleportAction><Position><RelativeLanePosition entityRef="Car" dLane="0" '
        'ds="-10"/></Position></TeleportAction>'
    )
    groups = "".join(
        [
            action("Way", "Car", way, 1.0) if way else "",
            action("Follow", "Follower", relative_change("Car", 0), 7.0),
            action("Place", "Placed", teleport, 7.0),
            action("Own", "Car", relative_change("Car", -1), 8.0),
        ]
    )
    always = """<StartTrigger><ConditionGroup><Condition name="c" delay="0" conditionEdge="none"><ByValueCondition>
    <SimulationTimeCondition value="0" rule="greaterOrEqual"/></ByValueCondition></Condition></ConditionGroup></StartTrigger>"""
    return f"""<OpenSCENARIO><FileHeader revMajor="1" revMinor="2" date="2026-01-01T00:00:00" author="" description=""/>
    <CatalogLocations/><RoadNetwork><LogicFile filepath="{ROAD}"/></RoadNetwork><Entities>{entities}</Entities>
    <Storyboard><Init><Actions>{first}</Actions></Init><Story name="s"><Act name="a">{groups}{always}</Act></Story>
    <StopTrigger><ConditionGroup><Condition name="c" delay="0" conditionEdge="none"><ByValueCondition>
    <SimulationTimeCondition value="9" rule="greaterThan"/></ByValueCondition></Condition></ConditionGroup></StopTrigger>
    </Storyboard></OpenSCENARIO>"""


class Witness:
    """A system under test that answers nothing, and notes where roads say that the ego is."""

    def reset(self, ego: Participant, timestep: float, seed: int) -> None:
        self.lanes: dict[float, int] = {}

    def control(self, observation: Observation, dt: float) -> Control:
        ego = observation.ego
        assert observation.network is not None
        self.lanes[round(observation.time, 6)] = observation.network.locate(ego.x, ego.y).lane_id
        return Control()


@pytest.mark.parametrize("way", WAYS)
def test_everything_said_of_a_place_is_the_same_by_whatever_way_it_was_reached(
    way: str, tmp_path: Path
) -> None:
    path = tmp_path / "place.xosc"
    path.write_text(scenario(*WAYS[way]), encoding="utf-8")
    witness = Witness()
    result = runner.run(path, sut=witness, ego="Car", timestep=0.05, world="kinematic")
    car, follower, placed = (track(result, name) for name in ("Car", "Follower", "Placed"))
    row = int(abs(car["time"] - 7.0).argmin())
    assert (car["road_id"][row], car["lane_id"][row]) == ("1", -1)
    assert (car["t"][row], car["lane_offset"][row], car["h"][row]) == pytest.approx(
        (LEFT, 0.0, 0.0), abs=1e-6
    )
    # lanes counted from it, and positions relative to it
    assert at(follower, 7.5, "t") == pytest.approx(LEFT, abs=1e-6)
    assert at(placed, 7.5, "t") == pytest.approx(LEFT, abs=1e-6)
    assert at(car, 8.5, "t") == pytest.approx(LEFT - LANE, abs=1e-6)
    # at every step, outputs name the lane that is under the car
    said = dict(zip(car["time"].round(6).tolist(), car["lane_id"].tolist(), strict=True))
    on_border = {
        time for time, t in zip(car["time"].round(6), car["t"], strict=True) if abs(t + LANE) < 1e-3
    }
    assert {
        time: lane
        for time, lane in witness.lanes.items()
        if time not in on_border and said[time] != lane
    } == {}
