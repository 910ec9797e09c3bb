"""Smoothing: motion from noisy positions, jumps, limits, and recordings that need none."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

from recognition import recordings as datasets
from recognition.recordings.motion.observations import LIMITS
from runner.recording import Recording
from schemas.common.array_types import FloatArray
from tests.recognition.traffic import interaction_rows, read, write_csv

N = 120
TIME = np.arange(N) * 0.1


def recorded(
    folder: Path, x: FloatArray, y: FloatArray, h: FloatArray, **other: object
) -> tuple[Recording, datasets.Report]:
    """A recording of one vehicle with these centres and headings."""
    vx, vy = np.gradient(x, 0.1), np.gradient(y, 0.1)
    values = {"x": x, "y": y, "vx": vx, "vy": vy, "psi_rad": h}
    rows = interaction_rows(1, 0.0, 0.0, 0.0, 0.0, 0.0, n=len(x), **other)
    rows = [
        row | {name: float(each[k]) for name, each in values.items()} for k, row in enumerate(rows)
    ]
    return read(write_csv(folder / "site" / "vehicle_tracks_000.csv", rows))


def braking() -> tuple[FloatArray, FloatArray]:
    """Way and speed of a vehicle at 15 m/s that brakes to 5 m/s from 4 to 8 s."""
    acceleration = np.where((TIME > 4.0) & (TIME <= 8.0), -2.5, 0.0)
    speed = 15.0 + np.cumsum(acceleration) * 0.1
    return np.concatenate([[0.0], np.cumsum(0.05 * (speed[1:] + speed[:-1]))]), speed


def rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def test_speeds_and_accelerations_of_noisy_positions_are_near_the_true_ones(tmp_path: Path) -> None:
    noise = np.random.default_rng(1).normal(0.0, 0.15, (2, N))
    way, speed = braking()
    recording, _ = recorded(tmp_path, way + noise[0], noise[1], np.zeros(N))
    columns = recording.tracks["1"].columns
    inner = slice(5, -5)
    assert (
        rms((columns["speed"] - speed)[inner]) < 0.25 < rms((columns["raw_speed"] - speed)[inner])
    )
    assert rms((columns["acceleration"] - np.gradient(speed, 0.1))[inner]) < 0.6
    assert np.abs(columns["h"][inner]).max() < 0.05


def test_motion_without_noise_stays_what_it_is(tmp_path: Path) -> None:
    way, speed = braking()
    h = np.zeros(N)
    columns = recorded(tmp_path, way, h, h)[0].tracks["1"].columns
    assert columns["x"] == pytest.approx(columns["raw_x"], abs=0.03)
    assert rms(columns["speed"] - speed) < 0.05


def test_a_turning_vehicle_keeps_its_way_and_heading(tmp_path: Path) -> None:
    angle = 0.6 * TIME
    x, y = (
        10.0 * np.sin(angle) + 1.2 * np.cos(angle),
        10.0 * (1.0 - np.cos(angle)) + 1.2 * np.sin(angle),
    )
    columns = recorded(tmp_path, x, y, angle)[0].tracks["1"].columns
    assert np.hypot(columns["x"] - columns["raw_x"], columns["y"] - columns["raw_y"]).max() < 0.02
    assert columns["speed"][10:-10] == pytest.approx(6.0, abs=0.15)


def test_standing_vehicle_that_jitters_stands_and_does_not_turn(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    x, y = rng.normal(0.0, 0.05, (2, N))
    columns = (
        recorded(tmp_path, x, y, rng.choice([0.5, 0.5, 0.5 + math.pi], N))[0].tracks["1"].columns
    )
    assert np.ptp(columns["h"]) < 0.1
    assert np.ptp(columns["x"]) < 0.4
    assert rms(columns["speed"]) < 0.1


def test_rows_that_jump_away_and_come_back_are_not_followed(tmp_path: Path) -> None:
    x = 10.0 * TIME
    y = np.where((np.arange(N) >= 50) & (np.arange(N) < 54), 6.0, 0.0)
    recording, report = recorded(tmp_path, x, y, np.zeros(N))
    columns = recording.tracks["1"].columns
    assert np.abs(columns["y"]).max() < 0.1
    assert columns["raw_y"].max() == 6.0
    assert "1: 4 rows are away by more than 2.0 m and come back: interpolated" in report.remarks
    assert not report.cuts


def test_track_that_jumps_for_good_is_cut_and_reported(tmp_path: Path) -> None:
    x = 10.0 * TIME + np.where(np.arange(N) >= 60, 8.0, 0.0)
    recording, report = recorded(tmp_path, x, np.zeros(N), np.zeros(N))
    assert {name: len(track.columns["time"]) for name, track in recording.tracks.items()} == {
        "1": 60,
        "1.2": 60,
    }
    (cut,) = report.cuts
    assert (cut.track, cut.rest) == ("1", "1.2")
    assert (cut.start, cut.end) == pytest.approx((6.0, 6.1))
    assert cut.distance == pytest.approx(8.0, abs=0.5)
    assert (report.rows, report.tracks) == (N, 2)
    for track in recording.tracks.values():
        assert track.columns["speed"] == pytest.approx(10.0, abs=0.2)


def test_little_that_is_left_after_a_jump_is_excluded(tmp_path: Path) -> None:
    x = 10.0 * TIME + np.where(np.arange(N) >= N - 3, 8.0, 0.0)
    recording, report = recorded(tmp_path, x, np.zeros(N), np.zeros(N))
    assert [len(track.columns["time"]) for track in recording.tracks.values()] == [N - 3]
    assert report.cuts[0].rest is None
    assert report.exclusions == [datasets.Exclusion("1", 3, "shorter than 0.5 s after a cut")]


def test_track_with_a_long_gap_is_cut(tmp_path: Path) -> None:
    rows = interaction_rows(1, 0.0, 0.0, 10.0, 0.0, 0.0, n=60)
    recording, report = read(
        write_csv(tmp_path / "site" / "vehicle_tracks_000.csv", rows[:20] + rows[35:])
    )
    assert list(recording.tracks) == ["1", "1.2"]
    assert report.cuts == [datasets.Cut("1", 2.0, 3.6, 0.0, "1.2")]
    assert report.missing == 15


@pytest.mark.parametrize(
    ("agent", "category"), [("car", "car"), ("truck", "truck"), ("pedestrian", "pedestrian")]
)
def test_no_one_moves_beyond_what_is_possible(tmp_path: Path, agent: str, category: str) -> None:
    rng = np.random.default_rng(3)
    x = 8.0 * TIME + np.where((TIME > 3.0) & (TIME < 3.6), 1.8, 0.0) + rng.normal(0.0, 0.3, N)
    y = rng.normal(0.0, 0.3, N)
    columns = recorded(tmp_path, x, y, np.zeros(N), agent_type=agent)[0].tracks["1"].columns
    limits, tolerance = LIMITS[category], 1.05
    assert columns["acceleration"].max() <= tolerance * limits.acceleration
    assert columns["acceleration"].min() >= -tolerance * limits.braking
    assert np.abs(np.diff(columns["acceleration"])).max() / 0.1 <= tolerance * limits.jerk
    assert np.abs(np.diff(np.unwrap(columns["h"]))).max() / 0.1 <= tolerance * limits.yaw_rate
    assert np.abs(columns["raw_acceleration"]).max() > 1.2 * limits.acceleration


def test_vehicles_at_the_limit_are_told_with_the_time(tmp_path: Path) -> None:
    hard = 5.0 * TIME + np.where(TIME > 4.0, 3.5 * (TIME - 4.0) ** 2, 0.0)
    report = recorded(tmp_path, hard, np.zeros(N), np.zeros(N))[1]
    (told,) = (remark for remark in report.remarks if "limit of its kind" in remark)
    assert re.match(r"1: 5\.0 m/s² at [2-5]\.\d0 s, in \d+ rows", told)
    assert not any(
        "limit" in remark
        for remark in recorded(tmp_path, 8.0 * TIME, np.zeros(N), np.zeros(N))[1].remarks
    )


def test_vehicle_that_reverses_keeps_its_heading(tmp_path: Path) -> None:
    x = np.where(TIME < 6.0, -2.0 * TIME, -12.0 + 3.0 * (TIME - 6.0))
    columns = recorded(tmp_path, x, np.zeros(N), np.zeros(N))[0].tracks["1"].columns
    assert np.abs(columns["h"]).max() < 0.02
    assert columns["speed"][10:50] == pytest.approx(-2.0, abs=0.2)
    assert columns["speed"][75:-5] == pytest.approx(3.0, abs=0.2)


@pytest.mark.parametrize("mirrored", [False, True], ids=["leaving", "entering"])
def test_rows_at_the_edge_of_the_view_that_turn_back_hard_are_left_out_and_reported(
    tmp_path: Path, mirrored: bool
) -> None:
    x = 8.0 * TIME - 2.25 * np.maximum(TIME - 9.5, 0.0) ** 2  # at 11.3 s it turns back
    x = -x[::-1] if mirrored else x
    recording, report = recorded(tmp_path, x, np.zeros(N), np.zeros(N))
    columns = recording.tracks["1"].columns
    assert columns["speed"].min() >= 0.0 and len(columns["time"]) == report.rows < N
    (left,) = report.exclusions
    assert left.what == "1" and left.rows == N - report.rows
    assert re.match(
        r"at the edge of the view it turns back at \d+\.\d0 s with -?\d\.\d "
        r"m/s², which nothing does",
        left.reason,
    )
    assert columns["time"][0] == pytest.approx(0.1 + 0.1 * left.rows * mirrored)


def test_vehicle_that_stops_before_it_reverses_at_the_end_keeps_all_rows(tmp_path: Path) -> None:
    x = np.interp(TIME, [0.0, 6.0, 10.0], [0.0, 30.0, 30.0]) - np.where(
        TIME > 10.0, 0.4 * (TIME - 10.0) ** 2, 0.0
    )
    report = recorded(tmp_path, x, np.zeros(N), np.zeros(N))[1]
    assert report.rows == N and not report.exclusions


@pytest.mark.slow
def test_no_vehicle_of_real_recordings_moves_beyond_what_is_possible(recordings: Path) -> None:
    for source in datasets.open(recordings / "taf_bw").sources:
        for track in source.load().tracks.values():
            columns, limits = track.columns, LIMITS[track.category]
            assert np.abs(columns["speed"]).max() <= limits.speed
            assert columns["acceleration"].max() <= 1.4 * limits.acceleration
            assert columns["acceleration"].min() >= -1.1 * limits.braking
            turns = columns["speed"][[0, -1]] < 0.0
            assert not (turns & (np.abs(columns["acceleration"][[0, -1]]) > 4.0)).any()
