"""Models of the runs so far: predicted failures, and how well they are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from generation.search.methods.models import (
    _FITTED,
    _MOST,
    BORDER,
    Forest,
    GaussianProcess,
    evenly,
    nearness,
    scores,
    typical_margin,
)
from generation.search.outcomes import Outcomes
from schemas.common.array_types import FloatArray


def test_points_near_failures_come_first() -> None:
    x = np.random.default_rng(0).random((400, 3))
    forest = Forest()
    forest.learn(
        x[:300],
        Outcomes.of(
            300, collision=x[:300, 0] > 0.8, max_drac=8.0 * x[:300, 0], clearance=[1.0] * 300
        ),
    )
    assert len(forest) == 300
    assert not len(forest.failing(x[:0]))
    order = np.argsort(-forest.failing(x[300:]))
    assert x[300:][order[:10], 0].min() > 0.75
    assert x[300:][order[-10:], 0].max() < 0.25


def test_failures_that_depend_on_a_difference_come_first_even_beside_near_misses() -> None:
    x = np.random.default_rng(0).random((600, 6))
    faster = x[:, 0] - x[:, 1]
    forest = Forest()
    forest.learn(
        x[:300], Outcomes.of(300, collision=faster[:300] > 0.5, max_drac=8.0 * (x[:300, 2] > 0.5))
    )
    order = np.argsort(-forest.failing(x[300:]))
    assert (faster[300:][order[:20]] > 0.5).mean() >= 0.9


def test_few_runs_predict_nothing() -> None:
    forest = Forest()
    forest.learn(np.zeros((5, 2)), Outcomes.of(5, collision=[True] * 5))
    assert forest.failing(np.zeros((3, 2))).tolist() == [0.0, 0.0, 0.0]


def test_passing_in_another_lane_is_further_from_a_failure_than_braking_for_a_leader() -> None:
    found = Outcomes.of(
        3,
        clearance=[1.95, 6.0, 0.0],
        max_drac=[0.0, 3.0, 9.0],
        status=["completed", "completed", "error"],
    )
    beside, braking, error = nearness(found)
    assert error == 0.0 < beside < braking < 1.0


def test_a_failure_scores_more_than_any_miss_and_a_failed_run_nothing() -> None:
    found = Outcomes.of(
        3,
        collision=[True, False, True],
        max_drac=[0.0, 99.0, 0.0],
        status=["completed", "completed", "error"],
    )
    failure, miss, error = scores(found)
    assert failure == 1.0 > miss > error == 0.0


def test_a_model_learns_from_a_bounded_number_of_runs_with_the_rare_failures_among_them() -> None:
    few, half = np.zeros(5 * _MOST, bool), np.arange(5 * _MOST) % 2 == 0
    few[::1000] = True
    for failing in (few, half):
        rows = evenly(failing, _MOST)
        assert len(rows) == len(np.unique(rows)) == _MOST
        assert failing[rows].sum() == min(failing.sum(), _MOST // 2)
    np.testing.assert_array_equal(evenly(few[:100], _MOST), np.arange(100))


@pytest.fixture(scope="module")
def halves() -> tuple[GaussianProcess, FloatArray]:
    """A process that knows 300 runs, which fail from 1 on in their first
    coordinate, and other rows.
    """
    x = np.random.default_rng(0).uniform(-2.0, 2.0, (500, 2))
    process = GaussianProcess(280)
    process.learn(x[:300], Outcomes.of(300, collision=x[:300, 0] > 1.0, clearance=[np.inf] * 300))
    return process, x[300:]


def test_failures_are_likely_where_runs_failed(halves: tuple[GaussianProcess, FloatArray]) -> None:
    process, rows = halves
    chance = process.failing(rows)
    assert _FITTED < 280 < 300, "both bounds hold"
    assert chance[rows[:, 0] > 1.4].min() > 0.5 > chance[rows[:, 0] < 0.5].max() >= 0.0


def test_little_is_known_where_no_run_was(halves: tuple[GaussianProcess, FloatArray]) -> None:
    process, rows = halves
    (_, known), (_, far) = (process.predicted(each) for each in (rows, np.array([[0.0, 12.0]])))
    assert known.max() < 0.7 * far[0]


def test_runs_are_the_nearer_to_a_failure_the_less_is_left_to_a_limit() -> None:
    found = Outcomes.of(4, margin=[0.01, 1.0, 20.0, math.inf])
    near = nearness(found)
    assert (np.diff(near) < 0.0).all() and 0.4 < near[0] < BORDER
    assert near[3] == nearness(Outcomes.of(1))[0]


def test_a_margin_that_is_the_same_everywhere_hides_no_collision() -> None:
    braking = Outcomes.of(
        3, margin=[0.75] * 3, max_drac=[0.0, 3.0, 6.0], clearance=[50.0, 9.0, 2.0]
    )
    typical = typical_margin(braking)
    assert typical == 0.75 and typical_margin(Outcomes.of(3)) > 1.0
    near = nearness(braking, typical)
    assert near[0] < 0.2 < 0.3 < near[1] < 0.5 < near[2]
