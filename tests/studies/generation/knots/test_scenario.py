"""The trajectory-level scenario: a valid file whose actor is where the knots say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import runner
import schemas
from generation.space import SpaceChoice
from generation.space.logical.library import SCENARIOS
from generation.space.space import Space
from schemas.common.array_types import FloatArray
from schemas.common.errors import UsageError
from studies.generation.knots.motion import Setting, knots_of
from studies.generation.knots.scenario import setting_of, write

CUT_IN = SCENARIOS / "cut_in_highway.xosc"
MANEUVER = np.array([30.0, 29.0, 2.0, 31.0, 4.0, 31.0, 3.0])


def apart(result: runner.RunResult) -> tuple[FloatArray, FloatArray]:
    """How far the actor is from the ego along and across the road, every half a second for 8 s."""
    columns = {
        name: result.trajectories[name].to_numpy(zero_copy_only=False)
        for name in ("entity", "x", "y")
    }
    ego, actor = (columns["entity"] == name for name in ("Ego", "CutIn"))
    along, across = (
        columns[axis][actor][:170:10] - columns[axis][ego][:170:10] for axis in ("x", "y")
    )
    return along, across


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Space, Setting]:
    """The scenario, its space, and what its trajectories are told from."""
    seven = Space.of(CUT_IN, SpaceChoice(pinned={"Ego_Speed_mps": "30.0"}))
    setting = setting_of(CUT_IN, seven)
    path = write(tmp_path_factory.mktemp("knots"), seven, setting)
    return path, Space.of(path), setting


def test_the_file_is_valid_and_its_knots_are_its_space(made: tuple[Path, Space, Setting]) -> None:
    path, space, setting = made
    assert [schemas.check(each) for each in path.parent.rglob("*.xosc")] == [[], []]
    assert setting == Setting(30.0, 3.75)
    assert len(space.names) == 11
    assert space.names[0] == "CutIn_SceneTime_s"
    assert dict(space.pinned) == {"Ego_Speed_mps": "30.0"}


def test_the_actor_goes_as_in_the_manoeuvre_and_the_scene_ends_with_it(
    made: tuple[Path, Space, Setting],
) -> None:
    path, space, setting = made
    (knots,) = knots_of(MANEUVER, setting)
    result = runner.run(path, parameters={**space.pinned, **space.values(knots)}, sut="none")
    maneuver = runner.run(
        CUT_IN,
        parameters=Space.of(CUT_IN, SpaceChoice(pinned={"Ego_Speed_mps": "30.0"})).values(MANEUVER),
        sut="none",
    )
    assert result.end_time == pytest.approx(9.0, abs=0.06)
    (ahead, aside), (wanted_ahead, wanted_aside) = (apart(run) for run in (result, maneuver))
    np.testing.assert_allclose(ahead, wanted_ahead, atol=0.8)
    np.testing.assert_allclose(aside, wanted_aside, atol=0.7)


def test_corners_of_the_box_run(made: tuple[Path, Space, Setting]) -> None:
    path, space, _ = made
    for row in (space.low, space.high):
        assert (
            runner.run(path, parameters={**space.pinned, **space.values(row)}).status == "completed"
        )


def test_other_scenarios_have_no_trajectories() -> None:
    other = SCENARIOS / "cut_in_narrow_road.xosc"
    with pytest.raises(UsageError, match="cut_in_highway only"):
        setting_of(other, Space.of(other))
