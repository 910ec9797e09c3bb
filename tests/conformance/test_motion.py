"""Motion at the vertices of trajectories: speed and acceleration along them; and
Interpolation between vertices.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from runner import RunResult
from schemas.common.errors import InvalidFile, Unsupported
from tests.conformance.support import SCENARIOS, at, changed, track
from tests.conformance.support import run as run_scenario


@pytest.fixture(scope="module")
def result() -> RunResult:
    return run_scenario("Motion", world="kinematic")


def speed_at(result: RunResult, entity: str, x: float) -> float:
    columns = track(result, entity)
    return float(np.interp(x, columns["x"].astype(float), columns["speed"].astype(float)))


@pytest.mark.parametrize(
    ("x", "speed"),
    [
        (100.5, 5.2),
        (125.0, math.sqrt((25 + 225) / 2)),
        (150.0, 15.0),
        (175.0, math.sqrt((225 + 100) / 2)),
        (199.0, 10.1),
    ],
)
def test_speeds_at_vertices_are_kept_with_a_constant_acceleration_between(
    result: RunResult, x: float, speed: float
) -> None:
    assert speed_at(result, "Speeds", x) == pytest.approx(speed, abs=0.15)


def test_an_acceleration_alone_holds_from_the_present_speed_on(result: RunResult) -> None:
    columns = track(result, "Accelerated")
    for time in (1.0, 3.0, 5.0):
        assert at(columns, time, "speed") == pytest.approx(10.0 + 2.0 * time, abs=0.05)
        assert at(columns, time, "x") == pytest.approx(100.0 + 10.0 * time + time * time, abs=0.1)


def test_times_and_speeds_at_vertices_both_hold(result: RunResult) -> None:
    columns = track(result, "Timed")
    for time, x, speed in ((0.02, 100.1, 5.0), (6.0, 180.0, 15.0), (11.99, 259.9, 10.0)):
        assert at(columns, time, "x") == pytest.approx(x, abs=0.1)
        assert at(columns, time, "speed") == pytest.approx(speed, abs=0.15)


@pytest.mark.parametrize(
    ("entity", "speeds"),
    [("Bend", {0.02: 5.0, 3.0: 10.0, 5.98: 15.0}), ("Spline", {0.02: 5.0, 4.0: 15.0, 7.18: 10.0})],
)
def test_clothoids_have_speeds_at_their_ends(
    entity: str, speeds: dict[float, float], result: RunResult
) -> None:
    columns = track(result, entity)
    for time, speed in speeds.items():
        assert at(columns, time, "speed") == pytest.approx(speed, abs=0.1)


def test_speeds_that_do_not_lead_to_the_end_are_refused() -> None:
    with pytest.raises(InvalidFile, match="nothing accelerates it"):
        run_scenario("Motion", world="kinematic", parameters={"Start": 0, "Middle": 0})


def test_a_standing_start_with_an_acceleration_gets_away(tmp_path: Path) -> None:
    started = 'speed_longitudinal="0" acceleration_longitudinal="2"'
    path = changed(
        SCENARIOS / "Motion.xosc", tmp_path, ('acceleration_longitudinal="$Acceleration"', started)
    )
    columns = track(run_scenario(str(path.with_suffix("")), world="kinematic"), "Accelerated")
    assert at(columns, 4.0, "x") == pytest.approx(116.0, abs=0.2)


def test_motions_at_places_without_a_time_are_left_out_with_a_remark(tmp_path: Path) -> None:
    path = changed(SCENARIOS / "Motion.xosc", tmp_path, ('<Vertex time="6">', "<Vertex>"))
    result = run_scenario(str(path.with_suffix("")), world="kinematic")
    (remark,) = (remark for remark in result.remarks if "left out" in remark)
    line = (
        next(n for n, text in enumerate(path.read_text().splitlines(), 1) if 'x="180"' in text) + 2
    )
    assert remark.startswith(f"{path}:{line}: Motion at a place without a time")
    assert at(track(result, "Timed"), 11.99, "x") == pytest.approx(259.9, abs=0.1)
    with pytest.raises(InvalidFile, match="Motion at a place without a time"):
        run_scenario(str(path.with_suffix("")), world="kinematic", strict=True)


@pytest.mark.parametrize(
    ("motion", "error", "text"),
    [
        ("", InvalidFile, "speed_longitudinal or acceleration_longitudinal is expected"),
        ('speed_longitudinal="-3"', Unsupported, "followed forwards"),
    ],
)
def test_motions_that_say_nothing_or_lead_backwards_are_refused(
    motion: str, error: type[Exception], text: str, tmp_path: Path
) -> None:
    path = changed(
        SCENARIOS / "Motion.xosc", tmp_path, ('acceleration_longitudinal="$Acceleration"', motion)
    )
    with pytest.raises(error, match=text):
        run_scenario(str(path.with_suffix("")), world="kinematic")


def test_an_interpolation_makes_a_smooth_curve_through_the_vertices_with_a_remark() -> None:
    result = run_scenario("Interpolation", world="kinematic")
    assert any("smooth curve" in remark for remark in result.remarks)
    for entity, most in (("Smooth", 0.02), ("Straight", 0.2)):
        columns = track(result, entity)
        x, y, h = (columns[name].astype(float) for name in "xyh")
        assert np.interp([100.0, 130.0, 160.0, 189.0], x, y) == pytest.approx(
            [-1.75, -1.75, -5.25, -5.25], abs=0.15
        )
        assert (np.max(np.abs(np.diff(h[x < 189.0]))) < 0.02) == (most < 0.1)


def test_a_follower_that_has_to_join_the_trajectory_keeps_its_speeds_from_there_on(
    tmp_path: Path,
) -> None:
    path = changed(
        SCENARIOS / "Motion.xosc", tmp_path, ('followingMode="position"', 'followingMode="follow"')
    )
    result = run_scenario(str(path.with_suffix("")), world="kinematic")
    for x, speed in ((150.0, 15.0), (198.0, 10.2)):
        assert speed_at(result, "Speeds", x) == pytest.approx(speed, abs=0.3)
