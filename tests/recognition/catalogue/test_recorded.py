"""Catalogues of real recordings: TAF-BW, INTERACTION format with Lanelet2 maps."""

from __future__ import annotations

import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import runner
from recognition import recordings as datasets
from recognition.catalogue import pipeline, recordings
from recognition.catalogue.detect import ByRules
from recognition.catalogue.pipeline import Summary
from recognition.catalogue.recordings import CatalogueSettings
from recognition.catalogue.whole import write_replay
from recognition.labels import Rules
from schemas import check_many
from schemas.common.terminal.command_line import progress_bar
from schemas.common.terminal.files import expand
from studies.recognition import fidelity

TRACKS = "taf_bw/recorded_trackfiles"
SETTINGS = CatalogueSettings(scenes=recordings.VEHICLES, rules=Rules(signalised=True))


def build(path: Path, out: Path) -> Summary:
    return pipeline.build([path], out, SETTINGS, ByRules, partial(progress_bar, quiet=True))


@pytest.mark.slow
def test_scenes_of_real_vehicles_are_sound_and_repeat_the_recording(
    recordings: Path, tmp_path: Path
) -> None:
    path = recordings / TRACKS / "k729_2022-03-16" / "vehicle_tracks_004.csv"
    summary = build(path, tmp_path)
    assert summary.passages.total() == 17
    rules = {
        problem.rule.rpartition(".")[2]
        for _, problems in check_many(expand([str(tmp_path)]))
        for problem in problems
    }
    assert rules <= {"avoid_redundant_info"}, "a warning about roads of converted maps"
    runs = dict(
        fidelity.of_catalogue(
            tmp_path, datasets.open(path).sources, SETTINGS.config.scope, "kinematic"
        )
    )
    assert len(runs) == 17
    everyone = [each for run in runs.values() for each in run.deviations]
    assert max(each.greatest for each in everyone) < 0.05
    vehicles = [each for each in everyone if each.category != "pedestrian"]
    rows = sum(each.rows for each in vehicles)
    assert sum(each.rows * each.speed**2 for each in vehicles) / rows < 0.1**2
    assert sum(each.rows * each.acceleration**2 for each in vehicles) / rows < 0.5**2
    assert max(each.hardest for each in vehicles) < 10.0


@pytest.mark.slow
@pytest.mark.parametrize(("raw", "turned"), [(False, 0.001), (True, 0.1)])
def test_a_replay_of_real_vehicles_is_smooth_unless_raw(
    raw: bool, turned: float, recordings: Path, tmp_path: Path
) -> None:
    """Standing cars keep their heading (to 1 mrad); raw replays have the
    recorded places to 1 mm.
    """
    path = recordings / TRACKS / "k729_2022-03-16" / "vehicle_tracks_004.csv"
    made = write_replay(path, tmp_path / "whole.xosc", raw=raw)
    said = [remark for remark in made.remarks if "off the recorded places" in remark]
    assert len(said) == (not raw)
    recorded = datasets.open(path).sources[0].load().tracks
    played = runner.run(made.files[0], sut=None, world="kinematic", timestep=0.05).recording.tracks
    ego = next(name for name in recorded if f"ego {name}" in made.files[0].read_text("utf-8"))
    start = float(recorded[ego].columns["time"][0])
    turns = []
    for name, track in played.items():
        columns, seen = (
            track.columns,
            recorded[name.split("_")[-1] if name != "Ego" else ego].columns,
        )
        time = columns["time"] + start
        there = (time > seen["time"][0] - 1e-6) & (time < seen["time"][-1] + 1e-6)
        for axis in "xy":
            expected = np.interp(time[there], seen["time"], seen[f"raw_{axis}" if raw else axis])
            assert columns[axis][there] == pytest.approx(expected, abs=1e-3 if raw else 0.05)
        stands = np.abs(columns["speed"][1:]) < 0.05
        turns.append(np.abs(np.diff(np.unwrap(columns["h"])))[stands].sum())
    assert max(turns) < turned
    assert raw == (max(turns) > 0.01), "the recorded headings of standing cars jitter"


@pytest.mark.study
def test_two_lanes_of_a_junction_do_not_bring_sumo_down(recordings: Path, tmp_path: Path) -> None:
    """Vehicle 44 straddles two lanes that turn, when vehicle 60 comes up behind
    it: SUMO 1.28 did not survive that.
    """
    build(recordings / TRACKS / "k733_2020-09-15", tmp_path)
    scenario = tmp_path / "vehicles" / "k733_2020-09-15_000_41.xosc"
    command = [sys.executable, "-m", "runner.xosc_run", "--sut", "none", str(scenario)]
    assert subprocess.run(command, capture_output=True, timeout=120).returncode in (0, 1)
