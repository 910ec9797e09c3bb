"""Exports for CARLA of what its scenario_runner has no word for: ways that a run
shows, and then the same motion.
"""

from __future__ import annotations

from pathlib import Path

import pytest

import xosc
from runner.exchange.exports import TARGETS
from runner.exchange.exports.exporting import export_documents
from tests.runner.exchange.test_exports_geometry import CLOSE, distance, exported
from tests.runner.files import at_time, place, scenario, speed_action, story
from tests.xosc.scenario_runner_grammar import stops_at
from xosc.exports.draft import Folder

BY_RATE = 'dynamicsShape="sinusoidal" dynamicsDimension="rate" value="1.5"'
BY_TIME = 'dynamicsShape="sinusoidal" dynamicsDimension="time" value="2"'
WHERE = '<RelativeLanePosition entityRef="Ego" dLane="{}" ds="{}"/>'


def lane_change(lane: int, dynamics: str = BY_TIME, offset: float = 0.0) -> str:
    """A PrivateAction."""
    return (
        "<PrivateAction><LateralAction><LaneChangeAction "
        f'targetLaneOffset="{offset}"><LaneChangeActionDynamics {dynamics}/>'
        "<LaneChangeTarget><AbsoluteTargetLane "
        f'value="{lane}"/></LaneChangeTarget></LaneChangeAction></LateralAction>'
        "</PrivateAction>"
    )


def trajectory(vertices: str, time: str = "<None/>", offset: float = 0.0) -> str:
    """A PrivateAction that follows a polyline."""
    return (
        "<PrivateAction><RoutingAction><FollowTrajectoryAction "
        f'initialDistanceOffset="{offset}"><TrajectoryRef>'
        '<Trajectory name="t" '
        f'closed="false"><Shape><Polyline>{vertices}</Polyline></Shape></Trajectory></TrajectoryRef>'
        f"<TimeReference>{time}</TimeReference><TrajectoryFollowingMode "
        'followingMode="position"/></FollowTrajectoryAction>'
        "</RoutingAction></PrivateAction>"
    )


def vertex(position: str, time: float | None = None) -> str:
    """A Vertex."""
    timed = "" if time is None else f' time="{time}"'
    return f"<Vertex{timed}><Position>{position}</Position></Vertex>"


PLACES = "".join(
    vertex(f'<LanePosition roadId="1" laneId="-1" s="{s}"/>', time)
    for s, time in ((120, 0), (160, 2), (220, 6))
)
TIMING = '<Timing domainAbsoluteRelative="{}" scale="1" offset="0"/>'

WAYS = {
    "into oncoming traffic and back": [(0.5, lane_change(1)), (4.0, lane_change(-1))],
    "beside the middle of a lane": [(0.5, lane_change(-2, offset=0.5))],
    "positions relative to others": [(0.5,
        trajectory(vertex(WHERE.format(0, 50)) + vertex(WHERE.format(0, 90))))],
    "times of the scenario": [(1.0, trajectory(PLACES, TIMING.format("absolute")))],
    "begun inside, with times": [(0.5, trajectory(PLACES, TIMING.format("relative"), offset=20.0))],
}  # fmt: skip


@pytest.mark.parametrize("kind", WAYS)
def test_ways_for_carla_are_trajectories_that_lead_as_before(kind: str, tmp_path: Path) -> None:
    path = scenario(tmp_path, stories=story("Lead", WAYS[kind]), stop=8.0)
    copy, remarks = exported(path, "carla", tmp_path / "out")
    root = xosc.load(copy).root
    assert any("written as the way that Lead takes in a run" in remark for remark in remarks)
    assert stops_at(root) == [] and len(list(root.iter("FollowTrajectoryAction"))) == len(
        WAYS[kind]
    )
    assert distance(path, copy) < 0.05


def test_a_lane_change_by_rate_for_carla_takes_the_distance_that_it_has_in_a_run(
    tmp_path: Path,
) -> None:
    path = scenario(tmp_path, stories=story("Lead", [(0.5, lane_change(-2, BY_RATE))]), stop=8.0)
    copy, remarks = exported(path, "carla", tmp_path / "out")
    (dynamics,) = xosc.load(copy).root.iter("LaneChangeActionDynamics")
    assert any("the rate is written as the" in remark for remark in remarks)
    assert dynamics.get("dynamicsDimension") == "distance" and distance(path, copy) < 0.05


def test_a_lane_change_on_left_hand_roads_counts_to_the_driver_s_left(tmp_path: Path) -> None:
    path = scenario(tmp_path, init=place("Ego", 100, 20, 1) + place("Lead", 150, 10, 1),
        road="straight_lht",
                    stories=story("Lead", [(0.5, lane_change(2))]), stop=8.0)  # fmt: skip
    copy, _ = exported(path, "carla", tmp_path / "out")
    (target,) = xosc.load(copy).root.iter("RelativeTargetLane")
    assert (target.get("entityRef"), target.get("value")) == ("Lead", "1") and distance(
        path, copy
    ) < 0.05


def test_stories_of_the_same_name_are_told_apart(tmp_path: Path) -> None:
    early, late = story("Ego", [(0.5, speed_action(15))]), story("Lead", [(3.0, lane_change(1))])
    path = scenario(tmp_path, stories=early + late, stop=8.0)
    copy, _ = exported(path, "carla", tmp_path / "out")
    assert distance(path, copy) < 0.05


AWAITED = (
    '<ConditionGroup><Condition name="then" delay="0" '
    'conditionEdge="none"><ByValueCondition><StoryboardElementStateCondition '
    'storyboardElementType="action" storyboardElementRef="action0" '
    'state="completeState"/></ByValueCondition></Condition>'
    "</ConditionGroup>"
)
REFUSED = {
    "something waits for its end": ([(0.5, lane_change(1)), (4.0, speed_action(5))], AWAITED),
    "something waits for its stop": (
        [(0.5, lane_change(1)), (4.0, speed_action(5))],
        AWAITED.replace("completeState", "stopTransition"),
    ),
    "it jumps": (
        [(0.5, lane_change(1, 'dynamicsShape="step" dynamicsDimension="time" value="0"'))],
        "",
    ),
    "it never begins": ([(100.0, lane_change(1))], ""),
}


@pytest.mark.parametrize("why", REFUSED)
def test_lane_changes_that_no_way_stands_for_are_refused(why: str, tmp_path: Path) -> None:
    events, trigger = REFUSED[why]
    path = scenario(tmp_path, stories=story("Lead", events), stop=8.0)
    text = path.read_text(encoding="utf-8")
    if trigger:
        start = text.rindex("<ConditionGroup>", 0, text.index("</Event></Maneuver>"))
        text = text[:start] + trigger + text[text.index("</StartTrigger>", start) :]
    path.write_text(text, encoding="utf-8")
    (done,) = export_documents([path], TARGETS["carla"], Folder(tmp_path / "out"))
    assert done.exit_code == 4 and "other lanes of the same direction only" in done.remarks[0]


def test_a_lane_change_is_not_awaited_by_who_waits_for_another_of_its_name(tmp_path: Path) -> None:
    early = story("Ego", [(0.5, speed_action(15)), (4.0, speed_action(5))]).replace(
        '"story"', '"other"'
    )
    waits = early.replace(at_time(4.0), AWAITED)
    path = scenario(tmp_path, stories=waits + story("Lead", [(0.5, lane_change(1))]), stop=8.0)
    copy, remarks = exported(path, "carla", tmp_path / "out")
    assert any(
        "LaneChangeAction: written as the way that Lead takes" in remark for remark in remarks
    )
    assert distance(path, copy) < CLOSE


TELEPORTED = [WHERE.format(-1, 20), '<RelativeRoadPosition entityRef="Ego" ds="30" dt="-1"/>']


@pytest.mark.parametrize("position", TELEPORTED)
def test_places_beside_others_for_carla_are_those_of_a_run(position: str, tmp_path: Path) -> None:
    teleport = f"<PrivateAction><TeleportAction><Position>{position}</Position></TeleportAction></PrivateAction>"
    path = scenario(tmp_path, stories=story("Lead", [(1.0, teleport)]), stop=4.0)
    copy, remarks = exported(path, "carla", tmp_path / "out")
    assert any("written as the place where it is in a run" in remark for remark in remarks)
    assert stops_at(xosc.load(copy).root) == [] and distance(path, copy) < 0.01


@pytest.mark.parametrize(
    ("target", "system", "told"),
    [
        ("1.0", "entity", "a distance ahead is written as one along the route"),
        ("carla", "entity", "a distance ahead is written as one along the route"),
        ("1.0", "lane", "a distance along the road or lane is written as one along the route"),
    ],
)
def test_a_headway_ahead_is_one_along_the_route(
    target: str, system: str, told: str, tmp_path: Path
) -> None:
    path = scenario(tmp_path, stories=story("Lead", [(1.0, speed_action(5))]), stop=6.0)
    text, time = (
        path.read_text(encoding="utf-8"),
        '<SimulationTimeCondition value="1.0" rule="greaterOrEqual"/>',
    )
    headway = (
        '<ByEntityCondition><TriggeringEntities triggeringEntitiesRule="any"><EntityRef '
        'entityRef="Ego"/></TriggeringEntities>'
        '<EntityCondition><TimeHeadwayCondition entityRef="Lead" value="1.5" freespace="false" '
        f'coordinateSystem="{system}" relativeDistanceType="longitudinal" '
        'rule="lessThan"/></EntityCondition></ByEntityCondition>'
    )
    assert time in text
    path.write_text(
        text.replace(f"<ByValueCondition>{time}</ByValueCondition>", headway), encoding="utf-8"
    )
    copy, remarks = exported(path, target, tmp_path / "out")
    assert any(told in remark for remark in remarks)
    assert distance(path, copy) < 1e-6


def test_a_profile_of_speeds_for_carla_is_a_trajectory_with_times(tmp_path: Path) -> None:
    profile = (
        '<PrivateAction><LongitudinalAction><SpeedProfileAction followingMode="position">'
        '<SpeedProfileEntry time="2" speed="15"/><SpeedProfileEntry time="1" speed="12"/>'
        "</SpeedProfileAction></LongitudinalAction></PrivateAction>"
    )
    path = scenario(tmp_path, stories=story("Lead", [(0.5, profile)]), stop=6.0)
    copy, _ = exported(path, "carla", tmp_path / "out")
    root = xosc.load(copy).root
    assert (
        stops_at(root) == [] and len(list(root.iter("Timing"))) == 1 and distance(path, copy) < 0.05
    )


def test_a_lane_change_of_the_beginning_into_oncoming_traffic_is_a_way_from_there(
    tmp_path: Path,
) -> None:
    init = place("Ego", 100, 20) + place("Lead", 150, 10, more=lane_change(1))
    path = scenario(tmp_path, init=init, stories=story("Lead", [(3.0, speed_action(5))]), stop=5.0)
    copy, _ = exported(path, "carla", tmp_path / "out")
    assert stops_at(xosc.load(copy).root) == [] and distance(path, copy) < 0.05


def test_a_route_that_another_one_ends_is_the_way_until_there_for_carla(tmp_path: Path) -> None:
    point = (
        '<Waypoint routeStrategy="shortest"><Position><LanePosition roadId="1" laneId="{}" '
        's="{}"/></Position></Waypoint>'
    )
    route = f'<Route name="r" closed="false">{point.format(-1, 160)}{point.format(-2, 300)}</Route>'
    assign = f"<PrivateAction><RoutingAction><AssignRouteAction>{route}</AssignRouteAction></RoutingAction></PrivateAction>"
    acquire = (
        '<PrivateAction><RoutingAction><AcquirePositionAction><Position><LanePosition roadId="1" '
        'laneId="-1" s="400"/></Position>'
        "</AcquirePositionAction></RoutingAction></PrivateAction>"
    )
    path = scenario(tmp_path, stories=story("Lead", [(0.5, assign), (3.0, acquire)]), stop=7.0)
    copy, _ = exported(path, "carla", tmp_path / "out")
    root = xosc.load(copy).root
    assert stops_at(root) == [] and not list(
        root.iter("AssignRouteAction", "AcquirePositionAction")
    )
    assert distance(path, copy) < 0.2


def test_a_time_that_has_been_reached_has_no_edge_down(tmp_path: Path) -> None:
    path = scenario(tmp_path, stories=story("Lead", [(1.0, speed_action(5))]), stop=3.0)
    text = path.read_text(encoding="utf-8").replace(
        'conditionEdge="none"', 'conditionEdge="risingOrFalling"'
    )
    path.write_text(
        text.replace('<SimulationTimeCondition value="0"', '<SimulationTimeCondition value="-1"'),
        encoding="utf-8",
    )
    copy, _ = exported(path, "carla", tmp_path / "out")
    assert distance(path, copy) < 1e-6
