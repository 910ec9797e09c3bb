"""What options and variation files ask to search."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

import xosc
from generation.report.counterexamples import measures
from generation.search.settings import Ask
from generation.search.variations import asked_of, freed, mapped, with_literals
from generation.space import SpaceChoice
from generation.space.logical.library import SCENARIOS
from generation.space.space import Space
from schemas import check
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
from xosc.writing.files import FileHeader

SIMPLE = SCENARIOS / "simple_cut_in.xosc"


def variation(path: Path, *distributions: object, scenario: Path = SIMPLE) -> Path:
    written = ParameterValueDistribution(str(scenario), Deterministic(distributions))  # type: ignore[arg-type]
    xosc.write_distribution(written, path, FileHeader("a variation", "tests", datetime(2026, 1, 1)))
    return path


def asked_space(path: Path) -> Space:
    asked = asked_of(Ask(), path)
    return Space.of(asked.scenario, asked.choice)


def test_a_variation_file_says_what_is_searched_and_what_is_pinned(tmp_path: Path) -> None:
    path = variation(
        tmp_path / "variation.xosc",
        DeterministicSingleParameterDistribution(
            "CutIn_Gap_m", DistributionRange(Range(6.0, 30.0), 2.0)
        ),
        DeterministicSingleParameterDistribution("CutIn_Speed_mps", DistributionSet(("22",))),
    )
    asked = asked_of(Ask(), path)
    assert asked.scenario == SIMPLE
    space = Space.of(asked.scenario, asked.choice)
    assert (space.names, space.low.tolist(), space.high.tolist()) == (
        ("CutIn_Gap_m",),
        [6.0],
        [30.0],
    )
    assert space.pinned["CutIn_Speed_mps"] == "22"
    theta = asked.recorded(space).prior(space, "kde").sample(20, np.random.default_rng(0))
    assert ((theta >= 6.0) & (theta <= 30.0)).all()
    ask = Ask(pinned={"CutIn_Gap_m": "9"}, free=["CutIn_Speed_mps=15..30"])
    choice = asked_of(ask, path).choice
    assert (dict(choice.pinned), list(choice.marginals)) == (
        {"CutIn_Gap_m": "9"},
        ["CutIn_Speed_mps"],
    )


def test_sets_of_values_are_searched_as_sets(tmp_path: Path) -> None:
    """The first number that differs in all sets is searched, what belongs to its values follows."""
    rows = [
        {"CutIn_LaneChangeTime_s": "3", "CutIn_Gap_m": gap, "CutIn_Speed_mps": speed}
        for gap, speed in (("9.5", "20"), ("8", "25"))
    ]
    path = variation(
        tmp_path / "variation.xosc", DeterministicMultiParameterDistribution(tuple(rows))
    )
    asked, space = asked_of(Ask(), path), asked_space(path)
    assert (space.names, space.low.tolist(), space.high.tolist()) == (
        ("CutIn_Gap_m",),
        [8.0],
        [9.5],
    )
    assert not set(rows[0]) & set(space.pinned)
    assert [space.values([gap]) for gap in (9.1, 8.2)] == rows
    drawn = asked.recorded(space).prior(space, "mixture").sample(50, np.random.default_rng(0))
    assert set(drawn[:, 0].tolist()) == {8.0, 9.5}
    with pytest.raises(
        UsageError,
        match="CutIn_Speed_mps belongs to the values of CutIn_Gap_m, and is "
        "searched or pinned itself",
    ):
        Space.of(
            asked.scenario,
            SpaceChoice(
                pinned={"CutIn_Speed_mps": "20"}, marginals=asked.choice.marginals, default=False
            ),
        )


def test_sets_that_no_number_tells_apart_are_categories(tmp_path: Path) -> None:
    rows = [
        {"CutIn_Gap_m": gap, "CutIn_Speed_mps": speed}
        for gap, speed in (("9", "20"), ("9", "25"), ("8", "25"), ("9", "20"))
    ]
    path = variation(tmp_path / "sets.xosc", DeterministicMultiParameterDistribution(tuple(rows)))
    space = asked_space(path)
    assert (space.names, space.low.tolist(), space.high.tolist()) == (
        ("CutIn_Gap_m",),
        [0.0],
        [2.0],
    )
    assert [space.values([code]) for code in (0.2, 0.9, 2.0)] == rows[:3]
    points = [space.point(row) for row in rows[:3]]
    assert [float(point[0]) for point in points if point is not None] == [0.0, 1.0, 2.0]
    assert space.point({"CutIn_Gap_m": "8", "CutIn_Speed_mps": "20"}) is None
    shown = measures(space, {}, np.array([[0.0], [1.0], [2.0]]))
    assert {each.name: each.values.tolist() for each in shown} == {
        "CutIn_Gap_m": [9.0, 9.0, 8.0],
        "CutIn_Speed_mps": [20.0, 25.0, 25.0],
    }


def test_words_are_searched_as_categories_and_one_set_is_pinned(tmp_path: Path) -> None:
    scenario = SCENARIOS / "unsignalised_left_turn_t_junction.xosc"
    path = variation(
        tmp_path / "words.xosc",
        DeterministicSingleParameterDistribution("Oncoming_Model", DistributionSet(("car", "bus"))),
        DeterministicMultiParameterDistribution(({"Oncoming_Speed_mps": "9"},)),
        scenario=scenario,
    )
    space = asked_space(path)
    assert space.names == ("Oncoming_Model",) and space.pinned["Oncoming_Speed_mps"] == "9"
    assert [space.values([code]) for code in (0.1, 0.7)] == [
        {"Oncoming_Model": "car"},
        {"Oncoming_Model": "bus"},
    ]
    (shown,) = measures(space, {}, np.array([[0.0], [1.0]]))
    assert (shown.name, shown.values.tolist()) == ("Oncoming_Model is car", [1.0, 0.0])


def test_a_file_of_one_set_leaves_nothing_to_search(tmp_path: Path) -> None:
    sets = DeterministicMultiParameterDistribution(({"CutIn_Gap_m": "9"}, {"CutIn_Gap_m": "9"}))
    with pytest.raises(UsageError, match=r"one value, which leaves nothing .*simple_cut_in"):
        asked_of(Ask(), variation(tmp_path / "variation.xosc", sets))
    other = DeterministicMultiParameterDistribution(
        ({"CutIn_Gap_m": "9"}, {"CutIn_Speed_mps": "9"})
    )
    with pytest.raises(UsageError, match="no parameter is in all of its sets of values"):
        asked_of(Ask(), variation(tmp_path / "other.xosc", other))


def test_a_literal_becomes_a_parameter_of_a_copy_that_stands_by_itself(tmp_path: Path) -> None:
    line = next(
        number
        for number, text in enumerate(SIMPLE.read_text().splitlines(), 1)
        if 'dynamicsShape="step"' in text
    )
    free = [f"{line}@value=0..2", "CutIn_Gap_m=6..30"]
    ask, copy = with_literals(Ask(free=free), SIMPLE, tmp_path / "source")
    name = f"SpeedActionDynamics_value_{line}"
    assert list(ask.free) == ["CutIn_Gap_m=6..30", f"{name}=0..2"]
    asked = asked_of(ask, copy)
    space = Space.of(asked.scenario, asked.choice)
    assert set(space.names) == {name, "CutIn_Gap_m"}
    assert f'value="${name}"' in copy.read_text() and name not in SIMPLE.read_text()
    assert check(copy) == []
    assert with_literals(Ask(free=["CutIn_Gap_m=6..30"]), SIMPLE, tmp_path / "none")[1] == SIMPLE


@pytest.mark.parametrize(
    ("literal", "reason"),
    [
        ("1@value=0..2", "no elements of this line have the attribute value"),
        ("2@author=0..2", "author is 'xosc-toolchain', not a number"),
    ],
)
def test_what_is_no_literal_number_is_refused_by_line(
    literal: str, reason: str, tmp_path: Path
) -> None:
    header = next(
        number
        for number, text in enumerate(SIMPLE.read_text().splitlines(), 1)
        if "<FileHeader" in text
    )
    with pytest.raises(UsageError, match=reason):
        with_literals(Ask(free=[literal.replace("2@author", f"{header}@author")]), SIMPLE, tmp_path)


def test_parameters_are_mapped_to_roles_with_a_factor() -> None:
    maps = ["CutIn_Gap_m=gap", "CutIn_LaneChangeTime_s=duration", "Ego_Speed_mps=ego_speed*1.0"]
    asked = asked_of(Ask(kind="cut_in", maps=maps), SIMPLE)
    space = Space.of(asked.scenario, asked.choice)
    assert set(space.names) == {"CutIn_Gap_m", "CutIn_LaneChangeTime_s", "Ego_Speed_mps"}
    assert len(asked.recorded(space).theta) > 1000
    assert mapped(["Ego_speed_kph=ego_speed*3.6"])["Ego_speed_kph"].factor == 3.6


def test_where_all_ranges_have_roles_recordings_say_everything_within_them() -> None:
    ranges = {"CutIn_Gap_m": (10.0, 30.0), "Ego_Speed_mps": (15.0, 25.0)}
    free = [f"{name}={low}..{high}" for name, (low, high) in ranges.items()]
    asked = asked_of(
        Ask(kind="cut_in", maps=["CutIn_Gap_m=gap", "Ego_Speed_mps=ego_speed"], free=free), SIMPLE
    )
    space = Space.of(asked.scenario, asked.choice)
    prior = asked.recorded(space).prior(space, "mixture")
    drawn = prior.sample(200, np.random.default_rng(0))
    assert prior.inside(drawn).all()
    assert not asked.recorded(space).marginals


def test_a_scenario_of_which_nothing_is_known_is_uniform_or_refused() -> None:
    with pytest.raises(UsageError, match="--kind"):
        asked_of(Ask(), SIMPLE)
    asked = asked_of(Ask(density="uniform"), SIMPLE)
    space = Space.of(asked.scenario, asked.choice)
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
        (["A=gap*inf"], "NAME=ROLE"),
        (["A=speed"], "no role 'speed'; roles: gap"),
        (["A=gap", "B=gap"], "another parameter"),
    ],
)
def test_roles_that_are_none_are_refused(texts: list[str], reason: str) -> None:
    with pytest.raises(UsageError, match=reason.replace("(", r"\(")):
        mapped(texts)


def test_parameters_without_limits_or_numbers_are_refused_by_name() -> None:
    corpus = SCENARIOS / "unsignalised_left_turn_t_junction.xosc"
    with pytest.raises(
        UsageError, match="Oncoming_Model can't be searched: it is of the type string"
    ):
        Space.of(corpus, SpaceChoice(marginals=freed(["Oncoming_Model=1..2"])[1]))
    with pytest.raises(UsageError, match=r"--free Ego_SlowingStart_s=LOW\.\.HIGH"):
        Space.of(corpus, SpaceChoice(free=["Ego_SlowingStart_s"]))


def test_parameters_of_the_system_are_declared_in_a_copy(tmp_path: Path) -> None:
    free = ["sut_delay=0.1..0.5", "CutIn_Gap_m=6..30"]
    ask, copy = with_literals(Ask(free=free), SIMPLE, tmp_path / "source")
    assert sorted(ask.free) == sorted(free) and check(copy) == []
    asked = asked_of(ask, copy)
    space = Space.of(asked.scenario, asked.choice)
    assert set(space.names) == {"sut_delay", "CutIn_Gap_m"}
    # Declared once: the copy has it already.
    assert with_literals(ask, copy, tmp_path / "again") == (ask, copy)


def test_a_reference_in_the_place_of_a_literal_says_what_to_free(tmp_path: Path) -> None:
    line = next(
        number
        for number, text in enumerate(SIMPLE.read_text().splitlines(), 1)
        if 'AbsoluteTargetSpeed value="$Ego_Speed_mps"' in text
    )
    with pytest.raises(UsageError, match=r"--free Ego_Speed_mps=LOW\.\.HIGH searches it"):
        with_literals(Ask(free=[f"{line}@value=0..2"]), SIMPLE, tmp_path)
