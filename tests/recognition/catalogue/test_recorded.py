"""Catalogues of real recordings: TAF-BW, INTERACTION format with Lanelet2 maps."""

from __future__ import annotations

import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

from recognition import recordings as datasets
from recognition.catalogue import pipeline, recordings
from recognition.catalogue.pipeline import ByRules, Summary
from recognition.catalogue.recordings import CatalogueSettings
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


@pytest.mark.study
def test_two_lanes_of_a_junction_do_not_bring_sumo_down(recordings: Path, tmp_path: Path) -> None:
    """Vehicle 44 straddles two lanes that turn, when vehicle 60 comes up behind it: SUMO 1.28 did not survive that."""
    build(recordings / TRACKS / "k733_2020-09-15", tmp_path)
    scenario = tmp_path / "vehicles" / "k733_2020-09-15_000_41.xosc"
    command = [sys.executable, "-m", "runner.xosc_run", "--sut", "none", str(scenario)]
    assert subprocess.run(command, capture_output=True, timeout=120).returncode in (0, 1)
