"""Recorded parameters find their way to the columns of a space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import xosc
from generation.space import SpaceChoice
from generation.space.density.roles import KINDS_OF_SCENARIOS, PAIRED
from generation.space.logical.library import SCENARIOS, maneuver_scenarios
from generation.space.logical.maneuvers import MANEUVERS
from generation.space.logical.pairs import PAIRS
from generation.space.recorded import (
    Recorded,
    RecordedScenario,
    kind_of,
    not_searched,
    of_catalogue,
    of_recordings,
    of_samples,
    shipped_instead,
    stated_instead,
)
from generation.space.space import Space
from recognition.labels.maneuvers.parameters import KINDS, Parameter
from recognition.labels.maneuvers.units import Samples
from schemas.common.errors import UsageError
from tests.recognition.motorway import write_motorway
from xosc.writing.tags import Tag, annotated

CUT_IN = SCENARIOS / "cut_in_highway.xosc"
BRAKING, JERK = SCENARIOS / "braking_leader_highway.xosc", "Lead_Jerk_mps3"


def samples(n: int = 4, jerks: Sequence[float] = ()) -> Samples:
    texts = np.array(["a"] * n)
    numbers, measured = np.arange(7.0 * n).reshape(n, 7), np.array(jerks or [np.nan] * n)
    return Samples(
        numbers,
        texts,
        texts,
        texts,
        texts,
        np.zeros(n),
        np.full(n, 33.0),
        np.zeros((n, 2)),
        measured,
    )


def test_columns_go_by_name_and_the_egos_speed_is_that_of_the_other() -> None:
    space = Space.of(CUT_IN, SpaceChoice(pinned={"CutIn_StartTime_s": "1"}))
    found = of_samples(samples(), space)
    np.testing.assert_array_equal(found.theta[0], [0.0, 1.0, 3.0, 4.0, 5.0, 6.0, 33.0])
    assert len(found.recordings) == 4


@pytest.mark.parametrize(
    ("name", "pinned", "free", "unknown"),
    [
        ("simple_cut_in", {}, [], "CutIn_Speed_mps"),
        ("simple_cut_in", {"CutIn_Speed_mps": "9"}, [], "CutIn_LaneChangeTime_s"),
        ("cut_out_highway", {}, ["Slow_Speed_mps"], "Slow_Speed_mps"),
    ],
)
def test_what_recordings_do_not_tell_is_refused(
    name: str, pinned: dict[str, str], free: list[str], unknown: str
) -> None:
    with pytest.raises(UsageError, match=unknown):
        of_samples(
            samples(), Space.of(SCENARIOS / f"{name}.xosc", SpaceChoice(pinned=pinned, free=free))
        )


def test_units_whose_jerk_is_not_known_are_left_out_where_it_counts() -> None:
    space = Space.of(BRAKING, SpaceChoice(free=[JERK]))
    found = of_samples(samples(4, (2.0, np.nan, 3.0, np.nan)), space)
    np.testing.assert_array_equal(found.values[JERK], [2.0, 3.0])
    np.testing.assert_array_equal(found.theta[:, space.names.index("Lead_Gap_m")], [0.0, 14.0])
    with pytest.raises(UsageError, match=f"no jerk is recorded, of which {JERK} is"):
        of_samples(samples(), space)


def test_a_pinned_jerk_conditions_only_what_is_recorded_with_one() -> None:
    space = Space.of(BRAKING)
    assert JERK in space.pinned
    assert JERK not in of_samples(samples(), space).values
    np.testing.assert_array_equal(
        of_samples(samples(2, (2.0, 3.0)), space).values[JERK], [2.0, 3.0]
    )


def test_where_the_ego_acts_the_other_is_the_leader() -> None:
    space = Space.of(SCENARIOS / "lane_change_left_highway.xosc")
    assert of_samples(samples(), space).theta[0].tolist() == [*range(7), 33.0]


def test_two_actors_have_the_values_of_two_units_about_as_fast() -> None:
    names = ("A_Gap_m", "A_StartSpeed_mps", "B_Gap_m", "B_StartSpeed_mps", "Ego_Speed_mps")
    space = Space(tuple(Parameter(name, 0.0, 200.0) for name in names))
    units = of_recordings(None, "cut_in")
    found = of_samples(units, space).theta
    np.testing.assert_array_equal(found[:, 0], units.theta[:, 0])
    assert (found[:, [0, 1]] != found[:, [2, 3]]).any(axis=1).mean() > 0.99
    assert sorted(found[:, 2]) == sorted(found[:, 0])
    assert np.corrcoef(found[:, 3], found[:, 4])[0, 1] > 0.8
    assert abs(np.corrcoef(found[:, 0], found[:, 2])[0, 1]) < 0.4


def test_the_fastest_egos_meet_two_units_of_fast_egos() -> None:
    speeds = np.linspace(10.0, 40.0, 60)
    texts, rows = np.array(["a"] * 60), np.repeat(speeds[:, None], 7, axis=1)
    units = Samples(
        rows,
        texts,
        texts,
        texts,
        texts,
        np.zeros(60),
        speeds,
        np.zeros((60, 2)),
        np.full(60, np.nan),
    )
    names = "CutIn_StartSpeed_mps", "Second_StartSpeed_mps", "Ego_Speed_mps"
    found = of_samples(units, Space(tuple(Parameter(name, 0.0, 200.0) for name in names))).theta
    np.testing.assert_array_equal(found[:, 0], found[:, 2])
    assert (found[:, 0] != found[:, 1]).all()
    assert np.abs(found[:, 0] - found[:, 1]).max() < 8.0


def test_only_rows_inside_the_box_stay() -> None:
    found = of_samples(samples(), Space.of(CUT_IN)).within(Space.of(CUT_IN))
    assert len(found.theta) == 0


def test_a_catalogue_gives_its_middle_scenario_and_what_all_declare(tmp_path: Path) -> None:
    folder = tmp_path / "cut_in"
    folder.mkdir()
    for number, gap in enumerate((10.0, 30.0, 25.0)):
        document = xosc.load(CUT_IN)
        tagged = annotated(document, [Tag("Recording", f"site/{number}")])
        declaration = tagged.root.find("ParameterDeclarations/ParameterDeclaration")
        assert declaration is not None
        declaration.set("value", str(gap))
        # Whether a value is written out or worked out makes no difference.
        other = tagged.root.find("ParameterDeclarations/ParameterDeclaration[2]")
        assert other is not None
        if number == 1:
            other.set("value", "${10 + 12}")
        xosc.write(tagged, folder / f"{number}.xosc")
    (found,) = of_catalogue(tmp_path)
    assert found.path.name == "2.xosc"
    space = Space.of(found.path, SpaceChoice(pinned={"CutIn_Duration_s": "3"}))
    assert found.on(space).theta[:, 0].tolist() == [10.0, 30.0, 25.0]
    assert found.on(space).theta.shape == (3, 7)
    assert found.on(space).theta[1, 1] == 22.0
    other = Space.of(SCENARIOS / "cut_out_highway.xosc")
    with pytest.raises(UsageError, match="no values of the parameter CutOut_Gap_m"):
        found.on(other)
    assert found.recorded.recordings.tolist() == ["site/0", "site/1", "site/2"]


def test_recorded_units_come_from_our_own_recordings_a_table_or_recordings(tmp_path: Path) -> None:
    own = of_recordings(None, "cut_in")
    assert set(own.kinds) == {"cut_in"}
    own.write(tmp_path / "table.parquet")
    np.testing.assert_array_equal(
        of_recordings(tmp_path / "table.parquet", "cut_in").theta, own.theta
    )
    write_motorway(tmp_path / "recordings")
    assert of_recordings(tmp_path / "recordings", "cut_in").actors.tolist() == ["2", "4"]
    with pytest.raises(UsageError, match="kinds: braking"):
        of_recordings(None, "cutin")


def test_the_kind_goes_by_the_scenarios_name() -> None:
    kinds = {kind_of(SCENARIOS / f"{name}.xosc") for name, _ in maneuver_scenarios()}
    assert kinds == {"cut_in", "cut_out", "lane_change", "braking"}
    with pytest.raises(UsageError, match="--kind"):
        kind_of(SCENARIOS / "r157_cut_in.xosc")
    with pytest.raises(UsageError, match="no such file"):
        kind_of(SCENARIOS / "cut_in_nowhere.xosc")


def test_a_scenario_with_nobody_besides_the_ego_is_not_searched(tmp_path: Path) -> None:
    tagged = annotated(xosc.load(CUT_IN), [Tag("Recording", "site/1")])
    entities = tagged.root.find("Entities")
    assert entities is not None
    for each in list(entities)[1:]:
        entities.remove(each)
    xosc.write(tagged, tmp_path / "alone.xosc")
    assert list(of_catalogue(tmp_path)) == []
    (alone,) = of_catalogue(tmp_path, alone=True)
    assert alone.path.name == "alone.xosc"
    reason = not_searched(tmp_path)
    assert reason.startswith("the ego is alone in 1 scenario and can't collide: --fail-if")


def test_kinds_by_name_are_those_of_the_tables_of_scenarios() -> None:
    assert list(PAIRS) == list(PAIRED)
    assert {*MANEUVERS, *PAIRS} == {*KINDS_OF_SCENARIOS}
    assert {KINDS_OF_SCENARIOS[name] for name in MANEUVERS} <= {*KINDS}
    assert kind_of(Path("xosc/library/cut_in_before_braking_leader_highway.xosc")) == PAIRED[0]


def test_limits_are_drawn_from_where_shipped_units_have_nothing_inside_them() -> None:
    start, end, lasts = "CutIn_StartSpeed_mps", "CutIn_EndSpeed_mps", "CutIn_Duration_s"
    usual = Space.of(CUT_IN, SpaceChoice(pinned={start: "26", end: "26", lasts: "5"}))
    hard = Space.of(CUT_IN, SpaceChoice(pinned={start: "38", end: "12", lasts: "1"}))
    samples = of_recordings(None, "cut_in")
    found = of_samples(samples, usual, simulated=True)
    assert stated_instead(found, usual, "mixture") is None
    found = of_samples(samples, hard, simulated=True)
    instead = stated_instead(found, hard, "mixture")
    assert instead is not None and instead.marginals.keys() == set(hard.names)
    assert instead.within(hard).theta.std(axis=0).min() > 0.0
    own = found._replace(simulated=False)
    assert stated_instead(own, hard, "mixture") is None, "the user names what is likely"


def test_units_of_one_recording_make_no_density_that_could_be_tested() -> None:
    scenario = Path(xosc.__file__).parent / "library" / "cut_in_highway.xosc"
    space = Space.of(scenario)
    theta = np.linspace(space.low, space.high, 40)
    for recordings, enough in (["a"] * 40, False), (["a", "b"] * 20, True):
        recorded = Recorded(theta, np.array(recordings))
        found = shipped_instead(RecordedScenario(scenario, space.names, recorded), space, 30)
        assert (found is None) == enough


def test_pairs_have_a_prior_beside_a_pinned_word() -> None:
    path = SCENARIOS / "squeezed_highway.xosc"
    space = Space.of(path)
    space = replace(space, pinned={**space.pinned, "Model": "car"})
    recorded = of_samples(of_recordings(None, "squeezed"), space)
    assert recorded._admitted(space, recorded.theta[:5]).shape == (5,)
