"""Pictures of runs, and what they show: written for every kind of run, the same bytes each time."""

from __future__ import annotations

from pathlib import Path

import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import runner
import xosc
from runner.batch.outputs import picture
from runner.batch.outputs.picture import write_picture
from tests.conformance.support import SCENARIOS, track

LIBRARY = Path(xosc.__file__).parent / "library"


@pytest.mark.parametrize(
    "scenario",
    [
        LIBRARY / "simple_cut_in.xosc",
        SCENARIOS / "AddEntityAction.xosc",
        SCENARIOS / "CustomCommandAction.xosc",
    ],
)
def test_a_picture_is_written_and_repeats(tmp_path: Path, scenario: Path) -> None:
    result = runner.run(scenario, world="kinematic", max_time=5.0)
    for name in ("one.png", "two.png"):
        write_picture(result, tmp_path / name)
    first, second = ((tmp_path / name).read_bytes() for name in ("one.png", "two.png"))
    assert first.startswith(b"\x89PNG")
    assert first == second


def test_a_view_of_ways_to_the_north_is_as_wide_as_others(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Names and titles beside a narrow one lay upon each other."""
    result = runner.run(LIBRARY / "simple_cut_in.xosc", world="kinematic", max_time=5.0)
    for each in result.recording.tracks.values():
        each.columns["x"], each.columns["y"] = each.columns["y"], each.columns["x"]
    seen: list[Axes] = []
    monkeypatch.setattr(picture, "_say", lambda axes, *_: seen.append(axes))
    write_picture(result, tmp_path / "north.png")
    box = seen[0].get_window_extent()
    assert box.width > 3.0 * box.height


def test_distances_beyond_the_usual_are_shown(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    result = runner.run(
        LIBRARY / "simple_cut_in.xosc",
        world="kinematic",
        max_time=0.2,
        parameters={"CutIn_Gap_m": 90},
    )
    figures: list[Figure] = []
    monkeypatch.setattr(Figure, "savefig", lambda self, *_, **__: figures.append(self))
    write_picture(result, tmp_path / "far.png")
    assert figures[0].axes[-1].get_ylim()[1] > 90.0


def test_a_pedestrian_that_faces_across_the_lane_crosses_the_road() -> None:
    result = runner.run(
        LIBRARY / "intersection_pedestrian_crossing.xosc", sut=None, world="kinematic"
    )
    walk = track(result, "Pedestrian")
    assert max(walk["x"]) - min(walk["x"]) < 1e-3
    assert walk["y"][0] == pytest.approx(-5.0)
    assert walk["y"][-1] > -1.0
