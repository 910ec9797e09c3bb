"""The box of a scenario's parameters: read from its declarations, and consistent in itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.distance import cdist

import xosc
from generation.space import SpaceChoice
from generation.space.density.marginals import uniform
from generation.space.space import KnownRows, Space
from recognition.labels.maneuvers.parameters import PARAMETERS, Parameter, declared_name
from schemas.common.errors import InvalidFile, ToolchainError, Unsupported, UsageError
from xosc.exports.concrete import copied
from xosc.writing import maneuvers
from xosc.writing.maneuvers.entities import rendered

LIBRARY = Path(__file__).parents[3] / "xosc" / "library"
CUT_IN = LIBRARY / "cut_in_highway.xosc"


def declaring(path: Path, *parameters: object) -> Path:
    """A scenario with some declarations and nothing else."""
    document = copied(xosc.load(LIBRARY / "simple_cut_in.xosc"))
    holder = document.root.find("ParameterDeclarations")
    assert holder is not None
    for child in list(holder):
        holder.remove(child)
    holder.extend(rendered(each) for each in parameters)
    xosc.write(document, path)
    return path


def test_the_box_of_the_cut_in_is_as_wide_as_recordings_and_has_the_speed_of_the_ego() -> None:
    space = Space.of(CUT_IN)
    assert space.names[-1] == "Ego_Speed_mps"
    space = Space.of(CUT_IN, SpaceChoice(pinned={"Ego_Speed_mps": "30.0"}))
    assert space.names == tuple(declared_name("CutIn", role) for role in PARAMETERS)
    assert space.low.tolist() == [0.5, 5, 0, 5, 1, 5, 0]
    assert space.high.tolist() == [150, 42, 10, 42, 8, 42, 10]
    assert [each.meaning for each in space.parameters] == [
        each.meaning for each in PARAMETERS.values()
    ]
    assert [each.unit for each in space.parameters] == [each.unit for each in PARAMETERS.values()]
    assert space.pinned == {"Ego_Speed_mps": "30.0"}


@pytest.mark.parametrize(
    ("low", "high", "reason"),
    [
        (0.2, 0.8, "it is of whole numbers, and its range holds none"),
        (0.5, 1.5, "it is of whole numbers, and its range holds one"),
        (0.0, 1e9, "of which a range may hold 100,000, not 1,000,000,001"),
    ],
)
def test_ranges_of_whole_numbers_hold_several_that_can_be_listed(
    low: float, high: float, reason: str, tmp_path: Path
) -> None:
    path = declaring(tmp_path / "whole.xosc", maneuvers.parameter("N", "int", 1))
    with pytest.raises(UsageError, match=reason):
        Space.of(path, SpaceChoice(marginals={"N": uniform(low, high)}))
    assert Space.of(path, SpaceChoice(marginals={"N": uniform(0.5, 2.5)})).choices == {
        "N": [1.0, 2.0]
    }


def test_where_nobody_has_the_seven_all_but_the_egos_parameters_are_searched() -> None:
    space = Space.of(LIBRARY / "roundabout_entering.xosc")
    assert space.names == ("Circulating_ArrivalGap_s", "Circulating_Speed_mps")
    assert space.pinned["Ego_Speed_mps"] == "11.0"


def test_an_ego_that_acts_is_searched() -> None:
    space = Space.of(LIBRARY / "lane_change_left_highway.xosc")
    assert {"Ego_Gap_m", "Lead_Speed_mps"} <= set(space.names)
    assert not space.pinned


def test_a_jerk_is_searched_where_it_is_asked_for() -> None:
    path = LIBRARY / "braking_leader_highway.xosc"
    assert Space.of(path).pinned["Lead_Jerk_mps3"] == "3.0"
    assert Space.of(path, SpaceChoice(free=["Lead_Jerk_mps3"])).names == (
        *Space.of(path).names[:-1],
        "Lead_Jerk_mps3",
        "Ego_Speed_mps",
    )


def test_pinned_and_free_parameters_change_places() -> None:
    path = LIBRARY / "cut_out_highway.xosc"
    space = Space.of(path, SpaceChoice(pinned={"CutOut_RestTime_s": "2"}, free=["Slow_Speed_mps"]))
    assert "CutOut_RestTime_s" not in space.names
    assert space.names[-1] == "Slow_Speed_mps"
    assert space.pinned == {"CutOut_RestTime_s": "2"}


@pytest.mark.parametrize(
    ("pinned", "free", "reason"),
    [
        ({"CutIn_Gapm": "2"}, [], "CutIn_Gap_m"),
        ({}, ["Speed"], "no parameter"),
        ({"CutIn_Gap_m": "2"}, ["CutIn_Gap_m"], "is pinned"),
    ],
)
def test_names_that_make_no_sense_are_refused(
    pinned: dict[str, str], free: list[str], reason: str
) -> None:
    with pytest.raises(UsageError, match=reason):
        Space.of(CUT_IN, SpaceChoice(pinned=pinned, free=free))


@pytest.mark.parametrize(("value", "error"), [("2000", InvalidFile), ("fast", UsageError)])
def test_pinned_values_that_no_run_accepts_are_refused(
    value: str, error: type[ToolchainError]
) -> None:
    with pytest.raises(error, match="Ego_Speed_mps"):
        Space.of(CUT_IN, SpaceChoice(pinned={"Ego_Speed_mps": value}))


def test_limits_follow_what_is_pinned(tmp_path: Path) -> None:
    top = maneuvers.parameter("Top", "double", 9.0)
    speed = maneuvers.parameter(
        "A_Speed_mps", "double", 1.0, [[("greaterOrEqual", 0.0), ("lessOrEqual", "$Top")]]
    )
    space = Space.of(declaring(tmp_path / "a.xosc", top, speed), SpaceChoice(pinned={"Top": "5"}))
    assert space.high.tolist() == [5.0]
    assert space.pinned == {"Top": "5"}


def test_a_scenario_without_limits_has_no_space(tmp_path: Path) -> None:
    path = declaring(
        tmp_path / "a.xosc", maneuvers.parameter("Speed", "double", 1.0, [[("lessThan", 2.0)]])
    )
    with pytest.raises(UsageError, match="left to search"):
        Space.of(path)
    with pytest.raises(UsageError, match="limit"):
        Space.of(path, SpaceChoice(free=["Speed"]))


def test_limits_may_be_expressions_and_exclusive(tmp_path: Path) -> None:
    top = maneuvers.parameter("Top", "double", 9.0)
    speed = maneuvers.parameter(
        "A_Speed_mps", "double", 1.0, [[("greaterThan", 0.0), ("lessOrEqual", "$Top")]]
    )
    space = Space.of(declaring(tmp_path / "a.xosc", top, speed))
    assert space.parameters == (Parameter("A_Speed_mps", 1e-6, 9.0, "mps"),)
    assert space.pinned == {"Top": "9.0"}


@pytest.mark.parametrize(
    ("groups", "error"),
    [
        (
            [[("greaterThan", 0.0), ("lessThan", 1.0)], [("greaterThan", 2.0), ("lessThan", 3.0)]],
            Unsupported,
        ),
        ([[("greaterThan", 0.0), ("lessThan", 1.0), ("notEqualTo", 0.5)]], Unsupported),
        ([[("greaterThan", 3.0), ("lessThan", 1.0)]], InvalidFile),
        ([[("greaterThan", 0.0), ("lessThan", "INF")]], Unsupported),
    ],
)
def test_what_is_no_interval_is_refused(
    tmp_path: Path, groups: list[list[tuple[str, float | str]]], error: type[ToolchainError]
) -> None:
    with pytest.raises(error, match="A_Speed_mps"):
        Space.of(
            declaring(
                tmp_path / "a.xosc", maneuvers.parameter("A_Speed_mps", "double", 0.5, groups)
            )
        )


def test_points_go_to_the_unit_cube_and_back() -> None:
    space = Space.of(CUT_IN)
    theta = space.draw(100, np.random.default_rng(0))
    unit = space.unit(theta)
    assert (unit >= 0).all()
    assert (unit <= 1).all()
    np.testing.assert_allclose(space.scaled(unit), theta)
    np.testing.assert_array_equal(space.clip(theta + 1000.0)[0], space.high)


def test_drawn_points_depend_on_the_seed_alone() -> None:
    space = Space.of(CUT_IN)
    again = [space.draw(5, np.random.default_rng(seed)) for seed in (1, 1, 2)]
    np.testing.assert_array_equal(again[0], again[1])
    assert (again[0] != again[2]).any()


def test_values_are_what_the_scenario_accepts() -> None:
    space = Space.of(CUT_IN)
    rows = (space.low, space.high, *space.draw(20, np.random.default_rng(0)))
    for row in rows:
        values = space.values(row)
        assert tuple(values) == space.names
        np.testing.assert_allclose([float(each) for each in values.values()], row, atol=5e-7)
        xosc.resolve(xosc.load(CUT_IN), values)
    with pytest.raises(UsageError, match="6 values"):
        space.values(space.low[:6])


def test_known_rows_say_how_far_others_are_however_they_came() -> None:
    generator, known = np.random.default_rng(0), KnownRows()
    rows, others = generator.random((60, 3)), generator.random((20, 3))
    assert np.isinf(known.distances(others)).all()
    for part in np.split(rows, [1, 2, 5, 20, 23, 24]):
        known.add(part)
    wanted = cdist(others, rows).min(axis=1) / np.sqrt(3)
    np.testing.assert_allclose(known.distances(others), wanted)
    limited = known.distances(others, 0.1)
    np.testing.assert_allclose(limited, np.where(wanted < 0.1, wanted, np.inf))


def test_values_of_another_version_are_no_point() -> None:
    space = Space((Parameter("Gap", 1.0, 9.0), Parameter("Speed", 1.0, 9.0)))
    np.testing.assert_array_equal(space.point({"Gap": "2", "Speed": "3", "More": "x"}), [2.0, 3.0])
    assert space.point({"Gap": "2"}) is None
    assert space.point({"Gap": "2", "Speed": "fast"}) is None
