"""The manoeuvre nearest to a way, and back."""

from __future__ import annotations

import numpy as np
import pytest

import runner
from generation.space.logical.library import SCENARIOS
from generation.space.space import Space
from studies.generation.adversary.course import START, Scene
from studies.generation.adversary.environment import Episodes
from studies.generation.described import as_maneuvers

CUT_IN = SCENARIOS / "cut_in_highway.xosc"
VALUES = {
    "CutIn_Gap_m": 20.0,
    "CutIn_StartSpeed_mps": 24.0,
    "CutIn_StartTime_s": 1.5,
    "CutIn_EndSpeed_mps": 21.0,
    "CutIn_Duration_s": 3.5,
    "CutIn_FinalSpeed_mps": 20.0,
    "CutIn_RestTime_s": 3.0,
    "Ego_Speed_mps": 20.0,
}


def test_the_way_of_a_manoeuvre_gives_its_parameters() -> None:
    scene, space = Scene.of(CUT_IN), Space.of(CUT_IN)
    result = runner.run(
        CUT_IN,
        sut="none",
        world="kinematic",
        parameters={name: str(value) for name, value in VALUES.items()},
    )
    assert result.recording is not None
    ego, actor = (track.columns for track in result.recording.locate().tracks.values())
    way = np.stack([actor["s"] - ego["s"][0] + START, actor["t"]], axis=1)
    none = np.zeros(1, bool)
    starts = np.array([[0.0, 24.0, 20.0]])
    episodes = Episodes(starts, way[None], np.array([-1]), none, none, np.zeros(1), np.zeros(1))
    found = dict(zip(space.names, as_maneuvers(scene, space, episodes, 0.05)[0], strict=True))
    for name, value in VALUES.items():
        assert found[name] == pytest.approx(value, abs=0.5), name
