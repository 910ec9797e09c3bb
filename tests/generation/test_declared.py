"""What options and variation files ask to search."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

import xosc
from generation.declared import asked_of, freed, mapped
from generation.logical.library import SCENARIOS
from generation.search.space import Space
from generation.settings import Ask
from schemas.common.errors import UsageError
from xosc.distributions import (
    Deterministic,
    DeterministicMultiParameterDistribution,
    DeterministicSingleParameterDistribution,
    DistributionRange,
    DistributionSet,
    ParameterValueDistribution,
    Range,
)
from xosc.files import FileHeader

SIMPLE = SCENARIOS / "simple_cut_in.xosc"


def variation(path: Path, *distributions: object) -> Path:
    written = ParameterValueDistribution(str(SIMPLE), Deterministic(distributions))  # type: ignore[arg-type]
    xosc.write_distribution(written, path, FileHeader("a variation", "tests", datetime(2026, 1, 1)))
    return path


def test_a_variation_file_says_what_is_searched_and_what_is_pinned(tmp_path: Path) -> None:
    path = variation(
        tmp_path / "variation.xosc",
        DeterministicSingleParameterDistribution("CutIn_Gap_m", DistributionRange(Range(6.0, 30.0), 2.0)),
        DeterministicSingleParameterDistribution("CutIn_Speed_mps", DistributionSet(("22",))),
    )
    asked = asked_of(Ask(), path)
    assert asked.scenario == SIMPLE
    space = Space.of(asked.scenario, asked.pinned, asked.free, ranges=asked.marginals, default=asked.default)
    assert (space.names, space.low.tolist(), space.high.tolist()) == (("CutIn_Gap_m",), [6.0], [30.0])
    assert space.pinned["CutIn_Speed_mps"] == "22"
    theta = asked.recorded(space).prior(space, "kde").sample(20, np.random.default_rng(0))
    assert ((theta >= 6.0) & (theta <= 30.0)).all()
    pinned = asked_of(Ask(pinned={"CutIn_Gap_m": "9"}, free=["CutIn_Speed_mps=15..30"]), path)
    assert (dict(pinned.pinned), list(pinned.marginals)) == ({"CutIn_Gap_m": "9"}, ["CutIn_Speed_mps"])


def test_sets_of_values_have_no_density(tmp_path: Path) -> None:
    sets = DeterministicMultiParameterDistribution(({"CutIn_Gap_m": "9"}, {"CutIn_Gap_m": "8"}))
    with pytest.raises(UsageError, match="belong together"):
        asked_of(Ask(), variation(tmp_path / "variation.xosc", sets))


def test_parameters_are_mapped_to_roles_with_a_factor() -> None:
    maps = ["CutIn_Gap_m=gap", "CutIn_LaneChangeTime_s=duration", "Ego_Speed_mps=ego_speed*1.0"]
    asked = asked_of(Ask(kind="cut_in", maps=maps), SIMPLE)
    space = Space.of(asked.scenario, asked.pinned, asked.free, ranges=asked.marginals, default=asked.default)
    assert set(space.names) == {"CutIn_Gap_m", "CutIn_LaneChangeTime_s", "Ego_Speed_mps"}
    assert len(asked.recorded(space).theta) > 1000
    assert mapped(["Ego_speed_kph=ego_speed*3.6"])["Ego_speed_kph"].factor == 3.6


def test_where_all_ranges_have_roles_recordings_say_everything_within_them() -> None:
    ranges = {"CutIn_Gap_m": (10.0, 30.0), "Ego_Speed_mps": (15.0, 25.0)}
    free = [f"{name}={low}..{high}" for name, (low, high) in ranges.items()]
    asked = asked_of(Ask(kind="cut_in", maps=["CutIn_Gap_m=gap", "Ego_Speed_mps=ego_speed"], free=free), SIMPLE)
    space = Space.of(asked.scenario, asked.pinned, asked.free, ranges=asked.marginals, default=asked.default)
    prior = asked.recorded(space).prior(space, "mixture")
    drawn = prior.sample(200, np.random.default_rng(0))
    assert prior.inside(drawn).all()
    assert not asked.recorded(space).marginals


def test_a_scenario_of_which_nothing_is_known_is_uniform_or_refused() -> None:
    with pytest.raises(UsageError, match="--kind"):
        asked_of(Ask(), SIMPLE)
    asked = asked_of(Ask(density="uniform"), SIMPLE)
    space = Space.of(asked.scenario, asked.pinned, asked.free, ranges=asked.marginals, default=asked.default)
    assert len(space.names) == 4
    assert asked.recorded(space).prior(space, "uniform").names == space.names


@pytest.mark.parametrize("text", ["", "=1..2", "A=1", "A=2..1", "A=..", "A=x..2", "A=1..inf"])
def test_ranges_that_are_none_are_refused(text: str) -> None:
    with pytest.raises(UsageError, match=r"NAME=LOW\.\.HIGH"):
        freed([text])


@pytest.mark.parametrize(
    ("texts", "reason"),
    [
        (["A"], "NAME=ROLE"),
        (["A=gap*x"], "NAME=ROLE"),
        (["A=gap*-1"], "NAME=ROLE"),
        (["A=speed"], "no role 'speed'; roles: gap"),
        (["A=gap", "B=gap"], "another parameter"),
    ],
)
def test_roles_that_are_none_are_refused(texts: list[str], reason: str) -> None:
    with pytest.raises(UsageError, match=reason.replace("(", r"\(")):
        mapped(texts)


def test_parameters_without_limits_or_numbers_are_refused_by_name() -> None:
    corpus = SCENARIOS / "unsignalised_left_turn_t_junction.xosc"
    with pytest.raises(UsageError, match="Oncoming_Model can't be searched: it is of the type string"):
        Space.of(corpus, ranges=freed(["Oncoming_Model=1..2"])[1])
    with pytest.raises(UsageError, match=r"--free Ego_SlowingStart_s=LOW\.\.HIGH"):
        Space.of(corpus, free=["Ego_SlowingStart_s"])
