"""Conditions by entity: when they become true, by the formulas of the standard.

Unless a scenario says otherwise, the ego drives at 20 m/s from s = 100 m and the other one at 10
m/s from s = 200 m, so that their reference points are 100 − 10 t apart; their boxes reach 1 m back
and 4 m ahead.
"""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np
import pytest

from tests.conformance.support import events, track
from tests.conformance.support import run as run_scenario

run = functools.partial(run_scenario, world="kinematic")


def fired(result: Any, event: str = "Fired") -> float | None:
    """When an event started, None if never."""
    found = events(result, "startTransition", event)
    return found[0].time if found else None


def reason(result: Any, event: str = "Fired") -> str:
    """What the event's trigger said when it fired."""
    return events(result, "startTransition", event)[0].text


def when(element: str, event: str = "Fired", **parameters: Any) -> float | None:
    """When the event of an element's scenario starts with these parameters."""
    return fired(run(element, parameters=parameters), event)


def test_end_of_road_counts_from_the_arrival() -> None:
    assert when("EndOfRoadCondition", Duration=1) == pytest.approx(5.0 + 1.0, abs=0.03)
    assert when("EndOfRoadCondition", Duration=2.5) == pytest.approx(7.5, abs=0.03)


def test_collision_begins_when_the_boxes_touch() -> None:
    result = run("CollisionCondition")
    assert fired(result, "ByEntity") == pytest.approx(9.5, abs=0.011)
    assert fired(result, "ByType") == fired(result, "ByEntity")
    assert fired(result, "ByOtherType") is None
    assert "Ego touches Other" in reason(result, "ByEntity")


def test_off_road_counts_from_the_road_s_edge() -> None:
    result = run("OffroadCondition", parameters={"Duration": 0.5})
    ego = track(result, "Ego")
    left = ego["time"][np.argmax(ego["t"] < -9.0)]  # lanes of 3.5, 3.5 and 2 m
    assert fired(result) == pytest.approx(left + 0.5, abs=0.03)
    assert "off the road for 0.5" in reason(result)


def test_standing_still_counts_from_the_stop() -> None:
    assert when("StandStillCondition", Duration=1) == pytest.approx(
        2.0 + 20.0 / 4.0 + 1.0, abs=0.02
    )


@pytest.mark.parametrize(
    ("rule", "time"),
    [
        ("lessThan", 4.51),
        ("lessOrEqual", 4.5),
        ("equalTo", 4.5),
        ("greaterThan", 0.0),
        ("notEqualTo", 0.0),
    ],
)
def test_speed_is_compared_by_every_rule(rule: str, time: float) -> None:
    """20 − 4 (t − 2) m/s against 10 m/s."""
    assert when("SpeedCondition", Rule=rule) == pytest.approx(time)


def test_speed_along_the_axes() -> None:
    result = run("SpeedCondition")
    assert fired(result, "Longitudinal") == pytest.approx(4.51, abs=0.011)
    assert fired(result, "Lateral") == 0.0  # no lateral speed is less than 10 m/s
    assert reason(result).startswith("FiredCondition: speed of Ego = 9.96 m/s < 10 m/s")


def test_relative_speed_is_own_minus_other() -> None:
    """20 − 4 (t − 2) − 10 m/s."""
    assert when("RelativeSpeedCondition", Rule="lessThan", Value=0) == pytest.approx(4.51)
    assert when("RelativeSpeedCondition", Rule="greaterThan", Value=9) == 0.0
    assert when("RelativeSpeedCondition", Rule="lessThan", Value=-9) == pytest.approx(6.76)


def test_relative_speed_with_a_direction_is_projected_on_the_own_axes() -> None:
    """An oncoming car has −10 m/s along the ego's heading, so the difference is
    30 m/s; the plain speeds differ by 10.
    """
    result = run(
        "RelativeSpeedCondition", parameters={"OtherLane": 1, "Rule": "greaterThan", "Value": 29}
    )
    assert fired(result, "Longitudinal") == 0.0
    assert fired(result) is None


def test_acceleration_along_the_heading_is_negative_when_braking_and_the_total_is_a_magnitude() -> (
    None
):
    result = run("AccelerationCondition")
    assert fired(result, "Longitudinal") == pytest.approx(2.01)
    assert fired(result, "Total") == pytest.approx(2.01)
    assert fired(result, "Lateral") is None


def test_travelled_distance_is_the_odometer() -> None:
    assert when("TraveledDistanceCondition", Value=50) == pytest.approx(2.5, abs=0.011)


def test_a_position_is_reached_within_the_tolerance() -> None:
    assert when("ReachPositionCondition", Tolerance=2) == pytest.approx(4.9, abs=0.011)
    assert (
        when("ReachPositionCondition", Tolerance=2, TargetLane=-2) is None
    )  # passes 3.5 m beside it
    assert when("ReachPositionCondition", Tolerance=4, TargetLane=-2) == pytest.approx(
        5.0 - math.sqrt(16 - 3.5**2) / 20.0, abs=0.011
    )


SYSTEMS = ["entity", "lane", "road"]
SIDES = [("straight", -1), ("straight", 1), ("straight_lht", 1), ("straight_lht", -1)]
"""{RHT, LHT} × {lane of traffic with s, against s}"""


@pytest.mark.parametrize("system", SYSTEMS)
@pytest.mark.parametrize(("freespace", "gap"), [("false", 100.0), ("true", 95.0)])
@pytest.mark.parametrize(("road", "lane"), SIDES)
def test_longitudinal_distance_in_every_system_and_direction(
    road: str, lane: int, freespace: str, gap: float, system: str
) -> None:
    towards_s = (lane < 0) == (road == "straight")
    start, lead = (100, 200) if towards_s else (900, 800)
    places = {
        "Road": f"../roads/{road}.xodr",
        "Lane": lane,
        "OtherLane": lane,
        "EgoS": start,
        "OtherS": lead,
    }
    time = when("RelativeDistanceCondition", **places, System=system, Freespace=freespace)
    assert time == pytest.approx((gap - 50.0) / 10.0 + 0.01, abs=1e-6)


@pytest.mark.parametrize("system", SYSTEMS)
@pytest.mark.parametrize(("freespace", "distance"), [("false", 3.5), ("true", 1.5)])
def test_lateral_distance_in_every_system(system: str, freespace: str, distance: float) -> None:
    for value, time in ((distance + 0.1, 0.0), (distance - 0.1, None)):
        options = {
            "System": system,
            "Freespace": freespace,
            "Type": "lateral",
            "Rule": "lessThan",
            "Value": value,
            "OtherLane": -2,
        }
        assert when("RelativeDistanceCondition", **options) == time


@pytest.mark.parametrize(
    ("freespace", "distance"), [("false", math.hypot(50.0, 3.5)), ("true", math.hypot(45.0, 1.5))]
)
@pytest.mark.parametrize("name", ["euclidianDistance", "cartesianDistance"])
def test_euclidean_distance_goes_across_lanes(freespace: str, distance: float, name: str) -> None:
    options = {
        "Type": name,
        "Freespace": freespace,
        "OtherLane": -2,
        "Rule": "lessThan",
        "Value": distance,
    }
    assert when("RelativeDistanceCondition", **options) == pytest.approx(5.0, abs=0.011)


def test_distances_to_a_position() -> None:
    """The position is 100 − 20 t ahead; the ego's front 4 m less."""
    assert when("DistanceCondition", Value=50) == pytest.approx(2.51)
    assert when("DistanceCondition", Value=50, Freespace="true") == pytest.approx(
        (96.0 - 50.0) / 20.0 + 0.01
    )
    assert when(
        "DistanceCondition", Value=50, System="entity", Type="euclidianDistance"
    ) == pytest.approx(2.51)
    result = run("DistanceCondition", parameters={"Value": 50})
    assert (
        reason(result)
        == "FiredCondition: longitudinal distance (road) Ego–position = 49.8 m < 50 m"
    )


def test_time_headway_is_distance_by_own_speed() -> None:
    """(100 − 10 t) / 20 < 2 s."""
    result = run("TimeHeadwayCondition")
    assert fired(result) == pytest.approx(6.01)
    assert (
        reason(result)
        == "FiredCondition: longitudinal time headway (road) Ego–Other = 1.995 s < 2 s"
    )
    assert when("TimeHeadwayCondition", Freespace="true") == pytest.approx(5.51)


def test_time_headway_is_undefined_towards_those_behind() -> None:
    assert when("TimeHeadwayCondition", EgoS=300, Rule="greaterThan", Value=0) is None
    assert when("TimeHeadwayCondition", EgoS=300, Rule="lessThan", Value=1000) is None


def test_time_to_collision_is_distance_by_closing_speed() -> None:
    """(100 − 10 t) / 10 < 3 s to the other; (300 − 20 t) / 20 < 3 s to the
    position at s = 400 m.
    """
    result = run("TimeToCollisionCondition")
    assert fired(result) == pytest.approx(7.01)
    assert fired(result, "Position") == pytest.approx(12.01)
    assert (
        reason(result)
        == "FiredCondition: longitudinal time to collision (road) Ego–Other = 2.99 s < 3 s"
    )
    assert when("TimeToCollisionCondition", Freespace="true") == pytest.approx(6.51)
    assert when(
        "TimeToCollisionCondition", Type="euclidianDistance", System="entity"
    ) == pytest.approx(7.01)


def test_time_to_collision_is_undefined_while_moving_apart() -> None:
    assert when("TimeToCollisionCondition", EgoS=300, Rule="greaterThan", Value=0) is None


def test_time_to_collision_with_an_oncoming_car_adds_the_speeds() -> None:
    """400 m closing at 30 m/s."""
    assert when("TimeToCollisionCondition", OtherLane=1, OtherS=500) == pytest.approx(
        (400.0 - 90.0) / 30.0, abs=0.02
    )


@pytest.mark.parametrize(
    ("free_space", "occupied", "cleared"),
    [
        ("false", (100.0 - 30.0) / 10.0, (100.0 + 10.0) / 10.0),
        ("true", (99.0 - 30.0) / 10.0, (104.0 + 10.0) / 10.0),
    ],
)
def test_clearance_of_the_lane_beside(free_space: str, occupied: float, cleared: float) -> None:
    result = run("RelativeClearanceCondition", parameters={"FreeSpace": free_space})
    assert fired(result, "Free") == 0.0
    assert fired(result, "Occupied") == pytest.approx(occupied, abs=0.011)
    assert fired(result, "Cleared") == pytest.approx(cleared, abs=0.011)
    assert (
        reason(result, "Cleared")
        == "ClearedCondition: lanes +1 of Ego from -10 m to 30 m are clear (rising)"
    )


@pytest.mark.parametrize(
    ("road", "lane", "left"),
    [("straight", -2, -1), ("straight", 2, 1), ("straight_lht", 1, 2), ("straight_lht", -1, -2)],
)
def test_relative_lane_1_is_to_the_left_for_every_traffic(road: str, lane: int, left: int) -> None:
    towards_s = (lane < 0) == (road == "straight")
    parameters = {
        "Road": f"../roads/{road}.xodr",
        "Lane": lane,
        "OtherLane": left,
        "EgoS": 500,
        "OtherS": 510 if towards_s else 490,
    }
    assert when("RelativeClearanceCondition", "Free", **parameters) != 0.0
    assert (
        when(
            "RelativeClearanceCondition",
            "Free",
            **{**parameters, "From": -1, "To": -1, "Opposite": "true"},
        )
        == 0.0
    )


def test_lanes_that_do_not_exist_are_not_clear() -> None:
    assert when("RelativeClearanceCondition", "Free", From=-3, To=-3) is None


def test_opposite_lanes_count_only_when_asked_for() -> None:
    parameters = {"From": 1, "To": 3, "OtherLane": 1, "OtherS": 120}
    assert when("RelativeClearanceCondition", "Free", **parameters) == 0.0
    assert when("RelativeClearanceCondition", "Free", **parameters, Opposite="true") != 0.0


def test_angles_in_the_world_turn_with_the_curve() -> None:
    """The heading is 0.01 s; on the lane's radius of 101.75 m, s grows by 20 / 1.0175 m/s."""
    result = run("AngleCondition")
    assert fired(result) == pytest.approx((49.0 - 20.0) * 1.0175 / 20.0, abs=0.011)
    assert "heading of Ego (world) = 0.49" in reason(result)


def test_angles_in_road_coordinates_do_not() -> None:
    for system in ("road", "lane"):
        assert when("AngleCondition", System=system, Value=0) == 0.0
        assert when("AngleCondition", System=system, Value=0.5) is None


def test_angles_against_s_point_the_other_way() -> None:
    assert when("AngleCondition", System="road", Lane=1, EgoS=200, Value=math.pi) == 0.0


def test_relative_angle_is_own_minus_other() -> None:
    """The other one stands at 0.8 rad; the ego is 0.3 rad short of it at s = 50 m."""
    assert when("RelativeAngleCondition") == pytest.approx((49.0 - 20.0) * 1.0175 / 20.0, abs=0.011)
    assert when("RelativeAngleCondition", System="road", Value=0) == 0.0


def test_a_range_needs_only_one_of_its_lanes_to_exist() -> None:
    assert when("RelativeClearanceCondition", "Free", From=-3, To=-1, Opposite="true") == 0.0
