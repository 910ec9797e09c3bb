"""Regions of failure: groups with a rule, probability by draws, the most important first."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from generation.estimation.probability import FailingDraws
from generation.loop.findings import CarefulDriver, CaseVerdict, EdgeCase
from generation.loop.searches import regions_of
from generation.report.counterexamples import (
    FailureRegion,
    Measure,
    _rule,
    regions,
    varying,
    with_parts,
)
from generation.search.gate import Statement
from generation.search.outcomes import Episodes, Outcomes
from generation.space.space import grouped
from tests.generation.report.searches import EASY, HARD, SPACE, WEAK, searched

GAP, SPEED = (SPACE.names.index(name) for name in ("CutIn_Gap_m", "Ego_Speed_mps"))


@pytest.fixture(scope="module")
def found() -> tuple[list[FailureRegion], list[Measure]]:
    """Two groups: gaps below 15 m, and egos above 38 m/s with gaps above 60 m;
    the second one is hit harder.
    """
    generator = np.random.default_rng(0)
    theta = np.tile(np.array(EASY), (600, 1)) + generator.normal(0.0, 0.01, (600, len(EASY)))
    theta[:, GAP], theta[:, SPEED] = (
        generator.uniform(5.0, 80.0, 600),
        generator.uniform(10.0, 40.0, 600),
    )
    near = (theta[:, GAP] < 15.0) & (theta[:, SPEED] < 25.0)
    fast = (theta[:, SPEED] > 36.0) & (theta[:, GAP] > 60.0)
    speeds = np.where(fast, 20.0, 2.0) * (near | fast)
    outcomes = Outcomes.of(600, collision=near | fast, impact_speed=speeds)
    generated = searched("cas", np.array([HARD]))
    every = Episodes(theta, outcomes, np.zeros(600))
    generated = replace(
        generated, episodes=every, cases=generated.cases.take(np.zeros(1, bool)), draws=every
    )
    measures = [Measure("gap", "m", theta[:, GAP]), Measure("speed", "m/s", theta[:, SPEED])]
    return regions(generated, measures), measures


def test_groups_are_regions_with_rules_that_hold(
    found: tuple[list[FailureRegion], list[Measure]],
) -> None:
    (fast, near), measures = found
    assert "speed ≥" in fast.rule(measures) and "gap ≥" in fast.rule(measures)
    assert "gap ≤" in near.rule(measures) and near.rule(measures).endswith(("m", "m/s"))
    for each in (fast, near):
        assert each.precision.collisions > 0.9 * each.precision.runs > 0
        assert each.recall.collisions > 0.85 * each.recall.runs > 0


def test_a_rule_is_scored_on_unguided_draws_and_not_on_sought_runs() -> None:
    """A fifth of the gaps below 15 m fail; the search looked nowhere but at
    those: .8 of its runs there fail.
    """
    generator = np.random.default_rng(1)
    theta = np.tile(np.array(EASY), (500, 1))
    theta[:, GAP] = np.where(
        np.arange(500) < 200, generator.uniform(5.0, 80.0, 500), generator.uniform(5.0, 15.0, 500)
    )
    theta[:, SPEED] = generator.uniform(10.0, 40.0, 500)
    chance = np.where(np.arange(500) < 200, 0.2, 0.8)
    outcomes = Outcomes.of(500, collision=(theta[:, GAP] < 15.0) & (generator.random(500) < chance))
    every = Episodes(theta, outcomes, np.zeros(500))
    generated = replace(searched("cas", np.array([HARD])), episodes=every, draws=every.first(200))
    cases = generated.cases.take(np.zeros(len(generated.cases), bool))
    (region,) = regions(replace(generated, cases=cases), [Measure("gap", "m", theta[:, GAP])])
    assert region.precision.runs == (theta[:200, GAP] <= region.bounds[0].limit).sum()
    low, high = region.precision.interval
    assert low < 0.2 < high < 0.7
    written = region.as_json([Measure("gap", "m", theta[:, GAP])], {})
    assert written["precision_interval"] == [low, high]
    unknown = regions(
        replace(generated, cases=cases, draws=None), [Measure("gap", "m", theta[:, GAP])]
    )
    assert unknown[0].as_json([Measure("gap", "m", theta[:, GAP])], {})["precision"] is None


def test_a_rule_is_scored_on_draws_in_arrays_too() -> None:
    theta = np.tile(np.array(EASY), (200, 1))
    theta[:, GAP] = np.linspace(5.0, 80.0, 200)
    outcomes = Outcomes.of(200, collision=theta[:, GAP] < 15.0)
    every, generated = Episodes(theta, outcomes, np.zeros(200)), searched("cas", np.array([HARD]))
    none = generated.cases.take(np.zeros(len(generated.cases), bool))
    generated = replace(generated, episodes=every, draws=every, cases=none)
    of, twice = varying(generated), replace(generated, measuring=(theta, outcomes))
    alone, both = regions(generated, of), regions(twice, of)
    for one, two in zip(alone, both, strict=True):
        for few, more in ((one.precision, two.precision), (one.recall, two.recall)):
            assert (more.collisions, more.runs) == (2 * few.collisions, 2 * few.runs)
    assert sum(each.precision.runs for each in alone) > 0
    # Draws without a verdict say nothing.
    untested = Outcomes.of(len(theta), status=["error"] * len(theta))
    unscored = regions(replace(generated, measuring=(theta, untested)), of)
    assert [each.precision for each in unscored] == [each.precision for each in alone]


def test_failures_beyond_those_that_are_linked_count_in_their_region() -> None:
    """4,000 failures in two groups: a rule and a number of all of them, not of evenly chosen ones."""
    theta = np.tile(np.array(EASY), (10_000, 1))
    gaps = np.linspace(5.0, 80.0, 10_000)
    theta[:, GAP], theta[:, SPEED] = gaps, np.linspace(10.0, 40.0, 10_000)
    failing = (gaps < 25.0) | (gaps > 70.0)
    every = Episodes(theta, Outcomes.of(10_000, collision=failing), np.zeros(10_000))
    generated = searched("cas", np.array([HARD]))
    none = generated.cases.take(np.zeros(len(generated.cases), bool))
    generated = replace(generated, episodes=every, draws=every, cases=none)
    found, parts = with_parts(generated, varying(generated))
    assert parts is not None and len(found) == 2
    assert sum(region.failures for region in found) == int(failing.sum()) >= 4000
    for region in found:
        assert region.chance.failing == region.failures
        assert region.precision.collisions == region.precision.runs > 0.9 * region.failures


def test_few_failures_make_no_rule_and_no_rule_leaves_a_single_value() -> None:
    generated = searched("cas:brake=2", np.array([HARD, WEAK]), drawn=20)
    of = varying(generated)
    (first, *_) = found = regions(generated, of)
    assert all(not region.bounds for region in found if region.failures < 5)
    assert first.failures < 5 and "fewer than 5 failures" in first.rule(of)
    alike = np.concatenate([np.full(20, 0.194), np.linspace(0.0, 1.0, 30)])
    bounds = _rule(alike[:, None], np.arange(50) < 20)
    assert len(bounds) == 1, "≤ and ≥ of one value are no two conditions"


def test_probable_and_severe_regions_come_first(
    found: tuple[list[FailureRegion], list[Measure]],
) -> None:
    (fast, near), measures = found
    assert (fast.severity, near.severity) == (20.0, 2.0)
    low, high = fast.chance.interval
    assert low < fast.failures / 600 < high
    written = fast.as_json(measures, {"typical": [1.0, 2.0], "likeliest": [3.0, 4.0]})
    assert written["typical"] == {"gap": 1.0, "speed": 2.0} and written["likeliest"] == {
        "gap": 3.0,
        "speed": 4.0,
    }
    assert written["interval"] == [low, high]


def test_a_region_tells_which_reference_drivers_survive_its_edge_cases() -> None:
    generated = searched("cas:brake=2", np.array([HARD, WEAK]))
    measures = [
        Measure("gap", "m", generated.episodes.theta[generated.episodes.outcomes.executed, GAP])
    ]
    found = regions(generated, measures)
    cases = generated.cases
    assert sum(each.edge_cases for each in found) == len(cases) > 0
    for name, each in cases.drivers.items():
        assert sum(of.survived[name] for of in found) == int(each.survived.sum())
    assert any(of.survived["fsm"] for of in found)


def test_a_loop_has_the_same_regions_with_the_files_of_their_edge_cases() -> None:
    generated = searched("cas:brake=2", np.array([HARD, WEAK]))
    verdicts = CaseVerdict.COLLISION, CarefulDriver.UNKNOWN
    cases = [
        EdgeCase(f"{row}.xosc", None, {}, *verdicts, 0.0, 0.0)
        for row in range(len(generated.cases))
    ]
    of = varying(generated)
    found, expected = list(regions_of(generated, cases)), regions(generated, of)
    assert [each.rule for each in found] == [each.rule(of) for each in expected]
    assert [each.cases for each in found] == [
        [f"{row}.xosc" for row in each.cases] for each in expected
    ]
    assert sorted(file for each in found for file in each.cases) == [each.file for each in cases]


def test_without_failures_there_are_no_regions() -> None:
    generated = searched("cas:sensor_range=150", np.array([EASY]))
    assert regions(generated, [Measure("gap", "m", np.array([1.0]))]) == []


def test_probabilities_of_regions_add_up_and_none_exceeds_that_of_all() -> None:
    """Nine groups of failures, six of them listed; the draws fail in one of
    these and in one of the others.
    """
    generator = np.random.default_rng(4)
    theta = np.tile(np.array(EASY), (900, 1))
    theta[:, GAP], theta[:, SPEED] = generator.uniform(5.0, 85.0, 900), 20.0
    cell = np.floor(theta[:, GAP] / 10.0).astype(int)
    inside = np.abs(theta[:, GAP] - 10.0 * cell - 5.0) < 1.0
    generated = searched("cas", np.array([HARD]))
    outcomes = Outcomes.of(900, collision=inside, impact_speed=np.where(inside, 1.0 + cell, 0.0))
    every = Episodes(theta, outcomes, np.zeros(900))
    drawn = every.first(150)
    estimate = generated.estimate
    generated = replace(
        generated, episodes=every, draws=drawn, estimate=None,
        cases=generated.cases.take(np.zeros(len(generated.cases), bool)),
    )  # fmt: skip
    of = [Measure("gap", "m", theta[:, GAP])]
    found, parts = with_parts(generated, of)
    assert parts is not None and not parts.weighted
    failing = int(drawn.outcomes.collision.sum())
    counts = [chance.failing for chance in (*parts.regions, parts.others)]
    assert sum(counts) == parts.every.failing == failing
    assert [region.chance for region in found] == list(parts.regions)
    rows = drawn.theta[drawn.outcomes.collision]
    weighted = replace(
        generated,
        estimate=estimate and estimate._replace(
            failing=FailingDraws(rows, np.full(len(rows), 0.1), 150, 1.0, np.empty((0, len(rows))))
        ),
    )  # fmt: skip
    _, told = with_parts(weighted, of)
    assert told is not None and told.weighted
    values = [chance.value for chance in (*told.regions, told.others)]
    assert sum(values) == pytest.approx(told.every.value) == pytest.approx(0.1 * failing / 150)
    passing = np.flatnonzero(~outcomes.collision)[:150]
    calm = Episodes(theta[passing], outcomes.take(passing), np.zeros(150))
    _, nothing = with_parts(replace(generated, draws=calm), of)
    limit = Statement(150, 0, 0).unknown
    assert nothing is not None and {each.interval for each in nothing.regions} == {(0.0, limit)}, (
        "not at most 2.4 % beside a statement of 2 %"
    )


def test_groups_are_linked_by_single_steps() -> None:
    rows = np.array([[0.0, 0.0], [0.1, 0.0], [0.2, 0.0], [0.9, 0.9]])
    labels = grouped(rows, 0.1)
    assert len(set(labels[:3])) == 1 and labels[3] != labels[0]
    assert len(grouped(rows[:1], 0.1)) == 1
