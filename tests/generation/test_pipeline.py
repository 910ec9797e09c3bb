"""A search from scenario to files, interrupted and gone on with."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from generation.logical.library import SCENARIOS
from generation.pipeline import LEAST, Generated, generate
from generation.recorded import Recorded
from generation.search.space import Space
from generation.settings import SearchSettings
from runner.settings import RunSettings
from schemas.common.errors import UsageError

CUT_IN = SCENARIOS / "cut_in_highway.xosc"
QUICK = SearchSettings(method="random", budget=60, density="gaussian", processes=1, run=RunSettings(timestep=0.1))


def drawn(n: int) -> Recorded:
    """Parameters of recordings that never were."""
    rng = np.random.default_rng(2)
    return Recorded(Space.of(CUT_IN).draw(n, rng), np.array([f"r{each % 5}" for each in range(n)]))


def test_an_interrupted_search_goes_on_and_ends_as_if_it_had_not_been(tmp_path: Path) -> None:
    settings, batches = replace(QUICK, budget=90), list[int]()

    def interrupt(runs: int) -> None:
        batches.append(runs)
        if len(batches) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        generate(CUT_IN, lambda space: drawn(200), tmp_path / "a", settings, interrupt)
    assert batches == [30, 50], "draws, then the first runs of the method"
    (kept,) = (tmp_path / "a").glob("*_runs_*.jsonl")
    before = kept.read_text()
    assert before.count("\n") == 50
    resumed = generate(CUT_IN, lambda space: drawn(200), tmp_path / "a", settings)
    assert kept.read_text().startswith(before)
    whole = generate(CUT_IN, lambda space: drawn(200), tmp_path / "b", settings)
    np.testing.assert_array_equal(resumed.history.theta, whole.history.theta)
    for one, other in zip(resumed.files, whole.files, strict=True):
        assert one.read_bytes() == other.read_bytes()


def test_too_few_recorded_manoeuvres_are_no_prior(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=f"at least {LEAST}"):
        generate(CUT_IN, lambda space: drawn(LEAST - 1), tmp_path, QUICK)


def test_a_search_is_extended_in_its_folder(tmp_path: Path) -> None:
    run = RunSettings(timestep=0.1, world="kinematic")

    def search(seed: int) -> Generated:
        return generate(CUT_IN, lambda space: drawn(40), tmp_path, replace(QUICK, budget=6, seed=seed, run=run))

    assert search(0).reused == 0
    assert search(1).reused == 0
    (runs,) = tmp_path.glob("*_runs_*.jsonl")
    assert runs.read_text().count("\n") == 6
    assert search(0).reused == 3, "half of six runs are draws"
    assert runs.read_text().count("\n") == 6
