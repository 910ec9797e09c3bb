"""The estimate of a real search, in its lines and its file."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from generation.pipeline import generate
from generation.search.settings import SearchSettings
from generation.space.logical.library import SCENARIOS
from generation.space.recorded import Recorded
from generation.space.space import Space
from runner.judging.settings import RunSettings

CUT_IN = SCENARIOS / "cut_in_highway.xosc"


@pytest.mark.slow
def test_a_search_writes_how_often_the_system_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, fewer in (
        ("_BLOCK", 2048),
        ("_CONTROLLED", 4096),
    ):  # how narrow intervals are is for test_estimate
        monkeypatch.setattr(f"generation.estimation.estimate.{name}", fewer)
    space = Space.of(CUT_IN)
    rows = space.draw(200, np.random.default_rng(2))
    run = RunSettings(timestep=0.1)
    settings = SearchSettings(run, "draws", 60, density="gaussian", processes=1, estimate=True)
    found = generate(
        CUT_IN, lambda space: Recorded(rows, np.array(["a", "b"] * 100)), tmp_path, settings
    )
    assert found.estimate is not None
    written = json.loads((tmp_path / "cut_in_highway_estimate.json").read_text())
    collision = written["probabilities"]["collision"]
    assert written["sut"] == "cas"
    assert collision["value"] == found.estimate.probabilities["collision"].value
    assert 0.0 < collision["interval"][0] < collision["value"] < collision["interval"][1] < 1.0
    assert (written["runs"], written["known_failures"] > 30) == (60, True)
