"""Pictures of runs, and what they show: written for every kind of run, the same bytes each time."""

from __future__ import annotations

from pathlib import Path

import pytest

import runner
import xosc
from runner.outputs.picture import write_picture
from tests.conformance.support import SCENARIOS, track

LIBRARY = Path(xosc.__file__).parent / "library"


@pytest.mark.parametrize(
    "scenario", [LIBRARY / "simple_cut_in.xosc", SCENARIOS / "AddEntityAction.xosc", SCENARIOS / "CustomCommandAction.xosc"]
)
def test_a_picture_is_written_and_repeats(tmp_path: Path, scenario: Path) -> None:
    result = runner.run(scenario, world="kinematic", max_time=5.0)
    for name in ("one.png", "two.png"):
        write_picture(result, tmp_path / name)
    first, second = ((tmp_path / name).read_bytes() for name in ("one.png", "two.png"))
    assert first.startswith(b"\x89PNG")
    assert first == second


def test_a_pedestrian_that_faces_across_the_lane_crosses_the_road() -> None:
    result = runner.run(LIBRARY / "intersection_pedestrian_crossing.xosc", sut=None, world="kinematic")
    walk = track(result, "Pedestrian")
    assert max(walk["x"]) - min(walk["x"]) < 1e-3
    assert walk["y"][0] == pytest.approx(-5.0)
    assert walk["y"][-1] > -1.0
