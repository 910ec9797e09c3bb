"""Routes of lanes: waypoints and positions ask for a lane, and the car gets into
it, or it is said where it could not.
"""

from __future__ import annotations

from pathlib import Path

import pytest

import runner
from runner import RunResult
from tests.conformance.support import track
from tests.conformance.test_place import action

LANE = 3.5


def lanes(numbers: tuple[int, ...], marks: str = "", link: str = "") -> str:
    body = "".join(
        f'<lane id="{number}" type="driving" level="false"><link>{link}</link>'
        f'<width sOffset="0" a="{LANE}" b="0" c="0" d="0"/>{marks}</lane>'
        for number in numbers
    )
    return (
        '<lanes><laneSection s="0"><center><lane id="0" type="none" level="false"/></center>'
        f"<right>{body}</right></laneSection></lanes>"
    )


def through(number: int, start: int, end: int) -> str:
    """A connecting road from a lane of road 1 to one of road 2."""
    first, last = (-LANE * (abs(lane) - 1) for lane in (start, end))
    side = last - first
    link = f'<predecessor id="{start}"/><successor id="{end}"/>'
    return f"""<road name="" length="{40.0 if not side else 40.1831513874569}" id="{number}" junction="9"><link>
    <predecessor elementType="road" elementId="1" contactPoint="end"/>
    <successor elementType="road" elementId="2" contactPoint="start"/></link><planView>
    <geometry s="0" x="200" y="{first}" hdg="0" length="{40.0 if not side else 40.1831513874569}">
    <paramPoly3 pRange="normalized" aU="0" bU="40" cU="0" dU="0" aV="0" bV="0" cV="{3 * side}" dV="{-2 * side}"/>
    </geometry></planView>{lanes((-1,), link=link)}</road>"""


def fork(folder: Path, connections: tuple[tuple[int, int], ...], marks: str = "") -> None:
    """Road 1 leads from x = 0 to 200 m, road 2 from 240 to 540 m; a junction
    connects some of their two lanes.
    """
    roads = "".join(
        f"""<road name="" length="{length}" id="{number}" junction="-1"><link><{end} elementType="junction" elementId="9"/>
        </link><planView><geometry s="0" x="{x}" y="0" hdg="0" length="{length}"><line/></geometry></planView>
        {lanes((-1, -2), marks)}</road>"""
        for number, x, length, end in ((1, 0, 200, "successor"), (2, 240, 300, "predecessor"))
    )
    inside = "".join(through(10 + index, *pair) for index, pair in enumerate(connections))
    joints = "".join(
        f"""<connection id="{index}" incomingRoad="1" connectingRoad="{10 + index}" contactPoint="start">
        <laneLink from="{start}" to="-1"/></connection>"""
        for index, (start, _) in enumerate(connections)
    )
    (folder / "fork.xodr").write_text(
        f"""<OpenDRIVE><header revMajor="1" revMinor="7"/>{roads}{inside}
        <junction id="9" name="j">{joints}</junction></OpenDRIVE>""",
        encoding="utf-8",
    )


def waypoint(road: int, lane: int, s: float) -> str:
    return f'<Position><LanePosition roadId="{road}" laneId="{lane}" s="{s}"/></Position>'


def route(*waypoints: str) -> str:
    inner = "".join(f'<Waypoint routeStrategy="shortest">{each}</Waypoint>' for each in waypoints)
    return (
        '<RoutingAction><AssignRouteAction><Route name="r" '
        f'closed="false">{inner}</Route></AssignRouteAction></RoutingAction>'
    )


def acquire(position: str) -> str:
    return (
        f"<RoutingAction><AcquirePositionAction>{position}</AcquirePositionAction></RoutingAction>"
    )


def drive(folder: Path, lane: int, *actions: str, speed: float = 20.0) -> RunResult:
    """A car that begins in a lane of road 1, with actions at 0, 1, 2 … s."""
    groups = "".join(action(f"A{i}", "Car", body, float(i)) for i, body in enumerate(actions))
    always = """<StartTrigger><ConditionGroup><Condition name="c" delay="0" conditionEdge="none"><ByValueCondition>
    <SimulationTimeCondition value="0" rule="greaterOrEqual"/></ByValueCondition></Condition></ConditionGroup></StartTrigger>"""
    path = folder / "ways.xosc"
    path.write_text(
        f"""<OpenSCENARIO><FileHeader revMajor="1" revMinor="2" date="2026-01-01T00:00:00" author="" description=""/>
        <CatalogLocations/><RoadNetwork><LogicFile filepath="fork.xodr"/></RoadNetwork><Entities><ScenarioObject name="Car">
        <Vehicle name="car" vehicleCategory="car"><BoundingBox><Center x="1.4" y="0" z="0.75"/>
        <Dimensions length="5" width="2" height="1.5"/></BoundingBox>
        <Performance maxSpeed="70" maxAcceleration="20" maxDeceleration="20"/><Axles>
        <FrontAxle maxSteering="0.5" wheelDiameter="0.6" trackWidth="1.7" positionX="2.8" positionZ="0.3"/>
        <RearAxle maxSteering="0" wheelDiameter="0.6" trackWidth="1.7" positionX="0" positionZ="0.3"/></Axles><Properties/>
        </Vehicle></ScenarioObject></Entities><Storyboard><Init><Actions><Private entityRef="Car"><PrivateAction>
        <TeleportAction>{
            waypoint(1, lane, 10)
        }</TeleportAction></PrivateAction><PrivateAction><LongitudinalAction>
        <SpeedAction><SpeedActionDynamics dynamicsShape="step" value="0" dynamicsDimension="time"/><SpeedActionTarget>
        <AbsoluteTargetSpeed value="{
            speed
        }"/></SpeedActionTarget></SpeedAction></LongitudinalAction></PrivateAction>
        </Private></Actions></Init><Story name="s"><Act name="a">{groups}{
            always
        }</Act></Story><StopTrigger><ConditionGroup>
        <Condition name="c" delay="0" conditionEdge="none"><ByValueCondition>
        <SimulationTimeCondition value="{
            500 / speed
        }" rule="greaterThan"/></ByValueCondition></Condition></ConditionGroup>
        </StopTrigger></Storyboard></OpenSCENARIO>""",
        encoding="utf-8",
    )
    return runner.run(path, sut=None, timestep=0.05, world="kinematic")


def arrival(result: RunResult) -> tuple[str, int]:
    """Road and lane of the car at the end."""
    car = track(result, "Car")
    return car["road_id"][-1], int(car["lane_id"][-1])


def complaints(result: RunResult) -> list[str]:
    return [remark for remark in result.remarks if "lanes_of_waypoints" in remark]


ALL = ((-1, -1), (-2, -2), (-1, -2))


@pytest.mark.parametrize("start", [-1, -2])
@pytest.mark.parametrize("target", [-1, -2])
@pytest.mark.parametrize("connections", [ALL, ALL[:2], ALL[1:]])
@pytest.mark.parametrize("kind", ["route", "position"])
def test_the_lane_asked_for_is_reached(
    kind: str, connections: tuple[tuple[int, int], ...], target: int, start: int, tmp_path: Path
) -> None:
    fork(tmp_path, connections)
    goal = waypoint(2, target, 290)
    way = acquire(goal) if kind == "position" else route(waypoint(1, start, 10), goal)
    result = drive(tmp_path, start, way)
    assert (arrival(result), complaints(result)) == (("2", target), [])


def test_the_connecting_road_is_the_one_that_leads_to_the_lane(tmp_path: Path) -> None:
    fork(tmp_path, ALL)
    car = track(drive(tmp_path, -1, route(waypoint(1, -1, 10), waypoint(2, -2, 20))), "Car")
    assert list(dict.fromkeys(car["road_id"])) == ["1", "12", "2"]
    assert set(car["lane_offset"].round(3)) == {0.0}


@pytest.mark.parametrize("allowed", ["none", "increase"])
def test_a_lane_that_no_lane_leads_to_is_said_with_its_place(allowed: str, tmp_path: Path) -> None:
    marks = f'<roadMark sOffset="0" type="solid" width="0.12" laneChange="{allowed}"/>'
    fork(tmp_path, ALL[:2], marks)
    result = drive(tmp_path, -1, route(waypoint(1, -1, 10), waypoint(2, -2, 250)))
    assert arrival(result) == ("2", -1)
    assert [text.split(": ", 1)[1].split(" [")[0] for text in complaints(result)] == [
        "no lane leads Car to lane -2 of road 2 at s = 250.0 m; it passes there in another lane",
        "Car passes waypoint 2 in lane -1, not -2, of road 2 at s = 250.0 m",
    ]


def test_a_mark_that_allows_one_direction_allows_that(tmp_path: Path) -> None:
    fork(
        tmp_path,
        ALL[:2],
        '<roadMark sOffset="0" type="broken" width="0.12" laneChange="decrease"/>',
    )
    result = drive(tmp_path, -1, route(waypoint(1, -1, 10), waypoint(2, -2, 250)))
    assert (arrival(result), complaints(result)) == (("2", -2), [])


def test_a_lane_change_of_the_scenario_outlasts_the_lane_of_a_waypoint(tmp_path: Path) -> None:
    fork(tmp_path, ALL[:2])
    change = """<LateralAction><LaneChangeAction><LaneChangeActionDynamics dynamicsShape="cubic" value="2"
    dynamicsDimension="time"/><LaneChangeTarget><AbsoluteTargetLane value="-2"/></LaneChangeTarget></LaneChangeAction>
    </LateralAction>"""
    result = drive(tmp_path, -1, route(waypoint(1, -1, 10), waypoint(2, -1, 250)), change)
    assert arrival(result) == ("2", -2)
    assert ["passes waypoint 2 in lane -2" in text for text in complaints(result)] == [True]


def test_lanes_of_waypoints_are_taken_one_after_the_other(tmp_path: Path) -> None:
    fork(tmp_path, ALL[:2])
    stops = [waypoint(1, -1, 10), waypoint(1, -2, 120), waypoint(2, -1, 130), waypoint(2, -2, 280)]
    result = drive(tmp_path, -1, route(*stops), speed=10.0)
    car = track(result, "Car")
    passed = [int(car["lane_id"][abs(car["x"] - x).argmin()]) for x in (119.0, 369.0, 519.0)]
    assert (passed, complaints(result)) == ([-2, -1, -2], [])
