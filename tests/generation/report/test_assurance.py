"""Cells, sensitivity and sentences of a search, on searches whose answers are known."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from generation.pipeline import Generated, _write, estimate_file
from generation.report.assurance import Assurance, Coverage, Sensitivity, coverage, sensitivity
from generation.search.gate import Gate, Share
from generation.search.outcomes import Cases, Episodes, FullBraking, Outcomes
from generation.search.problem import History
from generation.space.density.marginals import Choices, DeclaredPrior, uniform
from generation.space.density.models.mixtures import Gaussian
from generation.space.space import Space
from recognition.labels.maneuvers.parameters import Parameter
from schemas.common.array_types import BoolArray, FloatArray
from tests.generation.report.searches import CUT_IN, EASY, SPACE, recorded, searched, settings

GAP, EGO = SPACE.names.index("CutIn_Gap_m"), SPACE.names.index("Ego_Speed_mps")
REAL = recorded()
PRIOR = REAL.prior(SPACE, "gaussian")


def found(theta: FloatArray, failing: BoolArray) -> Generated:
    """A search that ran these points."""
    outcomes = Outcomes.of(len(theta), collision=failing)
    history = History(theta, outcomes, np.zeros(len(theta)))
    none = np.zeros(0, np.int64)
    cases = Cases(theta[none], outcomes.take(none), np.empty(0), np.empty(0), {})
    gate = Gate(None, Share(0, 30))
    return Generated(SPACE, REAL, PRIOR, history, Episodes(*history), cases, [], gate)


@pytest.fixture(scope="module")
def drawn() -> FloatArray:
    return PRIOR.sample(600, np.random.default_rng(1))


def test_failures_depend_on_the_parameter_that_makes_them(drawn: FloatArray) -> None:
    decides = sensitivity(found(drawn, drawn[:, GAP] < np.median(drawn[:, GAP])))
    assert isinstance(decides, Sensitivity)
    (name, (value, low, high)), (_, second), *_ = decides.total.items()
    assert name == "CutIn_Gap_m"
    assert low <= value <= high and low > 0.7
    assert second[0] < 0.2 and decides.first[name][0] > 0.7
    assert decides.explained > 0.7


def test_two_parameters_that_act_together_have_more_with_each_other(drawn: FloatArray) -> None:
    gap, speed = (drawn[:, column] > np.median(drawn[:, column]) for column in (GAP, EGO))
    decides = sensitivity(found(drawn, gap ^ speed))
    assert isinstance(decides, Sensitivity)
    assert set(list(decides.total)[:2]) == {"CutIn_Gap_m", "Ego_Speed_mps"}
    for name in ("CutIn_Gap_m", "Ego_Speed_mps"):
        assert decides.total[name][0] > decides.first[name][0] + 0.3


def test_an_estimate_names_a_system_that_is_an_object(tmp_path: Path, drawn: FloatArray) -> None:
    made = searched("cas", np.array([EASY]))
    chosen = settings("cas")
    chosen = replace(chosen, run=replace(chosen.run, sut=FullBraking()))
    none = made.cases.take(np.zeros(len(made.cases), bool))
    density = Gaussian().fit(drawn)
    assert _write(CUT_IN, SPACE, tmp_path, chosen, none, density, made.estimate, 0) == []
    kept = json.loads((tmp_path / estimate_file(CUT_IN)).read_text(encoding="utf-8"))
    assert "FullBraking" in kept["sut"]


def test_chance_is_explained_by_nothing(drawn: FloatArray) -> None:
    decides = sensitivity(found(drawn, np.random.default_rng(2).random(len(drawn)) < 0.5))
    assert isinstance(decides, Sensitivity) and decides.explained < 0.1


def test_few_failures_make_no_indices(drawn: FloatArray) -> None:
    reason = sensitivity(found(drawn, np.arange(len(drawn)) < 19))
    assert reason == (
        "19 failures and 581 other runs: 20 of each make a model of what failures depend on"
    )


def test_parameters_that_hardly_vary_decide_nothing(drawn: FloatArray) -> None:
    rare = Choices((0.0, 1.0), (0.999, 0.001))
    prior = DeclaredPrior({"a": rare, "b": rare}, None)
    theta = np.random.default_rng(3).integers(0, 2, (200, 2)).astype(float)
    space = Space((Parameter("a", 0.0, 1.0), Parameter("b", 0.0, 1.0)))
    searched = replace(found(drawn[:0], np.zeros(0, bool)), space=space, prior=prior)
    outcomes = Outcomes.of(200, collision=theta[:, 0] > 0.5)
    searched = replace(searched, episodes=Episodes(theta, outcomes, np.zeros(200)))
    assert sensitivity(searched) == "one parameter alone varies in the density's draws"


def test_a_single_parameter_has_no_cells_of_two() -> None:
    one = DeclaredPrior({"a": uniform(0.0, 1.0)}, None)
    theta = one.sample(50, np.random.default_rng(3))
    searched = found(PRIOR.sample(1, np.random.default_rng(0)), np.zeros(1, bool))
    episodes = Episodes(theta, Outcomes.of(50), np.zeros(50))
    space = Space((Parameter("a", 0.0, 1.0),))
    alone = coverage(replace(searched, space=space, prior=one, episodes=episodes))
    assert isinstance(alone, Coverage)
    assert str(alone) == "one parameter alone is searched: there are no cells of two"


def test_cells_without_a_run_are_named(drawn: FloatArray) -> None:
    everywhere = PRIOR.sample(20_000, np.random.default_rng(3))
    whole = coverage(found(everywhere, np.zeros(len(everywhere), bool)))
    assert whole.tested > 0.99 * whole.cells and whole.failing == 0
    assert whole.least > 0.999
    near = everywhere[everywhere[:, GAP] < np.median(everywhere[:, GAP])]
    half = coverage(found(near, np.ones(len(near), bool)))
    assert half.tested < whole.tested and half.failing == half.tested
    assert all("CutIn_Gap_m" in cell.names for cell in half.untested)
    assert half.least < 0.9
    assert [cell.share for cell in half.untested] == sorted(
        (cell.share for cell in half.untested), reverse=True
    )


def test_the_least_share_is_that_of_the_worst_pair(drawn: FloatArray) -> None:
    one = coverage(found(drawn[:1], np.zeros(1, bool)))
    assert one.tested == one.pairs  # one run is in one cell of each pair
    assert 0.0 < one.least < 0.2


def test_what_is_open_is_said(drawn: FloatArray) -> None:
    # So few that no model of them is made: other tests have it, and here it would take most time.
    few = drawn[:30]
    searched = found(few, few[:, GAP] < np.median(few[:, GAP]))
    said = Assurance.of(CUT_IN, searched, settings("cas"))
    text = "; ".join(said.cannot)
    assert "how likely a failure is in traffic: the density is stated, in whole or in part" in text
    assert "--estimate measures it" in text and "--repeat N" in text
    assert said.digests["scenario cut_in_highway.xosc"]
    assert said.versions["xosc-toolchain"] and said.versions["libsumo"]
    other = Assurance.of(CUT_IN, searched, settings("cas:brake=2"))
    assert {name for name in said.digests if said.digests[name] != other.digests.get(name)} == {
        "system cas", "settings",
    }  # fmt: skip
    limited = replace(searched, limits=("min_ttc<1",), cut=True)
    text = "; ".join(Assurance.of(CUT_IN, limited, settings("cas")).cannot)
    assert "collisions or min_ttc<1" in text and "the time ended the search" in text
