"""SpeedAction, SpeedProfileAction and LongitudinalDistanceAction, by the
standard's formulas. All begin at 1 s.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import runner
from runner.engine.participants.declaration import Performance
from tests.conformance.support import SCENARIOS, at, changed, events, run, track

DT = 0.01
LENGTH = 5.0


def speed_run(**parameters: object) -> object:
    return run("SpeedAction", world="kinematic", parameters=parameters)


# SpeedAction --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("shape", "value"),
    [
        ("linear", lambda p: p),
        ("cubic", lambda p: 3 * p**2 - 2 * p**3),
        ("sinusoidal", lambda p: (1 - np.cos(np.pi * p)) / 2),
    ],
)
def test_speed_follows_its_shape_over_time(shape: str, value: object) -> None:
    car = track(speed_run(Shape=shape, Dimension="time", Value=4.0), "Car")
    progress = np.clip((car["time"] - 1.0) / 4.0, 0.0, 1.0)
    assert np.allclose(car["speed"], 10.0 + 10.0 * value(progress), atol=1e-9)


@pytest.mark.parametrize(
    ("shape", "duration"), [("linear", 5.0), ("cubic", 7.5), ("sinusoidal", 2.5 * math.pi)]
)
def test_a_rate_is_the_greatest_acceleration(shape: str, duration: float) -> None:
    result = speed_run(Shape=shape, Dimension="rate", Value=2.0)
    car = track(result, "Car")
    assert np.diff(car["speed"]).max() / DT == pytest.approx(2.0, rel=1e-3)
    (end,) = events(result, "endTransition", "CarAction")
    assert end.time == pytest.approx(1.0 + duration, abs=2 * DT)


@pytest.mark.parametrize(
    ("start", "target"), [(10.0, 20.0), (20.0, 0.0), (0.0, 20.0), (10.0, -10.0)]
)
def test_a_distance_is_the_way_to_the_target_speed(start: float, target: float) -> None:
    car = track(
        speed_run(Shape="cubic", Dimension="distance", Value=60.0, StartSpeed=start, Target=target),
        "Car",
    )
    reached = int(np.argmax(car["speed"] == target))
    way = np.abs(np.diff(car["x"]))[round(1.0 / DT) : reached].sum()
    assert way == pytest.approx(60.0, abs=abs(start - target) * DT)
    assert car["speed"][-1] == pytest.approx(target)


@pytest.mark.parametrize(
    ("shape", "dimension", "value"),
    [("step", "time", 3.0), ("linear", "time", 0.0), ("cubic", "distance", 0.0)],
)
def test_what_takes_no_time_is_there_after_one_step_and_complete_at_once(
    shape: str, dimension: str, value: float
) -> None:
    result = speed_run(Shape=shape, Dimension=dimension, Value=value)
    car = track(result, "Car")
    assert (at(car, 1.0, "speed"), at(car, 1.0 + DT, "speed")) == pytest.approx((10.0, 20.0))
    assert events(result, "endTransition", "CarAction")[0].time == pytest.approx(1.0)


def test_a_rate_of_zero_keeps_the_speed_and_never_ends() -> None:
    result = speed_run(Dimension="rate", Value=0.0)
    assert np.all(track(result, "Car")["speed"] == 10.0)
    assert not events(result, "endTransition", "CarAction")


def test_a_negative_target_reverses_without_turning() -> None:
    car = track(speed_run(Dimension="time", Value=2.0, Target=-5.0), "Car")
    assert car["speed"][-1] == -5.0
    assert np.diff(car["x"])[-1] == pytest.approx(-5.0 * DT)
    assert np.allclose(car["h"], 0.0)


def test_following_stays_within_the_performance_and_position_does_not() -> None:
    steep = {"Shape": "linear", "Dimension": "rate", "Value": 8.0}
    assert np.diff(
        track(speed_run(Mode="follow", **steep), "Car")["speed"]
    ).max() / DT == pytest.approx(5.0)
    assert np.diff(
        track(speed_run(Mode="position", **steep), "Car")["speed"]
    ).max() / DT == pytest.approx(8.0)


@pytest.mark.parametrize(
    ("relation", "value", "final"), [("delta", 5.0, 25.0), ("factor", 0.5, 10.0)]
)
def test_a_continuous_relative_speed_follows_the_reference(
    relation: str, value: float, final: float
) -> None:
    result = speed_run(
        Relation=relation, RelativeValue=value, Continuous=True, Dimension="time", Value=4.0
    )
    follower = track(result, "Follower")
    assert follower["speed"][-1] == pytest.approx(final)
    assert not events(result, "endTransition", "FollowerAction")


def test_a_relative_speed_is_that_of_the_start_unless_continuous() -> None:
    result = speed_run(Continuous=False, Dimension="time", Value=4.0)
    assert track(result, "Follower")["speed"][-1] == 15.0
    assert events(result, "endTransition", "FollowerAction")


def test_a_continuous_relative_speed_keeps_its_rate() -> None:
    follower = track(
        speed_run(Continuous=True, Dimension="rate", Value=1.0, Mode="position"), "Follower"
    )
    assert np.abs(np.diff(follower["speed"])).max() / DT == pytest.approx(1.0)


# SpeedProfileAction -------------------------------------------------------------------------


def profile_run(**parameters: object) -> object:
    return run("SpeedProfileAction", world="kinematic", parameters=parameters)


def test_a_profile_in_position_mode_is_linear_between_its_targets() -> None:
    car = track(profile_run(), "Car")
    wanted = np.interp(
        car["time"], [1.0, 5.0, 9.0, 10.0], [0.0, 10.0, 4.0, 8.0]
    )  # the last as fast as 4 m/s² allow
    assert np.allclose(car["speed"], wanted, atol=1e-6)


def test_a_relative_profile_is_added_to_the_reference() -> None:
    result = profile_run()
    car, relative = track(result, "Car"), track(result, "Relative")
    assert relative["speed"][-1] == pytest.approx(car["speed"][-1] + 8.0, abs=4.0 * DT + 1e-6)


def test_a_profile_in_follow_mode_keeps_jerk_and_begins_and_ends_without_acceleration() -> None:
    result = profile_run()
    smooth = track(result, "Smooth")
    acceleration = np.diff(smooth["speed"]) / DT
    jerk = np.diff(acceleration) / DT
    assert jerk.max() <= 4.0 + 1e-6 and jerk.min() >= -2.0 - 1e-6
    assert acceleration.max() <= 4.0 + 1e-6 and acceleration.min() >= -4.0 - 1e-6
    assert acceleration[-1] == pytest.approx(0.0)
    assert smooth["speed"][-1] == pytest.approx(8.0)


def test_a_profile_keeps_its_maximum_speed_and_takes_the_time_that_its_limits_need() -> None:
    car = track(profile_run(First=30.0, MaxSpeed=20.0), "Car")
    wanted = np.interp(car["time"], [1.0, 6.0, 10.0, 11.0], [0.0, 20.0, 4.0, 8.0])
    assert np.allclose(car["speed"], wanted, atol=1e-6)


# LongitudinalDistanceAction -----------------------------------------------------------------


def distance_run(**parameters: object) -> object:
    return run("LongitudinalDistanceAction", world="kinematic", parameters=parameters)


@pytest.mark.parametrize("system", ("entity", "lane", "road"))
@pytest.mark.parametrize(
    ("displacement", "side"),
    [("trailingReferencedEntity", 1), ("leadingReferencedEntity", -1), ("any", 1)],
)
@pytest.mark.parametrize("freespace", (True, False))
def test_a_rigid_distance_holds_on_either_side(
    system: str, displacement: str, side: int, freespace: bool
) -> None:
    result = distance_run(System=system, Displacement=displacement, Freespace=freespace)
    ahead = track(result, "Lead")["x"] - track(result, "Rigid")["x"]
    assert np.allclose(ahead[110:] * side, 20.0 + (LENGTH if freespace else 0.0), atol=1e-6)
    assert np.allclose(track(result, "Rigid")["speed"][110:], 10.0)


@pytest.mark.parametrize(
    ("displacement", "side"), [("trailingReferencedEntity", 1), ("leadingReferencedEntity", -1)]
)
def test_a_limited_time_gap_is_reached_within_the_limits(displacement: str, side: int) -> None:
    result = distance_run(Displacement=displacement)
    limited, lead = track(result, "Limited"), track(result, "Lead")
    assert np.abs(np.diff(limited["speed"])).max() / DT <= 3.0 + 1e-6
    assert limited["speed"].max() <= 30.0
    assert (lead["x"] - limited["x"])[-1] * side == pytest.approx(2.0 * 10.0 + LENGTH, abs=0.01)
    assert limited["speed"][-1] == pytest.approx(10.0, abs=1e-3)


def test_a_limited_time_gap_keeps_its_jerk() -> None:
    limited = track(distance_run(MaxJerk=1.0), "Limited")
    assert np.abs(np.diff(limited["speed"], 2)).max() / DT**2 <= 1.0 + 1e-4
    assert limited["speed"][-1] == pytest.approx(10.0, abs=0.1)


def test_a_distance_ends_when_reached_unless_continuous() -> None:
    result = distance_run(Continuous=False)
    assert [
        len(events(result, "endTransition", name)) for name in ("RigidAction", "LimitedAction")
    ] == [1, 1]
    result = distance_run(Continuous=True)
    assert [
        len(events(result, "endTransition", name)) for name in ("RigidAction", "LimitedAction")
    ] == [0, 0]


@pytest.mark.parametrize("lane", ("-1", "1"))
def test_distances_are_those_of_the_direction_faced(lane: str) -> None:
    result = distance_run(Lane=lane, S=500.0, LeadS=560.0 if lane == "-1" else 440.0)
    ahead = (track(result, "Lead")["x"] - track(result, "Rigid")["x"]) * (1 if lane == "-1" else -1)
    assert np.allclose(ahead[110:], 25.0, atol=1e-6)


def test_a_rigid_distance_holds_along_a_curve() -> None:
    result = distance_run(
        Road="../roads/curve.xodr", System="road", Freespace=False, S=20.0, LeadS=60.0
    )
    gap = track(result, "Lead")["s"] - track(result, "Rigid")["s"]
    assert np.allclose(gap[110:1500], 20.0, atol=1e-3)


def test_the_limits_of_an_action_may_exceed_the_performance() -> None:
    limited = track(distance_run(MaxAcceleration=9.0), "Limited")
    assert (
        np.abs(np.diff(limited["speed"])).max() / DT > Performance(60.0, 5.0, 10.0).max_acceleration
    )


def test_a_profile_begins_at_the_speed_that_its_event_has_just_set(tmp_path: Path) -> None:
    step = """<Action name="StepAction"><PrivateAction><LongitudinalAction><SpeedAction>
      <SpeedActionDynamics dynamicsShape="step" dynamicsDimension="time" value="0"/>
      <SpeedActionTarget><AbsoluteTargetSpeed value="2"/></SpeedActionTarget>
    </SpeedAction></LongitudinalAction></PrivateAction></Action>"""
    profile = '<Action name="CarAction">'
    path = changed(SCENARIOS / "SpeedProfileAction.xosc", tmp_path, (profile, step + profile))
    result = runner.run(path, sut=None, timestep=0.01, world="kinematic")
    start, car = events(result, "startTransition", "CarAction")[0].time, track(result, "Car")
    assert at(car, start + 0.01, "speed") == pytest.approx(2.0, abs=0.1)
