"""Criticality measures on cases worked out by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import Polygon

from runner.engine.motion import rss
from runner.engine.participants.boxes import box_corners
from runner.engine.participants.declaration import BoundingBox
from runner.engine.participants.outlines import box_distance, boxes_overlap
from runner.judging.measures.contacts import post_encroachment_time
from runner.judging.measures.criticality import (
    criticality,
    deceleration_to_avoid_crash,
    lateral_violation,
    longitudinal_violation,
    rss_margin,
    time_headway,
    time_to_collision,
)
from runner.judging.measures.relations import MotionRows, View, relations

CAR = BoundingBox(1.5, 0.0, 0.75, 5.0, 2.0, 1.5)


def motion(
    name: str,
    x: float,
    speed: float,
    *,
    y: float = 0.0,
    h: float = 0.0,
    until: float = 10.0,
    dt: float = 0.1,
    road: str | None = None,
    start: float = 0.0,
    sideways: float = 0.0,
    z: float = 0.0,
) -> MotionRows:
    """Constant velocity from x, y; on a road, s and t are x and y."""
    time = np.round(np.arange(round(start / dt), round(until / dt) + 1) * dt, 9)
    since = time - start
    xs = x + since * speed * math.cos(h)
    ys = y + since * (speed * math.sin(h) + sideways)
    count = len(time)
    roads = np.full(count, road, object)
    h_, v_, z_ = (np.full(count, value) for value in (h, speed, z))
    return MotionRows(name, CAR, time, xs, ys, z_, h_, v_, roads, xs.copy(), ys.copy())


def test_measures_of_a_lead_are_those_of_the_textbook() -> None:
    found = criticality(
        motion("Ego", 0.0, 20.0, until=2.0), [motion("Lead", 45.0, 10.0, until=2.0)]
    )
    gap = 45.0 - 5.0
    assert found.ttc.value[0] == pytest.approx(gap / 10.0)
    assert found.thw.value[0] == pytest.approx(gap / 20.0)
    assert found.drac.value[0] == pytest.approx(10.0**2 / (2.0 * gap))
    assert found.distance.value[0] == pytest.approx(gap)
    assert list(found.lead[:2]) == ["Lead", "Lead"]
    summary = found.summary
    assert summary["min_ttc"] == {
        "value": pytest.approx((gap - 20.0) / 10.0),
        "time": pytest.approx(2.0),
        "other": "Lead",
    }
    assert summary["min_distance"]["value"] == pytest.approx(20.0)


@pytest.mark.parametrize("road", [None, "1"])
def test_what_is_not_defined_is_not_valid_and_zero(road: str | None) -> None:
    ego = motion("Ego", 0.0, 20.0, until=1.0, road=road)
    faster, beside, behind = (
        motion("Faster", 40.0, 30.0, until=1.0, road=road),
        motion("Beside", 40.0, 0.0, y=3.5, until=1.0, road=road),
        motion("Behind", -40.0, 30.0, until=1.0, road=road),
    )
    assert not criticality(ego, [faster]).ttc.valid.any()
    assert criticality(ego, [faster]).thw.valid.all()
    for other in (beside, behind):
        found = criticality(ego, [other])
        assert not (found.ttc.valid.any() or found.thw.valid.any() or found.drac.valid.any())
        assert found.distance.valid.all()
    alone = criticality(ego, [])
    assert not alone.distance.valid.any()
    assert alone.summary.pop("max_jerk") == pytest.approx(0.0)  # which needs nobody else
    assert set(alone.summary.values()) == {None}
    for measure in (alone.ttc, alone.thw, alone.drac, alone.distance):
        assert not measure.value.any()


def test_standing_has_no_headway_and_overlap_no_time_left() -> None:
    zero, ten = np.zeros(1), np.full(1, 10.0)
    assert not time_headway(ten, zero).valid[0]
    assert time_to_collision(zero, -ten) == (zero, np.array([True]))
    assert not deceleration_to_avoid_crash(zero, ten).valid[0]
    assert deceleration_to_avoid_crash(ten, ten).value[0] == pytest.approx(5.0)


def test_someone_who_appears_later_counts_from_then_on() -> None:
    found = criticality(
        motion("Ego", 0.0, 10.0, until=2.0), [motion("Late", 60.0, 0.0, start=1.0, until=2.0)]
    )
    assert list(found.distance.valid) == [False] * 10 + [True] * 11
    assert found.active.sum() == 11


def test_the_table_has_a_flag_for_each_measure() -> None:
    table = criticality(motion("Ego", 0.0, 10.0), [motion("Lead", 60.0, 0.0)]).table()
    assert {
        "time",
        "lead",
        "ttc",
        "ttc_valid",
        "drac_valid",
        "rss_violation_ad_rss",
        "rss_violation_r157",
    } <= table.keys()
    assert len({len(column) for column in table.values()}) == 1
    assert not any(np.isnan(column).any() for column in table.values() if column.dtype.kind == "f")


# RSS ----------------------------------------------------------------------------------------


def view(
    ahead: float = 0.0,
    aside: float = 0.0,
    v: float = 0.0,
    other: float = 0.0,
    lateral: float = 0.0,
    other_lateral: float = 0.0,
) -> View:
    return View(*(np.array([value]) for value in (ahead, aside, v, lateral, other, other_lateral)))


AD_RSS, R157 = rss.PARAMETERS["ad-rss"], rss.PARAMETERS["r157"]


def test_the_safe_distance_behind_is_that_of_the_formula() -> None:
    needed = 20.0 * 0.75 + 0.5 * 3.0 * 0.75**2 + (20.0 + 0.75 * 3.0) ** 2 / 12.0 - 15.0**2 / 12.0
    assert needed == pytest.approx(38.349, abs=1e-3)
    assert longitudinal_violation(view(needed - 0.01, v=20.0, other=15.0), R157)[0]
    assert not longitudinal_violation(view(needed + 0.01, v=20.0, other=15.0), R157)[0]


def test_being_followed_takes_the_response_time_of_the_other() -> None:
    needed = 20.0 * 2.0 + 0.5 * 3.5 * 4.0 + (20.0 + 7.0) ** 2 / 8.0 - 15.0**2 / 16.0
    assert longitudinal_violation(view(-needed + 0.01, v=15.0, other=20.0), AD_RSS)[0]
    assert not longitudinal_violation(view(-needed - 0.01, v=15.0, other=20.0), AD_RSS)[0]


def test_an_oncoming_participant_needs_its_stopping_distance_too() -> None:
    reached = 10.0 + 0.75 * 3.0
    needed = 10.0 * 0.75 + 0.5 * 3.0 * 0.75**2 + reached**2 / 12.0 + 10.0**2 / 12.0
    assert longitudinal_violation(view(needed - 0.01, v=10.0, other=-10.0), R157)[0]
    assert not longitudinal_violation(view(needed + 0.01, v=10.0, other=-10.0), R157)[0]


def test_the_lateral_safe_distance_is_that_of_the_formula_on_both_sides() -> None:
    reached = 1.0 + 0.75
    needed = 0.3 + (1.0 + reached) / 2 * 0.75 + reached**2 / 2.0 + (0.75 / 2 * 0.75 + 0.75**2 / 2.0)
    for side in (1.0, -1.0):  # the other one comes from the left, from the right, with 1 m/s
        assert lateral_violation(view(aside=side * (needed - 0.01), other_lateral=-side), R157)[0]
        assert not lateral_violation(view(aside=side * (needed + 0.01), other_lateral=-side), R157)[
            0
        ]


def test_boxes_side_by_side_are_too_close_lengthwise_and_the_other_way_round() -> None:
    assert longitudinal_violation(view(0.0, other=50.0), R157)[0]
    assert lateral_violation(view(aside=0.0, other_lateral=5.0), R157)[0]


def test_the_rss_margin_is_what_is_left_of_the_safe_distance() -> None:
    needed = 20.0 * 0.75 + 0.5 * 3.0 * 0.75**2 + (20.0 + 0.75 * 3.0) ** 2 / 12.0 - 15.0**2 / 12.0
    assert rss_margin(view(needed + 3.0, v=20.0, other=15.0), R157)[0] == pytest.approx(3.0)
    assert rss_margin(view(needed - 3.0, v=20.0, other=15.0), R157)[0] == pytest.approx(-3.0)
    across = 0.3 + 2 * (0.75 / 2 * 0.75 + 0.75**2 / 2.0)
    assert rss_margin(view(aside=2.0), R157)[0] == pytest.approx(2.0 - across)
    assert rss_margin(view(needed - 3.0, 2.0, v=20.0, other=15.0), R157)[0] == pytest.approx(
        2.0 - across
    )


@given(
    *[st.floats(-60.0, 60.0) for _ in range(2)],
    *[st.floats(-30.0, 30.0) for _ in range(2)],
    st.sampled_from(["x", "y", "xy", ""]),
)
def test_a_negative_rss_margin_is_a_violation(
    ahead: float, aside: float, v: float, other: float, zero: str
) -> None:
    seen = view(0.0 if "x" in zero else ahead, 0.0 if "y" in zero else aside, v=v, other=other)
    violated = longitudinal_violation(seen, AD_RSS)[0] and lateral_violation(seen, AD_RSS)[0]
    assert (rss_margin(seen, AD_RSS)[0] < 0.0) == violated


def test_risk_is_the_share_of_steps_before_the_collision() -> None:
    found = criticality(
        motion("Ego", 0.0, 10.0, dt=0.5), [motion("Wall", 105.0, 0.0, dt=0.5)]
    )  # gap 100 − 10 t
    needed = 10.0 * 0.75 + 0.5 * 3.0 * 0.75**2 + 12.25**2 / 12.0
    expected = [gap < needed for gap in np.arange(100.0, -0.1, -5.0)]
    assert found.active.all()
    assert found.risk("r157") == pytest.approx(np.mean(expected))
    longer = criticality(
        motion("Ego", 0.0, 10.0, dt=0.5, until=14.0),
        [motion("Wall", 105.0, 0.0, dt=0.5, until=14.0)],
    )
    assert longer.risk("r157") == pytest.approx(np.mean(expected))


def test_a_car_in_the_next_lane_is_no_violation() -> None:
    for road in (None, "1"):
        found = criticality(
            motion("Ego", 0.0, 20.0, road=road), [motion("Beside", 10.0, 20.0, y=4.0, road=road)]
        )
        assert found.risk("ad-rss") == 0.0


# road coordinates ---------------------------------------------------------------------------


def test_on_a_curve_gaps_follow_the_road() -> None:
    ego, lead = (
        motion("Ego", 0.0, 10.0, until=1.0, road="1"),
        motion("Lead", 50.0, 10.0, until=1.0, road="1"),
    )
    ego.h[:], lead.h[:] = 0.0, 1.2  # the road turns between them
    seen = relations(ego, [lead]).view
    assert seen.ahead == pytest.approx(np.full(11, 45.0))
    assert seen.other_speed == pytest.approx(np.full(11, 10.0))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_road_gaps_have_the_signs_of_the_ego_driving_with_and_against_s(side: float) -> None:
    def along(m: MotionRows) -> MotionRows:
        m.s[:], m.t[:] = side * m.s, side * m.t
        return m

    ego = along(motion("Ego", 0.0, 10.0, until=1.0, road="1"))
    lead = along(motion("Lead", 30.0, 10.0, y=4.0, until=1.0, road="1", sideways=-0.5))
    seen = relations(ego, [lead]).view
    assert seen.ahead[0] == pytest.approx(25.0)
    assert seen.aside[0] == pytest.approx(2.0)
    assert seen.other_sideways[5] == pytest.approx(-0.5)
    assert seen.other_speed[0] == pytest.approx(10.0)


def test_an_oncoming_car_on_the_same_road_has_negative_speed() -> None:
    ego = motion("Ego", 0.0, 10.0, until=1.0, road="1")
    seen = relations(ego, [motion("Oncoming", 80.0, 10.0, h=math.pi, until=1.0, road="1")]).view
    assert seen.other_speed == pytest.approx(np.full(11, -10.0))
    assert seen.ahead[0] == pytest.approx(80.0 - 4.0 - 4.0)


# boxes and post-encroachment time -----------------------------------------------------------

coordinate = st.floats(-12.0, 12.0)
angle = st.floats(-math.pi, math.pi)


@given(coordinate, coordinate, angle, angle)
def test_box_distance_is_that_of_the_outlines(x: float, y: float, h: float, turn: float) -> None:
    a, b = motion("a", 0.0, 0.0, h=h, until=0.0), motion("b", x, 0.0, y=y, h=turn, until=0.0)
    expected = Polygon(box_corners(0.0, 0.0, h, CAR)).distance(
        Polygon(box_corners(x, y, turn, CAR))
    )
    assert box_distance(a, b)[0] == pytest.approx(expected, abs=1e-9)
    assert boxes_overlap(a, b)[0] == (box_distance(a, b)[0] == 0.0)


def test_post_encroachment_time_of_crossing_paths() -> None:
    """The ego's rear leaves the 2 m wide path at x = 11 after 1.2 s; the other's
    front enters y = −1 after 4.5 s.
    """
    ego = motion("Ego", 0.0, 10.0)
    other = motion("Other", 10.0, 10.0, y=-50.0, h=math.pi / 2)
    found = post_encroachment_time(ego, [other])
    assert found is not None
    assert found.value == pytest.approx(4.5 - 1.2, abs=0.1)
    swapped = post_encroachment_time(other, [ego])
    assert swapped is not None and swapped.value == pytest.approx(found.value)


def test_post_encroachment_time_is_zero_in_a_collision_and_none_without_an_encounter() -> None:
    ego = motion("Ego", 0.0, 10.0)
    assert post_encroachment_time(ego, [motion("Wall", 50.0, 0.0)]) == (
        0.0,
        pytest.approx(4.6, abs=0.11),
        "Wall",
    )
    assert post_encroachment_time(ego, [motion("Beside", 0.0, 10.0, y=5.0)]) is None
    assert post_encroachment_time(ego, [motion("Follower", -150.0, 10.0)]) is None


def test_post_encroachment_time_of_a_follower_is_its_time_gap() -> None:
    found = post_encroachment_time(motion("Ego", 0.0, 10.0), [motion("Follower", -25.0, 10.0)])
    assert found is not None
    assert found.value == pytest.approx(2.0, abs=0.1)


def test_someone_on_a_bridge_is_not_met() -> None:
    ego, above = motion("Ego", 0.0, 10.0), motion("Above", 50.0, 0.0, z=6.0)
    found = criticality(ego, [above])
    assert found.summary["pet"] is None
    assert found.distance.value[found.distance.valid].min() > 5.0
    assert not found.violation["r157"][~found.distance.valid].any()


def test_someone_higher_up_the_same_slope_is_met() -> None:
    found = criticality(
        motion("Ego", 0.0, 20.0, until=1.0), [motion("Lead", 105.0, 10.0, z=6.0, until=1.0)]
    )
    assert found.ttc.value[0] == pytest.approx(10.0)


@pytest.mark.parametrize("step", [0.05, 0.1, 0.25])
def test_jerk_is_the_same_for_any_time_step(step: float) -> None:
    time = np.arange(0.0, 4.0 + step / 2, step)
    # Full braking at once, from 2 s on: 8 m/s² within half a second are 16 m/s³.
    speed = 20.0 - 8.0 * np.maximum(time - 2.0, 0.0)
    ego = replace(motion("Ego", 0.0, 20.0, until=4.0), time=time, speed=speed)
    whole = {name: np.zeros(len(time)) for name in ("x", "y", "z", "h", "s", "t")}
    ego = replace(ego, **whole, road=np.full(len(time), None, object))
    assert criticality(ego, []).summary["max_jerk"] == pytest.approx(16.0)
