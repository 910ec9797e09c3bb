"""Transition shapes, durations, and the gap controller."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree

from runner.engine.motion.dynamics import (
    RESERVE,
    SHAPES,
    GapController,
    TransitionDynamics,
    gap_speeds,
    read_constraints,
    tighter,
)
from runner.engine.motion.speed_plans import pursued
from runner.engine.participants.declaration import Performance
from schemas.common.errors import InvalidFile
from xosc.document.node import Node

SMOOTH = ("linear", "cubic", "sinusoidal")
DT = 0.01


def node(text: str) -> Node:
    return Node(etree.fromstring(text), Path("dynamics.xosc"))


def dynamics(
    shape: str = "linear", dimension: str = "time", value: object = 4.0, extra: str = ""
) -> TransitionDynamics:
    text = f'<D dynamicsShape="{shape}" dynamicsDimension="{dimension}" value="{value}" {extra}/>'
    return TransitionDynamics.from_xml(node(text), (1, 3))


@pytest.mark.parametrize("name", SMOOTH)
def test_a_shape_runs_from_0_to_1_about_its_middle(name: str) -> None:
    value = SHAPES[name].value
    assert (value(0.0), value(0.5), value(1.0)) == pytest.approx((0.0, 0.5, 1.0))
    assert all(value(p) + value(1.0 - p) == pytest.approx(1.0) for p in (0.1, 0.3, 0.45))


@pytest.mark.parametrize("name", SMOOTH)
def test_the_slope_of_a_shape_is_its_steepest(name: str) -> None:
    shape, h = SHAPES[name], 1e-4
    slopes = [(shape.value(p + h) - shape.value(p)) / h for p in (i / 1000 for i in range(1000))]
    assert max(slopes) == pytest.approx(shape.slope, rel=1e-3)


@pytest.mark.parametrize("name", ("cubic", "sinusoidal"))
def test_the_bend_of_a_smooth_shape_is_its_greatest_second_derivative(name: str) -> None:
    shape, h = SHAPES[name], 1e-3
    bends = [
        (shape.value(p + h) - 2 * shape.value(p) + shape.value(p - h)) / h**2
        for p in (i / 1000 for i in range(1, 1000))
    ]
    assert max(bends) == pytest.approx(shape.bend, rel=1e-2)


@pytest.mark.parametrize(
    ("shape", "duration"),
    [("linear", 5.0), ("cubic", 7.5), ("sinusoidal", 5.0 * math.pi / 2), ("step", 0.0)],
)
def test_a_rate_is_the_steepest_slope(shape: str, duration: float) -> None:
    assert dynamics(shape, "rate", 2.0).extent(-10.0) == pytest.approx(duration)


def test_the_sign_of_a_rate_says_nothing() -> None:
    assert dynamics(dimension="rate", value=-2.0).extent(10.0) == 5.0


def test_a_rate_of_zero_never_arrives_unless_it_is_there() -> None:
    still = dynamics(dimension="rate", value=0.0)
    assert still.extent(1.0) == math.inf
    assert still.extent(0.0) == 0.0


@pytest.mark.parametrize("dimension", ("time", "distance"))
def test_zero_time_or_distance_is_at_once(dimension: str) -> None:
    assert dynamics(dimension=dimension, value=0.0).speed_duration(0.0, 10.0, Performance()) == 0.0


def test_a_change_over_a_distance_takes_the_time_that_the_distance_takes() -> None:
    assert dynamics("cubic", "distance", 60.0).speed_duration(
        10.0, 20.0, Performance()
    ) == pytest.approx(4.0)
    assert dynamics("linear", "distance", 10.0).speed_duration(
        0.0, 5.0, Performance()
    ) == pytest.approx(4.0)


def test_a_change_of_direction_over_a_distance_counts_both_ways() -> None:
    # |v| from 10 to 0 and 0 to 10 is 5 m/s on average
    assert dynamics("linear", "distance", 20.0).speed_duration(
        10.0, -10.0, Performance()
    ) == pytest.approx(4.0, rel=1e-4)


def test_following_stretches_the_transition_to_what_the_vehicle_can_do() -> None:
    limits = Performance(60.0, 2.0, 4.0)
    follow = dynamics("cubic", "time", 1.0, 'followingMode="follow"')
    assert follow.speed_duration(0.0, 10.0, limits) == pytest.approx(7.5)
    assert follow.speed_duration(10.0, 0.0, limits) == pytest.approx(3.75)
    assert (
        dynamics("cubic", "time", 1.0, 'followingMode="position"').speed_duration(0.0, 10.0, limits)
        == 1.0
    )


def test_position_is_the_default_from_1_2_on() -> None:
    text = node('<D dynamicsShape="linear" dynamicsDimension="time" value="1"/>')
    assert [TransitionDynamics.from_xml(text, (1, minor)).strict for minor in range(4)] == [
        False,
        False,
        True,
        True,
    ]


@pytest.mark.parametrize(
    "attributes", ('value="-1"', 'value="NaN"', 'value="x"', "", 'value="1" followingMode="loose"')
)
def test_meaningless_dynamics_are_refused(attributes: str) -> None:
    with pytest.raises(InvalidFile, match=r"dynamics\.xosc"):
        TransitionDynamics.from_xml(
            node(f'<D dynamicsShape="linear" dynamicsDimension="time" {attributes}/>'), (1, 3)
        )


def test_constraints_that_are_not_given_are_infinite_and_those_of_the_performance_hold_too() -> (
    None
):
    constraints = read_constraints(node('<DynamicConstraints maxAcceleration="2"/>'))
    assert constraints == Performance(math.inf, 2.0, math.inf, math.inf, math.inf)
    assert tighter(constraints, Performance(50.0, 9.0, 8.0)) == Performance(50.0, 2.0, 8.0)
    assert tighter(constraints, Performance(50.0, 1.0, 8.0)) == Performance(50.0, 1.0, 8.0)
    assert read_constraints(None) is None


def close(
    gap: float, speed: float, limits: Performance, time: float
) -> tuple[list[float], list[float]]:
    """Gaps and speeds while a controller drives towards a resting goal."""
    controller, gaps, speeds = GapController(limits), [gap], [speed]
    for _ in range(int(time / DT)):
        speeds.append(controller.speed(gaps[-1], speeds[-1], 0.0, DT))
        gaps.append(gaps[-1] - speeds[-1] * DT)
    return gaps, speeds


@pytest.mark.slow
@settings(max_examples=50, deadline=None)
@given(st.floats(-200.0, 200.0), st.floats(0.5, 10.0), st.floats(0.5, 10.0), st.floats(2.0, 40.0))
def test_a_gap_closes_within_the_limits_and_hardly_overshoots(
    gap: float, forward: float, back: float, top: float
) -> None:
    gaps, speeds = close(gap, 0.0, Performance(top, forward, back), 150.0)
    assert abs(gaps[-1]) < 0.05
    assert min(math.copysign(1.0, gap) * g for g in gaps) > -0.05 - 0.02 * abs(gap)
    rates = [(b - a) / DT for a, b in pairwise(speeds)]
    assert -back - 1e-6 <= min(rates) and max(rates) <= forward + 1e-6
    assert max(map(abs, speeds)) <= top + 1e-9


@pytest.mark.slow
@settings(max_examples=30, deadline=None)
@given(st.floats(5.0, 150.0), st.floats(1.0, 5.0), st.floats(0.5, 5.0))
def test_jerk_stays_within_its_limit_and_the_gap_closes(
    gap: float, limit: float, jerk: float
) -> None:
    gaps, speeds = close(gap, 0.0, Performance(30.0, limit, limit, jerk, jerk), 300.0)
    rates = [(b - a) / DT for a, b in pairwise(speeds)]
    assert max(abs(b - a) / DT for a, b in pairwise([0.0, *rates])) <= jerk + 1e-4
    assert abs(gaps[-1]) < 0.2


class Chasing:
    """The alternative: the planner of speed changes chases the speed of a stop within the gap.

    Args:
        slope: u / gap near the goal, 1/s; None: the greatest speed from which a stop with the jerk
            limit is possible.
    """

    def __init__(self, limits: Performance, slope: float | None) -> None:
        self.limits, self.slope, self.acceleration = limits, slope, 0.0

    def speed(self, gap: float, speed: float, goal_speed: float, dt: float) -> float:
        brake = RESERVE * self.limits.max_deceleration
        jerk, far = self.limits.max_deceleration_rate, abs(gap)
        if self.slope is not None:
            knee = brake / self.slope
            bent = math.sqrt(max(2.0 * brake * far - knee * knee, 0.0))
            closing = self.slope * far if self.slope * far <= knee else bent
        else:
            closing = (far * far * jerk) ** (1.0 / 3.0)
            ramp = brake / jerk
            if closing > brake * ramp:
                closing = 0.5 * brake * (math.sqrt(ramp * ramp + 8.0 * far / brake) - ramp)
        target = goal_speed + math.copysign(closing, gap)
        planned, self.acceleration = pursued(speed, self.acceleration, target, self.limits, dt)
        return planned


def behind_a_steady_lead(
    controller: GapController | Chasing, gap: float, dt: float = 0.05
) -> tuple[float, float]:
    """Greatest overshoot (m), and the time (s) from which on the gap is within
    10 cm of its goal.
    """
    speed, most, late = 20.0, 0.0, 0.0
    for step in range(1200):
        speed = controller.speed(gap, speed, 20.0, dt)
        gap += (20.0 - speed) * dt
        most = max(most, -gap)
        late = step * dt if abs(gap) > 0.1 else late
    return most, late


def test_a_plan_of_speeds_closes_gaps_worse() -> None:
    limits, gaps = Performance(60.0, 2.0, 4.0, 2.0, 2.0), (100.0, 30.0, 5.0)
    slope = 0.5 * min(math.sqrt(0.4 * 4.0), 2.0 / 4.0)
    now = [behind_a_steady_lead(GapController(limits), gap) for gap in gaps]
    same_law = [behind_a_steady_lead(Chasing(limits, slope), gap) for gap in gaps]
    fastest = [behind_a_steady_lead(Chasing(limits, None), gap) for gap in gaps]
    assert max(over for over, _ in now) < 0.01
    assert sum(late for _, late in same_law) > 1.25 * sum(late for _, late in now)
    assert max(over for over, _ in fastest) > 1.0


def test_without_limits_of_acceleration_the_gap_closes_as_fast_as_the_speed_allows() -> None:
    gaps, speeds = close(1.0, 0.0, Performance(2.0), 1.0)
    assert speeds[1] == 2.0
    assert gaps[-1] == pytest.approx(0.0, abs=1e-9)


def test_controllers_of_many_runs_close_gaps_as_single_ones() -> None:
    random = np.random.default_rng(5)
    n = 300
    limits = np.where(random.random((n, 5)) < 0.3, np.inf, random.uniform(0.0, 8.0, (n, 5)))
    limits[:, 0] = 60.0
    singles = [GapController(Performance(*map(float, row))) for row in limits]
    numbers = np.array([single.numbers for single in singles]).T.copy()
    gap, speed = random.normal(0.0, 15.0, n), random.uniform(0.0, 30.0, n)
    goal = random.uniform(0.0, 30.0, n)
    rows = random.random(n) < 0.8
    for _ in range(50):
        found = gap_speeds(numbers, rows, gap, speed, goal, DT)
        for row in np.flatnonzero(rows):
            told = singles[row].speed(float(gap[row]), float(speed[row]), float(goal[row]), DT)
            assert found[row] == pytest.approx(told, rel=1e-12, abs=1e-12)
        speed = np.where(rows, found, speed)
        gap += (goal - speed) * DT
    for row in np.flatnonzero(~rows):
        assert numbers[6, row] == 0.0
