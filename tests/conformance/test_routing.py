"""Routes at junctions, and trajectories in all shapes, timing and following modes."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import runner
from runner.judging.execution import prepare
from schemas.common.errors import InvalidFile
from tests.conformance.support import SCENARIOS, at, changed, events, run, track

ARMS = {"1": (111.5, -1.75), "2": (1.75, 111.5), "4": (-1.75, -111.5)}
"""End of the lane that leads out of the crossing, by the arm's road id; the car
comes from the west.
"""


def drive(element: str, entity: str = "Car", **parameters: Any) -> dict[str, np.ndarray]:
    """Track of an entity in a conformance scenario."""
    return track(run(element, parameters=parameters, world="kinematic"), entity)


def refusal(element: str, **parameters: Any) -> str:
    """The complaint that a scenario ends in."""
    with pytest.raises(InvalidFile) as caught:
        run(element, parameters=parameters, world="kinematic")
    assert caught.value.line is not None
    return caught.value.message


# routes -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("arm", ARMS)
@pytest.mark.parametrize("strategy", ["shortest", "fastest", "leastIntersections", "random"])
def test_an_assigned_route_decides_at_the_junction(arm: str, strategy: str) -> None:
    columns = drive("AssignRouteAction", Exit=arm, Strategy=strategy)
    assert str(columns["road_id"][-1]) == arm
    assert int(columns["lane_id"][-1]) == -1
    x, y = ARMS[arm]
    assert abs(float(columns["x"][-1]) - x) < 1e-6 or abs(float(columns["y"][-1]) - y) < 1e-6


CYCLIST = (
    ('value="11"', 'value="20"'),
    ("crossing.xodr", "crosswalk.xodr"),
    ('vehicleCategory="car"', 'vehicleCategory="bicycle"'),
    ('<AbsoluteTargetSpeed value="10"/>', '<AbsoluteTargetSpeed value="2"/>'),
    (
        '<LanePosition roadId="3" laneId="1" s="50"/>',
        '<LanePosition roadId="1" laneId="-2" s="30"/>',
    ),
    (
        '<LanePosition roadId="3" laneId="1" s="80"/>',
        '<LanePosition roadId="1" laneId="-2" s="35"/>',
    ),
    (
        '<LanePosition roadId="$Exit" laneId="-1" s="60"/>',
        '<LanePosition roadId="2" laneId="2" s="20"/>',
    ),
)
OVER = (
    '<Route name="Route" closed="$Closed">',
    '<Route name="Route" closed="$Closed">'
    '<Waypoint routeStrategy="shortest"><Position><LanePosition roadId="1" laneId="-2" '
    's="30"/></Position></Waypoint>',
)
ON_THE_CROSSWALK = (
    '<LanePosition roadId="1" laneId="-2" s="35"/>',
    '<LanePosition roadId="75" laneId="1" s="4"/>',
)


@pytest.mark.parametrize("world", ["kinematic", "sumo"])
def test_a_route_leads_over_a_cross_path(tmp_path: Path, world: str) -> None:
    """20 m along the right sidewalk, 9 m across the carriageway, and on along
    the left sidewalk, at 2 m/s.
    """
    path = changed(SCENARIOS / "AssignRouteAction.xosc", tmp_path, *CYCLIST, OVER, ON_THE_CROSSWALK)
    columns = track(runner.run(path, sut=None, timestep=0.1, max_time=20.0, world=world), "Car")
    for time, place in (
        (9.0, (48.0, -4.5)),
        (12.0, (50.0, -0.5)),
        (14.0, (50.0, 3.5)),
        (16.0, (53.0, 4.5)),
        (20.0, (61.0, 4.5)),
    ):
        assert (at(columns, time, "x"), at(columns, time, "y")) == pytest.approx(place, abs=1e-6)
    assert list(dict.fromkeys(map(str, columns["road_id"]))) == ["1", "3", "75", "2"]


def test_a_route_that_no_way_leads_along_is_refused_with_its_waypoint() -> None:
    assert "no way leads" in refusal("AssignRouteAction", Closed="true")


@pytest.mark.parametrize("arm", ARMS)
def test_acquire_position_leads_there_and_ends_when_it_is_reached(arm: str) -> None:
    result = run("AcquirePositionAction", parameters={"Exit": arm}, world="kinematic")
    columns = track(result, "Car")
    (end,) = events(result, "endTransition", "Acquire")
    at_end = int(np.searchsorted(columns["time"], end.time + 0.005))
    assert str(columns["road_id"][at_end]) == arm
    assert float(columns["s"][at_end]) == pytest.approx(40.0, abs=0.15)


def test_a_position_that_no_way_leads_to_is_named_before_the_run(tmp_path: Path) -> None:
    """The road that is to be reached is joined to no other."""
    roads = SCENARIOS.parent / "roads"
    island = (roads / "straight.xodr").read_text(encoding="utf-8")
    island = island[island.index("<road ") : island.index("</road>") + len("</road>")].replace(
        'id="1" junction', 'id="island" junction'
    )
    crossing = (roads / "crossing.xodr").read_text(encoding="utf-8")
    (tmp_path / "island.xodr").write_text(
        crossing.replace("</OpenDRIVE>", f"{island}</OpenDRIVE>"), encoding="utf-8"
    )
    path = changed(
        SCENARIOS / "AcquirePositionAction.xosc",
        tmp_path,
        (str(roads / "crossing.xodr"), "island.xodr"),
    )
    assert prepare(path, {"Exit": "1"}) is not None
    with pytest.raises(
        InvalidFile, match="AcquirePositionAction: no way leads 'Car' to the position"
    ):
        prepare(path, {"Exit": "island"})


def test_a_random_route_depends_on_the_seed_only() -> None:
    taken = {}
    for seed in range(12):
        first, second = (
            str(track(run("RandomRouteAction", seed=seed, world="kinematic"), "Car")["road_id"][-1])
            for _ in range(2)
        )
        assert first == second
        taken[first] = seed
    assert set(taken) == set(ARMS)


# trajectories without times -----------------------------------------------------------------------


def test_position_mode_jumps_to_the_trajectory_and_follows_it_at_the_entity_s_speed() -> None:
    columns = drive("FollowTrajectoryAction")
    assert at(columns, 0.99, "x") == pytest.approx(80.0 + 9.9, abs=1e-6)
    assert at(columns, 1.5, "x") == pytest.approx(105.0, abs=1e-6)
    # 20 m east, then √500 m to (140, 8.25), then west
    slant = math.hypot(20.0, 10.0)
    assert (at(columns, 4.0, "x"), at(columns, 4.0, "y")) == pytest.approx(
        (120.0 + 200.0 / slant, -1.75 + 100.0 / slant)
    )
    assert at(columns, 4.0, "h") == pytest.approx(math.atan2(10.0, 20.0))
    left = 10.0 * 5.0 - 20.0 - slant
    assert (at(columns, 6.0, "x"), at(columns, 6.0, "y")) == pytest.approx((140.0 - left, 8.25))


def test_the_end_of_a_trajectory_ends_the_action_and_the_entity_goes_on() -> None:
    result = run("FollowTrajectoryAction", world="kinematic")
    length = 20.0 + math.hypot(20.0, 10.0) + 40.0
    (end,) = events(result, "endTransition", "Follow")
    assert end.time == pytest.approx(1.0 + length / 10.0, abs=0.02)
    columns = track(result, "Car")
    # (100, 8.25) is on the left sidewalk, whose traffic drives towards −s as the car does
    assert at(columns, 1.0 + length / 10.0 + 1.0, "x") == pytest.approx(90.0, abs=0.01)
    assert at(columns, 12.0, "y") == pytest.approx(8.25)


def test_an_initial_distance_offset_cuts_the_beginning_off() -> None:
    columns = drive("FollowTrajectoryAction", Skip=15)
    assert at(columns, 1.01, "x") == pytest.approx(115.1, abs=1e-6)
    assert "is beyond the trajectory" in refusal("FollowTrajectoryAction", Skip=1000)


def test_in_reverse_gear_the_entity_faces_backwards_along_the_trajectory() -> None:
    columns = drive("FollowTrajectoryAction", Speed=-10)
    assert at(columns, 2.0, "x") == pytest.approx(110.0, abs=1e-6)
    assert abs(math.remainder(at(columns, 2.0, "h") - math.pi, math.tau)) < 1e-9
    assert at(columns, 2.0, "speed") == pytest.approx(-10.0)


@pytest.mark.parametrize(("heading", "speed"), [("3.14159265358979", 10.0), ("0", -10.0)])
def test_inside_a_trajectory_prescribed_headings_and_the_gear_say_which_way_leads_on(
    heading: str, speed: float, tmp_path: Path
) -> None:
    ends = [
        (f'<WorldPosition x="{x}" y="{y}"/>', f'<WorldPosition x="{x}" y="-1.75" h="{heading}"/>')
        for x, y in (("100", "-1.75"), ("120", "-1.75"), ("140", "8.25"))
    ]
    last = (
        '<WorldPosition x="100" y="8.25"/>',
        f'<WorldPosition x="180" y="-1.75" h="{heading}"/>',
    )
    path = changed(SCENARIOS / "FollowTrajectoryAction.xosc", tmp_path, *ends, last)
    result = runner.run(
        path,
        parameters={"Speed": speed, "Skip": 80},
        sut=None,
        timestep=0.01,
        world="kinematic",
        max_time=60.0,
    )
    columns = track(result, "Car")
    assert at(columns, 5.0, "x") == pytest.approx(180.0 - 40.0, abs=1e-6)
    assert math.cos(at(columns, 5.0, "h")) == pytest.approx(math.cos(float(heading)))
    assert events(result, "endTransition", "Follow")[0].time == pytest.approx(9.0, abs=0.02)


def test_a_closed_trajectory_is_followed_round_and_round() -> None:
    columns = drive("FollowTrajectoryAction", Closed="true", Speed=20)
    length = 20.0 + math.hypot(20.0, 10.0) + 40.0 + 10.0
    for time in (2.0, 4.0):
        again = time + length / 20.0
        assert (at(columns, again, "x"), at(columns, again, "y")) == pytest.approx(
            (at(columns, time, "x"), at(columns, time, "y")), abs=0.05
        )


def test_follow_mode_steers_to_the_trajectory_without_a_jump() -> None:
    columns = drive("FollowTrajectoryAction", Mode="follow", Y0=-4.75)
    steps = np.hypot(np.diff(columns["x"]), np.diff(columns["y"]))
    assert steps.max() < 0.11
    turns = np.abs(np.diff(np.unwrap(columns["h"].astype(float))))[:350]
    assert turns.max() < 0.01
    assert at(columns, 3.5, "y") == pytest.approx(-1.75, abs=1e-6)
    assert at(columns, 3.5, "h") == pytest.approx(0.0, abs=1e-6)


# trajectories with times --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("parameters", "origin", "scale"),
    [
        ({}, 1.0, 1.0),
        ({"Offset": 0.5}, 1.5, 1.0),
        ({"Scale": 2}, 1.0, 2.0),
        ({"Domain": "absolute"}, 0.0, 1.0),
        ({"Domain": "absolute", "Offset": 2}, 2.0, 1.0),
    ],
)
def test_times_are_scaled_then_shifted_from_the_start_of_the_action_or_the_simulation(
    parameters: dict[str, Any], origin: float, scale: float
) -> None:
    columns = drive("Timing", **parameters)
    for own, x in ((1.5, 115.0), (2.0, 120.0), (3.0, 135.0)):
        assert at(columns, origin + scale * own, "x") == pytest.approx(x, abs=1e-6)
    assert at(columns, origin + scale * 1.5, "speed") == pytest.approx(10.0 / scale)
    assert at(columns, origin + scale * 3.0, "speed") == pytest.approx(15.0 / scale)


def test_before_its_first_time_the_entity_goes_on_and_after_the_last_it_keeps_its_speed() -> None:
    columns = drive("Timing", Offset=3)
    assert at(columns, 3.9, "x") == pytest.approx(139.0)
    assert at(columns, 3.9, "speed") == 10.0
    assert at(columns, 4.0, "x") == pytest.approx(100.0, abs=1e-6)
    assert at(columns, 5.5, "x") == pytest.approx(115.0, abs=1e-6)
    assert at(columns, 9.0, "x") == pytest.approx(165.0, abs=1e-6)
    assert at(columns, 9.0, "speed") == pytest.approx(15.0)


def test_the_action_ends_at_the_last_time() -> None:
    (end,) = events(run("Timing", world="kinematic"), "endTransition", "Follow")
    assert end.time == pytest.approx(5.0, abs=0.02)


def test_the_time_to_a_distance_offset_is_taken_out_of_the_times() -> None:
    columns = drive("Timing", Skip=10)
    assert at(columns, 1.01, "x") == pytest.approx(110.1, abs=1e-6)
    assert at(columns, 2.0, "x") == pytest.approx(120.0, abs=1e-6)


def test_a_heading_prescribed_against_the_motion_means_driving_backwards() -> None:
    columns = drive("Timing", H=math.pi)
    assert at(columns, 2.0, "x") == pytest.approx(110.0, abs=1e-6)
    assert at(columns, 2.0, "speed") == pytest.approx(-10.0)
    assert at(columns, 2.0, "h") == pytest.approx(math.pi)


def test_follow_mode_with_times_catches_up_with_the_schedule() -> None:
    columns = drive("Timing", Mode="follow", Y0=-3.25)
    assert np.hypot(np.diff(columns["x"]), np.diff(columns["y"])).max() < 0.3
    assert (at(columns, 5.0, "x"), at(columns, 5.0, "y")) == pytest.approx((150.0, -1.75), abs=1e-3)


VERTICES = {0.0: 100.0, 2.0: 120.0, 4.0: 150.0, 6.0: 160.0, 7.0: 160.0, 10.0: 165.0}
"""x (m) of the vertices of TrajectoryFollowingMode, by the simulation time (s)
at which they are due
"""


@pytest.mark.parametrize("mode", ["follow", "position"])
def test_in_both_modes_an_entity_is_at_each_vertex_at_its_time(mode: str) -> None:
    columns = drive("TrajectoryFollowingMode", Mode=mode)
    for time, x in VERTICES.items():
        assert at(columns, time, "x") == pytest.approx(x, abs=1e-6)


def test_follow_mode_changes_speed_within_the_performance_where_position_mode_jumps() -> None:
    jumps = {
        mode: np.abs(np.diff(drive("TrajectoryFollowingMode", Mode=mode)["speed"])).max()
        for mode in ("position", "follow")
    }
    assert jumps["position"] == pytest.approx(10.0)
    assert jumps["follow"] <= 20.0 * 0.01 + 1e-6


def test_follow_mode_stands_where_vertices_are_at_one_place_and_arrives_with_the_speed_of_its_last_interval() -> (
    None
):
    columns = drive("TrajectoryFollowingMode")
    assert np.all(columns["speed"][(columns["time"] > 6.015) & (columns["time"] < 6.995)] == 0.0)
    # 5 m in 3 s from standstill: one acceleration
    assert at(columns, 8.5, "x") == pytest.approx(160.0 + 5.0 / 4.0, abs=0.02)
    assert at(columns, 9.995, "speed") == pytest.approx(2.0 * 5.0 / 3.0, abs=0.02)


def test_the_speed_that_the_entity_has_is_that_of_its_first_vertex_in_follow_mode() -> None:
    columns = drive("TrajectoryFollowingMode", Speed=4)
    assert at(columns, 0.02, "speed") == pytest.approx(4.0, abs=0.3)
    assert at(columns, 2.0, "x") == pytest.approx(120.0, abs=1e-6)


def test_who_cannot_keep_the_times_is_late_and_catches_up_within_its_performance() -> None:
    result = run("TrajectoryFollowingMode", parameters={"Limit": 2, "Speed": 0}, world="kinematic")
    columns = track(result, "Car")
    assert np.diff(columns["speed"]).max() <= 2.0 * 0.01 + 1e-6
    assert at(columns, 2.0, "x") < 105.0
    assert at(columns, 10.0, "x") == pytest.approx(165.0, abs=0.5)


def test_the_action_ends_when_the_late_arrive() -> None:
    result = run(
        "TrajectoryFollowingMode",
        parameters={"Limit": 2, "Speed": 0, "Last": 200},
        world="kinematic",
    )
    (end,) = events(result, "endTransition", "Follow")
    assert 10.1 < end.time < 14.0
    assert at(track(result, "Car"), end.time, "x") == pytest.approx(200.0, abs=0.3)


def test_a_timing_without_times_is_refused() -> None:
    assert "must be positive" in refusal("Timing", Scale=0)


# shapes -------------------------------------------------------------------------------------------


def test_a_clothoid_turns_as_its_curvature_integrates() -> None:
    columns = drive("Clothoid")
    # heading = h0 + κ s + κ' s²/2
    assert at(columns, 3.0, "h") == pytest.approx(0.5 + 0.02 * 30.0 + 0.001 * 450.0, abs=1e-3)
    s = np.linspace(0.0, 30.0, 3001)
    h = 0.5 + 0.02 * s + 0.0005 * s * s
    assert at(columns, 3.0, "x") == pytest.approx(100.0 + np.trapezoid(np.cos(h), s), abs=1e-3)
    assert at(columns, 3.0, "y") == pytest.approx(-1.75 + np.trapezoid(np.sin(h), s), abs=1e-3)
    timed = drive("Clothoid", "Timed")
    assert at(timed, 3.0, "x") == pytest.approx(at(columns, 3.0, "x"), abs=1e-3)


def test_a_clothoid_spline_joins_its_segments_with_heading_offsets() -> None:
    columns = drive("ClothoidSpline")
    assert at(columns, 1.0, "h") == pytest.approx(0.5)
    assert at(columns, 3.99, "h") == pytest.approx(0.5 + 0.02 * 20.0 / 2, abs=2e-3)
    assert at(columns, 4.5, "h") == pytest.approx(0.7 + 0.25 + 0.02 * 5.0, abs=1e-3)
    # the timed one reaches 20 m at 2 s by even motion, as the time between is not given
    timed = drive("ClothoidSpline", "Timed")
    assert at(timed, 2.0, "x") == pytest.approx(at(columns, 2.0, "x"), abs=1e-3)


def test_a_nurbs_curve_can_be_an_exact_circle() -> None:
    columns = drive("Nurbs")
    radius = np.hypot(columns["x"] - 100.0, columns["y"] - 50.0)
    on_curve = columns["time"] < 50.0 * math.pi / 2 / 10.0 - 0.02
    assert np.abs(radius[on_curve] - 50.0).max() < 1e-4
    # constant speed along the arc: 40 m are 0.8 rad
    assert at(columns, 4.0, "x") == pytest.approx(100.0 + 50.0 * math.sin(0.8), abs=1e-3)
    timed = drive("Nurbs", "Timed")
    assert (at(timed, 3.0, "x"), at(timed, 3.0, "y")) == pytest.approx(
        (100.0 + 50.0 * math.sqrt(0.5), 50.0 - 50.0 * math.sqrt(0.5)), abs=1e-2
    )


# teleport -----------------------------------------------------------------------------------------


def test_a_teleport_keeps_the_speed() -> None:
    result = run("TeleportAction", world="kinematic")
    columns = track(result, "Car")
    assert at(columns, 0.99, "x") == pytest.approx(109.9)
    assert at(columns, 1.51, "x") == pytest.approx(505.1, abs=1e-6)
    assert at(columns, 1.5, "y") == pytest.approx(-5.25)
    assert at(columns, 1.5, "speed") == pytest.approx(10.0)
    assert events(result, "endTransition", "Teleport")[0].time == pytest.approx(1.0)


def test_an_offset_of_all_of_the_trajectory_may_be_rounded() -> None:
    """The trajectory's length comes from its vertices, the offset from the file."""
    length = float(
        re.findall(r"the trajectory's ([0-9.]+) m", refusal("FollowTrajectoryAction", Skip=1e6))[0]
    )
    result = run(
        "FollowTrajectoryAction",
        parameters={"Skip": length + 1e-7},
        world="kinematic",
        max_time=2.0,
    )
    assert events(result, "endTransition", "Follow")[0].time == pytest.approx(1.0), (
        "nothing of it is left to follow"
    )


@pytest.mark.parametrize("arm", ["2", "4"])
def test_an_entity_off_its_route_is_led_to_it(arm: str, tmp_path: Path) -> None:
    """The car comes from the west; the route lies on the arm to the north or
    south, where no straight way leads.
    """
    first = (
        '<LanePosition roadId="3" laneId="1" s="80"/>',
        f'<LanePosition roadId="{arm}" laneId="-1" s="30"/>',
    )
    path = changed(SCENARIOS / "AssignRouteAction.xosc", tmp_path, first)
    result = runner.run(path, parameters={"Exit": arm}, sut=None, world="kinematic", max_time=60.0)
    assert str(track(result, "Car")["road_id"][-1]) == arm


def test_following_without_times_begins_at_the_start_of_the_trajectory_where_its_end_is_nearer(
    tmp_path: Path,
) -> None:
    timing = '<Timing domainAbsoluteRelative="relative" offset="0" scale="1"/>'
    first = ('<WorldPosition x="100" y="-1.75"/>', '<WorldPosition x="98" y="1.75"/>')
    path = changed(SCENARIOS / "TrajectoryFollowingMode.xosc", tmp_path, (timing, "<None/>"), first)
    given = {"Mode": "follow", "Last": "101", "Speed": "5"}
    columns = track(runner.run(path, parameters=given, sut=None, world="kinematic"), "Car")
    assert at(columns, 4.0, "x") == pytest.approx(120.0, abs=3.0)


@pytest.mark.parametrize("braking", [1.5, 3.0, 8.0])
def test_a_schedule_that_ends_in_standstill_ends_so_within_the_performance(
    braking: float, tmp_path: Path
) -> None:
    change = ('maxDeceleration="20"', f'maxDeceleration="{braking}"')
    path = changed(SCENARIOS / "TrajectoryFollowingMode.xosc", tmp_path, change)
    result = runner.run(
        path, parameters={"Last": 160}, sut=None, world="kinematic", timestep=0.01, max_time=60.0
    )
    columns = track(result, "Car")
    assert np.diff(columns["speed"]).min() >= -braking * 0.01 - 1e-6
    assert np.all(columns["speed"][-100:] == 0.0)
    assert columns["x"][-1] == pytest.approx(160.0, abs=0.1)


def test_an_actor_that_is_too_fast_for_the_end_of_its_schedule_brakes_beyond_it(
    tmp_path: Path,
) -> None:
    change = ('maxDeceleration="20"', 'maxDeceleration="1"')
    path = changed(SCENARIOS / "TrajectoryFollowingMode.xosc", tmp_path, change)
    given = {"Last": 160, "Speed": 20}
    columns = track(
        runner.run(
            path, parameters=given, sut=None, world="kinematic", timestep=0.01, max_time=60.0
        ),
        "Car",
    )
    assert at(columns, 13.0, "x") == pytest.approx(100.0 + 20.0 * 13.0 - 13.0**2 / 2.0, abs=0.5)
    assert at(columns, 13.0, "speed") == pytest.approx(7.0, abs=0.05)
    assert np.diff(columns["speed"]).min() >= -0.01 - 1e-6


def test_back_at_the_start_of_a_trajectory_speed_and_displacement_agree(tmp_path: Path) -> None:
    forward = """<Event name="Forward" priority="parallel"><Action name="Forward"><PrivateAction><LongitudinalAction><SpeedAction>
      <SpeedActionDynamics dynamicsShape="linear" dynamicsDimension="rate" value="5"/>
      <SpeedActionTarget><AbsoluteTargetSpeed value="10"/></SpeedActionTarget>
    </SpeedAction></LongitudinalAction></PrivateAction></Action><StartTrigger><ConditionGroup>
      <Condition name="two" delay="0" conditionEdge="none">
        <ByValueCondition><SimulationTimeCondition value="2" rule="greaterThan"/></ByValueCondition>
      </Condition>
    </ConditionGroup></StartTrigger></Event></Maneuver>"""
    path = changed(SCENARIOS / "FollowTrajectoryAction.xosc", tmp_path, ("</Maneuver>", forward))
    given = {"Speed": -10, "Y0": -1.75}
    columns = track(
        runner.run(
            path, parameters=given, sut=None, world="kinematic", timestep=0.01, max_time=12.0
        ),
        "Car",
    )
    moved = np.hypot(np.diff(columns["x"]), np.diff(columns["y"])) / 0.01
    on_it = columns["time"][1:] > 1.05
    assert np.abs(moved - np.abs(columns["speed"][1:]))[on_it].max() < 0.06
    assert at(columns, 12.0, "x") == pytest.approx(100.0, abs=1e-6)
    assert at(columns, 12.0, "speed") == 0.0


def test_of_two_vertices_at_one_time_the_second_has_none(tmp_path: Path) -> None:
    path = changed(
        SCENARIOS / "TrajectoryFollowingMode.xosc",
        tmp_path,
        ('<Vertex time="4">', '<Vertex time="2">'),
    )
    result = runner.run(
        path,
        parameters={"Mode": "position"},
        sut=None,
        world="kinematic",
        timestep=0.01,
        max_time=60.0,
    )
    assert any(
        "the time 2 is that of another place, too; it is left out" in remark
        for remark in result.remarks
    )
    columns = track(result, "Car")
    assert (at(columns, 2.0, "x"), at(columns, 4.0, "x"), at(columns, 6.0, "x")) == pytest.approx(
        (120.0, 140.0, 160.0), abs=1e-6
    )
    with pytest.raises(InvalidFile, match="is that of another place"):
        runner.run(path, sut=None, world="kinematic", strict=True)
