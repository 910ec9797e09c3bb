"""Failures that are run again."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest

from generation.pipeline import generate
from generation.report.report import headline
from generation.search.outcomes import Repeats
from generation.search.settings import Ask, SearchSettings
from generation.search.variations import asked_of
from generation.space.logical.library import SCENARIOS
from runner.judging.settings import RunSettings
from schemas.common.array_types import BoolArray
from xosc.writing.tags import tags_of

COIN = """
import itertools, random
from runner.systems.base import Control

RUNS = itertools.count()

class Coin:
    def __init__(self, of: str = "seed") -> None:
        self.of = of
    def reset(self, ego, timestep, seed):
        chosen = random.Random(seed).random() if self.of == "seed" else next(RUNS) % 3
        self.brakes = chosen > 0.5 if self.of == "seed" else chosen == 0
    def control(self, observation, dt):
        return Control(-8.0, reason="the coin") if self.brakes else Control()
"""


def runs(again: list[bool], others: list[list[bool]]) -> Repeats:
    def run(seed: int) -> tuple[BoolArray, BoolArray]:
        failed = np.array(again if seed == 7 else others[seed - 8])
        return np.array([True, True, seed != 9]), failed

    return Repeats.of(3, run, 7, len(others))


def test_repetitions_are_counted_by_failure_and_untested_runs_not_at_all() -> None:
    found = runs([True, False, True], [[True, True, True], [True, False, True]])
    assert (found.lost, found.failing.tolist(), found.runs.tolist()) == (1, [2, 1, 1], [2, 2, 1])
    assert str(found) == (
        "1 of 3 failures did not fail again with the same seed: chance decides in the system; "
        "4 of 5 runs with other seeds fail, of the least one 1 of 2"
    )
    assert str(runs([True] * 3, [])) == "3 failures, repeated with the same seed: all fail again"
    assert str(runs([False] * 3, [])).endswith("--repeat N tells how often each fails")
    assert found.gone == 0 and runs([True, False, False], [[False] * 3]).gone == 2
    assert found.take(np.array([1])).lost == 1 and Repeats.of(0, lambda seed: 1 / 0, 0, 3).lost == 0


@pytest.mark.slow
def test_a_system_with_chance_is_found_out(tmp_path: Path) -> None:
    (tmp_path / "coin.py").write_text(COIN)
    asked = asked_of(Ask(density="uniform"), SCENARIOS / "cut_in_highway.xosc")

    def searched(of: str, repeat: int) -> tuple[Repeats, str, list[str]]:
        run = RunSettings(
            sut=f"{tmp_path}/coin.py:Coin:of={of}", sut_in_process=True, world="kinematic",
            timestep=0.1, seed=3,
        )  # fmt: skip
        settings = SearchSettings(
            run, method="draws", budget=60, density="uniform", processes=1, repeat=repeat
        )
        made = generate(asked.scenario, asked.recorded, tmp_path / of, settings)
        repeats = made.cases.repeats
        assert repeats is not None and len(repeats.again) >= 3
        file = tmp_path / of / "cut_in_highway_edge_cases.xosc"
        tags = {tag.type: tag.value for tag in tags_of(file)}
        return repeats, headline("cut-in", "coin", made)[0], list(tags["Fails"])

    fixed, said, tags = searched("seed", 4)
    assert fixed.lost == 0 and "again" not in said, "the seed decides, and it is the same"
    assert set(fixed.failing.tolist()) == {
        sum(random.Random(seed).random() <= 0.5 for seed in range(4, 8))
    }
    assert tags[0].startswith("again with the same seed; ")
    free, said, tags = searched("count", 0)
    assert 0 < free.lost < len(free.again)
    assert f"{free.lost} of {len(free.again)} failures did not fail again" in said
    assert "not again with the same seed" in tags
