"""Small inputs with one answer by the standard: times of trajectories, dynamics, entities that come
and go, distances on a ring.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import runner
from tests.conformance.scenes import CHANGE, TELEPORT, lane_position, play, start, triggered
from tests.conformance.support import at, events, track
from tests.runner.files import car, place, scenario, speed_action, story


def trajectory(timing: str, mode: str = "position", times: tuple[float, ...] = (0, 2, 4)) -> str:
    """A trajectory over 40 m from x = 300 m."""
    vertices = "".join(
        f'<Vertex time="{time}"><Position><WorldPosition x="{300 + 20 * number}" '
        'y="-1.75"/></Position></Vertex>'
        for number, time in enumerate(times)
    )
    reference = f"<Timing {timing}/>" if timing else "<None/>"
    return (
        "<PrivateAction><RoutingAction><FollowTrajectoryAction><TrajectoryRef>"
        '<Trajectory name="t" '
        f'closed="false"><Shape><Polyline>{vertices}</Polyline></Shape></Trajectory>'
        f"</TrajectoryRef><TimeReference>{reference}</TimeReference>"
        "<TrajectoryFollowingMode "
        f'followingMode="{mode}"/></FollowTrajectoryAction></RoutingAction></PrivateAction>'
    )


TIMINGS = {
    # relative times count from the start of the action, at 3 s
    "relative": (
        'domainAbsoluteRelative="relative" offset="0" scale="1"',
        (0, 2, 4),
        {3.0: 300, 4.0: 310, 6.0: 330},
    ),
    "relative, offset": (
        'domainAbsoluteRelative="relative" offset="1" scale="1"',
        (0, 2, 4),
        {4.0: 300, 5.0: 310, 7.0: 330},
    ),
    "relative, scale": (
        'domainAbsoluteRelative="relative" offset="0" scale="0.5"',
        (0, 2, 4),
        {3.0: 300, 3.5: 310, 4.5: 330},
    ),
    "absolute": (
        'domainAbsoluteRelative="absolute" offset="0" scale="1"',
        (3, 5, 7),
        {3.0: 300, 4.0: 310, 6.0: 330},
    ),
    "absolute, begun late": (
        'domainAbsoluteRelative="absolute" offset="0" scale="1"',
        (2, 4, 6),
        {3.0: 310, 4.0: 320, 5.0: 330},
    ),
    "absolute, offset": (
        'domainAbsoluteRelative="absolute" offset="1" scale="1"',
        (2, 4, 6),
        {3.0: 300, 4.0: 310, 6.0: 330},
    ),
    "absolute, scale": (
        'domainAbsoluteRelative="absolute" offset="0" scale="2"',
        (1.5, 2.5, 3.5),
        {3.0: 300, 4.0: 310, 6.0: 330},
    ),
}


@pytest.mark.parametrize("case", TIMINGS)
def test_times_of_a_trajectory(case: str, tmp_path: Path) -> None:
    timing, times, places = TIMINGS[case]
    init = start("Ego", lane_position(-1, 300), 0) + start("Lead", lane_position(1, 900), 0)
    result = play(tmp_path, init, story("Ego", [(3.0, trajectory(timing, times=times))]))
    ego = track(result, "Ego")
    for time, x in places.items():
        assert at(ego, time, "x") == pytest.approx(x, abs=0.01), f"at {time} s"


def test_a_trajectory_without_time_reference_is_driven_at_the_speed_that_the_car_has(
    tmp_path: Path,
) -> None:
    init = start("Ego", lane_position(-1, 300), 4) + start("Lead", lane_position(1, 900), 0)
    actions = [(1.0, trajectory(""))]
    ego = track(play(tmp_path, init.replace('s="300"', 's="296"'), story("Ego", actions)), "Ego")
    assert at(ego, 6.0, "x") == pytest.approx(320.0, abs=0.01)
    assert float(abs(ego["speed"] - 4.0).max()) < 1e-6


def test_a_car_goes_on_in_its_lane_at_its_speed_after_a_trajectory(tmp_path: Path) -> None:
    timing = 'domainAbsoluteRelative="relative" offset="0" scale="1"'
    init = start("Ego", lane_position(-1, 300), 10) + start("Lead", lane_position(1, 900), 0)
    ego = track(play(tmp_path, init, story("Ego", [(0.0, trajectory(timing))])), "Ego")
    assert at(ego, 4.0, "x") == pytest.approx(340.0, abs=0.01)
    assert at(ego, 8.0, "x") == pytest.approx(380.0, abs=0.02)
    assert ego["lane_id"][-1] == -1


DYNAMICS = {
    # dimension, value and mode: seconds that 10 to 20 m/s take with at most 4 m/s²
    "time, position": ("linear", "time", 2.0, "position", 2.0),
    "time, follow": ("linear", "time", 2.0, "follow", 2.5),
    "time long enough, follow": ("linear", "time", 5.0, "follow", 5.0),
    "rate, position": ("linear", "rate", 8.0, "position", 1.25),
    "rate, follow": ("linear", "rate", 8.0, "follow", 2.5),
    "rate, sinusoidal": ("sinusoidal", "rate", 4.0, "follow", math.pi / 2 * 10 / 4),
    "rate, cubic": ("cubic", "rate", 3.0, "position", 1.5 * 10 / 3),
    "distance": ("linear", "distance", 60.0, "position", 4.0),
    "distance, follow": ("linear", "distance", 15.0, "follow", 2.5),
}


@pytest.mark.parametrize("case", DYNAMICS)
def test_a_change_of_speed_takes_its_time(case: str, tmp_path: Path) -> None:
    shape, dimension, value, mode, duration = DYNAMICS[case]
    dynamics = (
        f'dynamicsShape="{shape}" dynamicsDimension="{dimension}" value="{value}" '
        f'followingMode="{mode}"'
    )
    entities = [car("Ego", performance='maxSpeed="70" maxAcceleration="4" maxDeceleration="8"')]
    stories = story("Ego", [(1.0, speed_action(20, dynamics))])
    path = scenario(
        tmp_path, entities=entities, init=place("Ego", 100, 10), stories=stories, stop=8.0
    )
    result = runner.run(path, sut=None, world="kinematic", timestep=0.01)
    ego = track(result, "Ego")
    reached = ego["time"][np.flatnonzero(ego["speed"] > 20.0 - 1e-6)[0]]
    assert reached - 1.0 == pytest.approx(duration, abs=0.011)
    (ended,) = events(result, "endTransition", "action0") or events(result, subject="action0")[-1:]
    assert ended.time - 1.0 == pytest.approx(duration, abs=0.011)


def test_a_factor_is_of_the_references_speed(tmp_path: Path) -> None:
    relative = speed_action(0).replace(
        '<AbsoluteTargetSpeed value="0"/>',
        '<RelativeTargetSpeed entityRef="Lead" value="1.5" speedTargetValueType="factor" '
        'continuous="false"/>',
    )
    init = place("Ego", 100, 5) + place("Lead", 300, 12, -2)
    ego = track(play(tmp_path, init, story("Ego", [(1.0, relative)])), "Ego")
    assert at(ego, 2.0, "speed") == pytest.approx(18.0)


def entity_action(name: str, body: str) -> str:
    return f'<GlobalAction><EntityAction entityRef="{name}">{body}</EntityAction></GlobalAction>'


def add(name: str, lane: int, s: float) -> str:
    position = f"<Position>{lane_position(lane, s)}</Position>"
    return entity_action(name, f"<AddEntityAction>{position}</AddEntityAction>")


DELETE = "<DeleteEntityAction/>"


def test_an_entity_that_is_taken_out_twice_and_comes_back_twice(tmp_path: Path) -> None:
    init = place("Ego", 100, 0) + place("Lead", 200, 10, -2)
    actions = [
        (1.0, entity_action("Lead", DELETE)),
        (2.0, add("Lead", -2, 400)),
        (4.0, entity_action("Lead", DELETE)),
        (5.0, add("Lead", -1, 600)),
    ]
    lead = track(play(tmp_path, init, story("Ego", actions)), "Lead")
    shown = lead["time"].round(6)
    assert not ((shown > 1.0) & (shown < 2.0)).any()
    assert not ((shown > 4.0) & (shown < 5.0)).any()
    assert at(lead, 2.0, "x") == pytest.approx(400.0)
    assert at(lead, 3.0, "x") == pytest.approx(410.0)
    assert at(lead, 5.0, "x") == pytest.approx(600.0)
    assert at(lead, 9.0, "x") == pytest.approx(640.0)
    assert lead["lane_id"][-1] == -1


def test_an_added_entity_has_the_speed_that_was_set_while_it_was_away(tmp_path: Path) -> None:
    init = place("Ego", 100, 0) + place("Lead", 200, 10, -2)
    actions = [(1.0, entity_action("Lead", DELETE)), (3.0, add("Lead", -2, 400))]
    away = story("Lead", [(2.0, speed_action(20))]).replace('"story"', '"away"')
    result = play(tmp_path, init, story("Ego", actions) + away)
    lead = track(result, "Lead")
    said = [remark for remark in result.remarks if "Lead" in remark]
    assert at(lead, 4.0, "x") == pytest.approx(420.0) or said, "its speed is lost in silence"


DISTANCE = (
    '<RelativeDistanceCondition entityRef="Lead" freespace="{}" relativeDistanceType="{}"'
    ' coordinateSystem="{}" value="{}" rule="{}"/>'
)
MEASURED = {
    # Ego from x = 100 at 10 m/s in lane -1, Lead stands at x = 150 in lane -2; boxes from -1 to 4 m
    "longitudinal": (DISTANCE.format("false", "longitudinal", "lane", 20, "lessOrEqual"), 3.0),
    "longitudinal, freespace": (
        DISTANCE.format("true", "longitudinal", "road", 20, "lessOrEqual"),
        2.5,
    ),
    "lateral": (DISTANCE.format("false", "lateral", "lane", 3.5, "equalTo"), 0.0),
    "lateral, freespace": (DISTANCE.format("true", "lateral", "road", 1.5, "lessOrEqual"), 0.0),
    "euclidean": (DISTANCE.format("false", "euclidianDistance", "entity", 12.5, "lessThan"), 3.8),
    "headway": (
        (
            '<TimeHeadwayCondition entityRef="Lead" freespace="false" value="2" '
            'rule="lessOrEqual" coordinateSystem="lane"/>'
        ),
        3.0,
    ),
    "headway, freespace": (
        (
            '<TimeHeadwayCondition entityRef="Lead" freespace="true" value="2" rule="lessOrEqual" '
            'coordinateSystem="road"/>'
        ),
        2.5,
    ),
    "reach": (
        (
            "<ReachPositionCondition "
            f'tolerance="2"><Position>{lane_position(-1, 140)}</Position></ReachPositionCondition>'
        ),
        3.8,
    ),
    "travelled": ('<TraveledDistanceCondition value="35"/>', 3.5),
    "relative speed": ('<RelativeSpeedCondition entityRef="Lead" value="10" rule="equalTo"/>', 0.0),
}


@pytest.mark.parametrize("case", MEASURED)
def test_conditions_become_true_at_their_time(case: str, tmp_path: Path) -> None:
    body, time = MEASURED[case]
    init = place("Ego", 100, 10) + place("Lead", 150, 0, -2)
    assert triggered(tmp_path, body, init) == pytest.approx(time, abs=0.051)


def test_travelled_distance_counts_no_teleport(tmp_path: Path) -> None:
    jump = story("Ego", [(2.0, TELEPORT.format(lane_position(-1, 700)))]).replace(
        '"story"', '"jump"'
    )
    init = place("Ego", 100, 10) + place("Lead", 150, 0, -2)
    body = '<TraveledDistanceCondition value="35"/>'
    assert triggered(tmp_path, body, init, jump) == pytest.approx(3.5, abs=0.051)


def test_travelled_distance_counts_backwards_motion_as_way(tmp_path: Path) -> None:
    init = place("Ego", 100, -10) + place("Lead", 150, 0, -2)
    body = '<TraveledDistanceCondition value="35"/>'
    assert triggered(tmp_path, body, init) == pytest.approx(3.5, abs=0.051)


def test_standing_time_begins_again_after_a_move(tmp_path: Path) -> None:
    moves = story("Ego", [(2.0, speed_action(1)), (3.0, speed_action(0))]).replace(
        '"story"', '"moves"'
    )
    init = place("Ego", 100, 0) + place("Lead", 150, 0, -2)
    body = '<StandStillCondition duration="4"/>'
    assert triggered(tmp_path, body, init, moves) == pytest.approx(7.0, abs=0.11)


def test_a_condition_on_an_entity_that_is_away_is_false(tmp_path: Path) -> None:
    gone = story(
        "Lead", [(0.0, entity_action("Lead", DELETE)), (5.0, add("Lead", -2, 200))]
    ).replace('"story"', '"gone"')
    init = place("Ego", 100, 10) + place("Lead", 180, 0, -2)
    body = DISTANCE.format("false", "longitudinal", "lane", 60, "lessOrEqual")
    assert triggered(tmp_path, body, init, gone) == pytest.approx(5.0, abs=0.11)


AWAY = "is not there at {} s: the action 'action0' refers to where it was last"


@pytest.mark.parametrize("gone", [True, False])
def test_a_lane_change_relative_to_a_car_that_has_gone(gone: bool, tmp_path: Path) -> None:
    """The lane that it had last counts, and a remark says so; one that leaves
    afterwards is no matter.
    """
    init = place("Ego", 100, 10) + place("Lead", 150, 10, -2)
    relative = CHANGE.format("", '<RelativeTargetLane entityRef="Lead" value="0"/>')
    time = 1.0 if gone else 3.0
    away = story("Lead", [(time, entity_action("Lead", DELETE))]).replace('"story"', '"gone"')
    result = play(tmp_path, init, story("Ego", [(2.0, relative)]) + away)
    assert track(result, "Ego")["lane_id"][-1] == -2
    assert any(AWAY.format("2.00") in remark for remark in result.remarks) == gone


REFERRING = {
    "distance": '<LongitudinalAction><LongitudinalDistanceAction entityRef="Lead" distance="30" '
    'freespace="false"'
    ' continuous="true" coordinateSystem="lane"><DynamicConstraints maxAcceleration="3" '
    'maxDeceleration="5"'
    ' maxSpeed="50"/></LongitudinalDistanceAction></LongitudinalAction>',
    "lateral distance": '<LateralAction><LateralDistanceAction entityRef="Lead" distance="2" '
    'freespace="false"'
    ' continuous="true" coordinateSystem="lane"><DynamicConstraints maxAcceleration="3" '
    'maxDeceleration="5"'
    ' maxSpeed="5"/></LateralDistanceAction></LateralAction>',
    "offset": '<LateralAction><LaneOffsetAction continuous="true"><LaneOffsetActionDynamics '
    'maxLateralAcc="2"'
    ' dynamicsShape="cubic"/><LaneOffsetTarget><RelativeTargetLaneOffset '
    'entityRef="Lead" value="1"/>'
    "</LaneOffsetTarget></LaneOffsetAction></LateralAction>",
    "synchronisation": '<SynchronizeAction masterEntityRef="Lead"><TargetPositionMaster>'
    + lane_position(-2, 190)
    + "</TargetPositionMaster><TargetPosition>"
    + lane_position(-1, 190)
    + '</TargetPosition><FinalSpeed><AbsoluteSpeed value="12"/></FinalSpeed></SynchronizeAction>',
}


@pytest.mark.parametrize("action", REFERRING)
def test_an_action_whose_reference_leaves_keeps_what_it_has_with_a_remark(
    action: str, tmp_path: Path
) -> None:
    init = place("Ego", 100, 12) + place("Lead", 150, 10, -2)
    away = story("Lead", [(3.0, entity_action("Lead", DELETE))]).replace('"story"', '"gone"')
    body = f"<PrivateAction>{REFERRING[action]}</PrivateAction>"
    result = play(tmp_path, init, story("Ego", [(1.0, body)]) + away)
    ego = track(result, "Ego")
    assert any(AWAY.format("3.00") in remark for remark in result.remarks)
    assert at(ego, 9.0, "speed") == pytest.approx(at(ego, 3.05, "speed"), abs=1e-6)
    assert abs(at(ego, 9.0, "t")) < 7.0


@pytest.mark.parametrize(
    ("jerk", "late"), [("", 0.0), ('maxAccelerationRate="2" maxDecelerationRate="2"', 2.0)]
)
def test_a_speed_that_follows_another_one_keeps_the_limits_of_its_vehicle(
    jerk: str, late: float, tmp_path: Path
) -> None:
    """Lead's speed jumps from 10 to 30 m/s at 2 s: with 4 m/s² Ego is there 5 s
    later, with a jerk of 2 m/s³ 2 s more.
    """
    performance = f'maxSpeed="70" maxAcceleration="4" maxDeceleration="4" {jerk}'
    relative = speed_action(
        0, 'dynamicsShape="linear" dynamicsDimension="time" value="1" followingMode="follow"'
    ).replace(
        '<AbsoluteTargetSpeed value="0"/>',
        '<RelativeTargetSpeed entityRef="Lead" value="0" speedTargetValueType="delta" '
        'continuous="true"/>',
    )
    init = place("Ego", 100, 10) + place("Lead", 300, 10, -2)
    lead = story("Lead", [(2.0, speed_action(30))]).replace('"story"', '"lead"')
    path = scenario(
        tmp_path,
        entities=[car("Ego", performance=performance), car("Lead")],
        init=init,
        stories=story("Ego", [(0.5, relative)]) + lead,
        stop=12.0,
    )
    ego = track(runner.run(path, sut=None, world="kinematic", timestep=0.01), "Ego")
    reached = ego["time"][np.flatnonzero(ego["speed"] > 29.999)[0]]
    assert reached == pytest.approx(7.0 + late, abs=0.2)
    assert ego["speed"].max() <= 30.0 + 1e-3
    rates = np.diff(ego["speed"]) / 0.01
    assert np.abs(rates).max() <= 4.0 + 1e-6
    assert not jerk or np.abs(np.diff(rates)).max() <= 2.0 * 0.01 + 1e-6


@pytest.mark.parametrize(("first", "said"), [(100.0, True), (2.0, False)])
def test_a_trajectory_that_never_begins_is_a_remark(
    first: float, said: bool, tmp_path: Path
) -> None:
    """Relative times count from the start of the action: one that begins 100 s
    later is not followed in 10 s.
    """
    timing = 'domainAbsoluteRelative="relative" offset="0" scale="1"'
    action = trajectory(timing, times=(first, first + 2, first + 4))
    init = place("Ego", 100, 10) + place("Lead", 150, 0, -2)
    result = play(tmp_path, init, story("Ego", [(1.0, action)]))
    assert any("follows none of its trajectory" in remark for remark in result.remarks) == said
