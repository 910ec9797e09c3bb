"""Regions of failure: groups with a rule, probability by draws, the most important first."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from generation.loop.findings import CarefulDriver, CaseVerdict, EdgeCase
from generation.loop.searches import regions_of
from generation.report.counterexamples import FailureRegion, Measure, regions, varying
from generation.search.outcomes import Episodes, Outcomes
from generation.space.space import grouped
from tests.generation.report.searches import EASY, HARD, SPACE, WEAK, searched

GAP, SPEED = (SPACE.names.index(name) for name in ("CutIn_Gap_m", "Ego_Speed_mps"))


@pytest.fixture(scope="module")
def found() -> tuple[list[FailureRegion], list[Measure]]:
    """Two groups: gaps below 15 m, and egos above 38 m/s with gaps above 60 m; the second one is hit harder."""
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
        assert each.precision > 0.9 and each.recall > 0.85


def test_probable_and_severe_regions_come_first(
    found: tuple[list[FailureRegion], list[Measure]],
) -> None:
    (fast, near), measures = found
    assert (fast.severity, near.severity) == (20.0, 2.0)
    low, high = fast.drawn.interval
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


def test_groups_are_linked_by_single_steps() -> None:
    rows = np.array([[0.0, 0.0], [0.1, 0.0], [0.2, 0.0], [0.9, 0.9]])
    labels = grouped(rows, 0.1)
    assert len(set(labels[:3])) == 1 and labels[3] != labels[0]
    assert len(grouped(rows[:1], 0.1)) == 1
