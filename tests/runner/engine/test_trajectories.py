"""Paths by arc length, NURBS curves, schedules, and the way back from a place to a path."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from runner.engine.motion.nurbs import ControlPoint, sampled
from runner.engine.motion.paths import (
    Chain,
    Corner,
    Path,
    Polyline,
    Segments,
    approach,
    nearest,
    tangent,
    turns_back,
)
from runner.engine.motion.schedules import Schedule, smooth, steady
from xodr.model import WorldPose
from xodr.model.geometry import Arc, Line, Spiral, Start

COORDINATE = st.floats(-200.0, 200.0)
POINTS = st.lists(st.tuples(COORDINATE, COORDINATE), min_size=2, max_size=8)


def circle(radius: float = 50.0) -> tuple[ControlPoint, ...]:
    """A quarter of a circle round (0, radius), from the origin on."""
    corners = ((0.0, 0.0, 1.0), (radius, 0.0, math.sqrt(0.5)), (radius, radius, 1.0))
    return tuple(ControlPoint(x, y, 0.0, weight, None, None) for x, y, weight in corners)


def paths() -> list[Path]:
    """One path of each kind."""
    bent = [Spiral(Start(10.0, 5.0, 0.3, 30.0), 0.0, 0.05), Line(Start(0.0, 0.0, 0.0, 1.0))]
    x, y, h = bent[0].at(30.0)
    spiral = Segments([bent[0], Arc(Start(x, y, h, 20.0), 0.05)], 1.0)
    corners = Polyline([Corner(0, 0, 0), Corner(10, 0, 1), Corner(10, 20, 1), Corner(-5, 20, 0)])
    curve = sampled(3, circle(), (0.0, 0.0, 0.0, 1.0, 1.0, 1.0)).path
    return [
        corners,
        spiral,
        curve,
        Chain(approach(-10.0, -5.0, 0.0, 0.0, corners.at(4.0)), corners, 4.0),
    ]


@pytest.mark.parametrize("path", paths())
def test_arc_length_is_the_way_travelled(path: Path) -> None:
    s = np.linspace(0.0, path.length, 4001)
    poses = [path.at(float(v)) for v in s]
    steps = [math.hypot(b.x - a.x, b.y - a.y) for a, b in pairwise(poses)]
    assert sum(steps) == pytest.approx(path.length, rel=1e-4)
    assert max(steps) < 1.01 * path.length / 4000


@pytest.mark.parametrize("path", paths())
def test_the_nearest_place_of_a_point_of_a_path_is_that_point(path: Path) -> None:
    for share in np.linspace(0.0, 1.0, 23):
        pose = path.at(float(share) * path.length)
        found = path.at(nearest(path, pose.x, pose.y))
        assert (found.x, found.y) == pytest.approx((pose.x, pose.y), abs=1e-5)


@pytest.mark.parametrize("path", paths())
def test_beyond_its_ends_a_path_goes_on_straight(path: Path) -> None:
    end, beyond = path.at(path.length), path.at(path.length + 3.0)
    h = tangent(path, path.length)
    assert (beyond.x, beyond.y) == pytest.approx(
        (end.x + 3.0 * math.cos(h), end.y + 3.0 * math.sin(h)), abs=1e-3
    )


@given(POINTS)
def test_a_polyline_passes_its_corners(points: list[tuple[float, float]]) -> None:
    path = Polyline([Corner(x, y, 0.0) for x, y in points])
    for station, (x, y) in zip(path.stations, points, strict=True):
        pose = path.at(station)
        assert (pose.x, pose.y) == pytest.approx((x, y), abs=1e-6)


@given(POINTS, COORDINATE, COORDINATE)
def test_the_nearest_place_on_a_polyline_is_no_farther_than_any_other(
    points: list[tuple[float, float]], x: float, y: float
) -> None:
    path = Polyline([Corner(px, py, 0.0) for px, py in points])
    found = path.at(nearest(path, x, y))
    gap = math.hypot(found.x - x, found.y - y)
    for share in np.linspace(0.0, 1.0, 50):
        other = path.at(float(share) * path.length)
        assert gap <= math.hypot(other.x - x, other.y - y) + 1e-6


def test_headings_of_a_polyline_are_interpolated_the_short_way_round_where_they_are_given() -> None:
    path = Polyline([Corner(0, 0, 0, h=3.0), Corner(10, 0, 0, h=-3.0), Corner(20, 0, 0)])
    assert math.remainder(path.at(5.0).h - math.pi, math.tau) == pytest.approx(0.0, abs=1e-9)
    # from −3 to the line's own direction
    assert path.at(15.0).h == pytest.approx(-1.5)


def test_corners_at_one_place_leave_a_path_without_length() -> None:
    path = Polyline([Corner(3, 4, 0, h=1.0), Corner(3, 4, 0)])
    assert path.length == 0.0
    assert path.at(0.0) == WorldPose(3, 4, 0, 1.0, 0.0, 0.0)


@given(st.floats(0.0, 1.0))
def test_a_nurbs_quarter_circle_is_exact(share: float) -> None:
    path = sampled(3, circle(), (0.0, 0.0, 0.0, 1.0, 1.0, 1.0)).path
    assert path.length == pytest.approx(50.0 * math.pi / 2, rel=1e-6)
    pose = path.at(share * path.length)
    assert math.hypot(pose.x, pose.y - 50.0) == pytest.approx(50.0, abs=1e-5)
    assert pose.h == pytest.approx(share * math.pi / 2, abs=1e-4)


def test_a_nurbs_of_order_two_is_the_control_polygon() -> None:
    points = tuple(
        ControlPoint(x, y, 0.0, 1.0, float(i), None)
        for i, (x, y) in enumerate(((0, 0), (10, 0), (10, 5)))
    )
    curve = sampled(2, points, (0.0, 0.0, 1.0, 2.0, 2.0))
    assert curve.path.length == pytest.approx(15.0, abs=0.05)
    assert curve.times[-1] == 2.0


@pytest.mark.parametrize(
    ("order", "count", "knots", "reason"),
    [
        (1, 3, (0, 0, 1, 1), "must be 2 or more"),
        (4, 3, (0,) * 7, "needs 4 control points"),
        (3, 3, (0, 0, 0, 1, 1), "need 6 knots"),
        (3, 3, (0, 0, 0, 1, 1, 0.5), "must not decrease"),
        (2, 4, (0, 0, 1, 1, 2, 2), "must not occur 2 times"),
    ],
)
def test_numbers_that_make_no_curve_are_refused(
    order: int, count: int, knots: tuple[float, ...], reason: str
) -> None:
    points = tuple(ControlPoint(float(i), 0.0, 0.0, 1.0, None, None) for i in range(count))
    with pytest.raises(ValueError, match=reason):
        sampled(order, points, tuple(map(float, knots)))


STEPS = st.lists(st.tuples(st.floats(0.01, 10.0), st.floats(0.0, 50.0)), min_size=2, max_size=8)


def scheduled(kind: Callable[..., Schedule], steps: list[tuple[float, float]]) -> Schedule:
    """A schedule from durations (s) and ways (m)."""
    return kind(
        np.cumsum([t for t, _ in steps]).tolist(), np.cumsum([s for _, s in steps]).tolist()
    )


@pytest.mark.parametrize("kind", [steady, smooth])
@given(steps=STEPS, time=st.floats(-10.0, 100.0))
def test_a_schedule_never_goes_back(
    kind: Callable[..., Schedule], steps: list[tuple[float, float]], time: float
) -> None:
    schedule = scheduled(kind, steps)
    assert schedule.stations[0] <= schedule.station(time) <= schedule.stations[-1]
    assert schedule.station(time) <= schedule.station(time + 1.0) + 1e-9


@pytest.mark.parametrize("kind", [steady, smooth])
@given(steps=STEPS, share=st.floats(0.0, 1.0))
def test_a_schedule_passes_its_vertices_and_says_when_as_well_as_where(
    kind: Callable[..., Schedule], steps: list[tuple[float, float]], share: float
) -> None:
    schedule = scheduled(kind, steps)
    for time, station in zip(schedule.times, schedule.stations, strict=True):
        assert schedule.station(time) == pytest.approx(station, abs=1e-6)
    station = schedule.stations[0] + share * (schedule.stations[-1] - schedule.stations[0])
    assert schedule.station(schedule.time(station)) == pytest.approx(station, abs=1e-4)


@given(STEPS)
def test_a_smooth_schedule_has_no_jumps_of_speed(steps: list[tuple[float, float]]) -> None:
    schedule = scheduled(smooth, steps)
    fastest = max(4.0 * way / time for time, way in steps[1:])
    quickest = max(fastest / (0.5 * time) for time, _ in steps[1:])
    times = np.linspace(schedule.times[0], schedule.times[-1], 401)
    speeds = np.diff([schedule.station(float(time)) for time in times]) / np.diff(times)
    assert np.abs(np.diff(speeds)).max() <= quickest * (times[1] - times[0]) * (1.0 + 1e-6) + 1e-6


@pytest.mark.parametrize("start", [None, 3.0])
def test_a_motion_of_one_acceleration_is_met_by_its_vertices(start: float | None) -> None:
    times = np.arange(0.0, 6.0, 0.5)
    schedule = smooth(times.tolist(), (3.0 * times + 0.7 * times**2).tolist(), start)
    for time in np.linspace(0.0, 5.5, 100):
        assert schedule.station(float(time)) == pytest.approx(3.0 * time + 0.7 * time**2, abs=1e-9)
    assert schedule.final_speed == pytest.approx(3.0 + 1.4 * 5.5)


def test_where_a_way_turns_back_a_smooth_schedule_stops() -> None:
    path = Polyline([Corner(x, 0, 0) for x in (0, 10, 20, 10, 0)])
    assert [turns_back(path, s) for s in path.stations[1:-1]] == [False, True, False]
    schedule = smooth([0.0, 1.0, 2.0, 3.0, 4.0], path.stations, rests=[20.0])
    assert schedule.station(2.01) - schedule.station(1.99) < 0.01


def test_vertices_at_one_time_are_one_in_a_smooth_schedule() -> None:
    schedule = smooth([0.0, 1.0, 1.0, 2.0], [0.0, 10.0, 10.0, 20.0])
    assert [schedule.station(t) for t in (0.5, 1.0, 1.5)] == pytest.approx([5.0, 10.0, 15.0])
    assert smooth([1.0, 1.0], [0.0, 0.0]).station(2.0) == 0.0


def test_a_steady_schedule_stands_and_goes_on() -> None:
    schedule = steady([0.0, 2.0, 5.0, 6.0], [0.0, 20.0, 20.0, 30.0])
    assert schedule.station(3.0) == 20.0
    assert schedule.time(10.0) == 1.0
    assert schedule.time(25.0) == 5.5
    assert schedule.final_speed == 10.0
