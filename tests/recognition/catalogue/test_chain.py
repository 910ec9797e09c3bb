"""From recordings to searches: each scenario and manoeuvre of a catalogue is
valid, runs, and can be searched.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.commands import Command
from tests.recognition import motorway

pytestmark = pytest.mark.slow


def test_catalogues_are_checked_run_and_searched_without_a_dead_end(
    command: Command, tmp_path: Path
) -> None:
    motorway.write_motorway(tmp_path / "recordings")
    out = tmp_path / "catalogue"
    assert command("xosc-recognize", tmp_path / "recordings", "--out", out).code == 0
    rows = json.loads((out / "index.json").read_text())["scenarios"]
    files = [out / row[name] for row in rows for name in ("file", "maneuver") if row[name]]
    done = command("xosc-check", *files)
    assert done.code == 0, done.out
    done = command("xosc-run", "--sut", "none", "--world", "kinematic", *files)
    assert done.code <= 1, done.err
    searched = {row["class"]: row["maneuver"] for row in rows if row["maneuver"]}
    assert len(searched) >= 4
    for name, maneuver in searched.items():
        target = tmp_path / name.replace(" ", "_")
        done = command("xosc-generate", out / maneuver, "--budget", "4", "--out", target)
        assert done.code <= 1, (name, done.err)


def test_classes_with_few_recorded_units_are_searched_by_the_shipped_ones(
    command: Command, tmp_path: Path
) -> None:
    motorway.write_motorway(tmp_path / "recordings")
    out = tmp_path / "catalogue"
    assert command("xosc-recognize", tmp_path / "recordings", "--out", out).code == 0
    done = command(
        "xosc-generate", out / "highway_cut_in", "--budget", "4", "--out", tmp_path / "found"
    )
    assert done.code <= 1, done.err
    assert "2 of its class are recorded, 30 of two recordings make a density" in done.err
