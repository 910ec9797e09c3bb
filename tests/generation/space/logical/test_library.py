"""The library's files are what the tables make, and run for every point of their boxes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import runner
from generation.space.logical.library import ROADS, SCENARIOS, maneuver_scenarios, write
from generation.space.space import Space
from recognition.labels.maneuvers.parameters import PARAMETERS

NAMES = [name for name, _ in maneuver_scenarios()]


@pytest.mark.slow
def test_the_checked_in_files_are_up_to_date(tmp_path: Path) -> None:
    folders = {"xosc": SCENARIOS, "xodr": ROADS}
    made = {name: tmp_path / name / "library" for name in folders}
    for folder in made.values():
        folder.mkdir(parents=True)
    for path in write(made["xosc"], made["xodr"]):
        part = path.relative_to(tmp_path)
        shipped = folders[part.parts[0]] / part.relative_to(part.parts[0], "library")
        assert shipped.read_bytes() == path.read_bytes(), (
            f"run python -m studies.library for {path.name}"
        )


@pytest.mark.parametrize("name", NAMES)
def test_a_logical_scenario_has_the_seven_and_runs_in_the_corners_of_its_box(name: str) -> None:
    path = SCENARIOS / f"{name}.xosc"
    space = Space.of(path)
    assert [each.partition("_")[2] for each in space.names] == [
        *(each.name for each in PARAMETERS.values()),
        "Speed_mps",
    ]
    corners = [
        [0.0] * 8,
        [1.0] * 8,
        [0.0, *[1.0] * 6, 0.5],
        [0.0, *[1.0] * 6, 0.0],
        [1.0, 0.0, 1.0, 0.5, 1.0, 0.0, 1.0, 1.0],
    ]
    for theta in space.scaled(np.vstack([corners, np.random.default_rng(0).random((2, 8))])):
        result = runner.run(
            path, parameters=space.values(theta), sut=None, world="kinematic", timestep=0.1
        )
        assert result.status == "completed"
        assert all("system_under_test" in remark for remark in result.remarks), (
            "nothing but who drives the ego"
        )
