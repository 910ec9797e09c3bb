"""The model of runs so far: it ranks points by how near they come to a failure, and knows the run that is most like a point."""

from __future__ import annotations

import numpy as np

from generation.outcomes.outcomes import Outcomes
from generation.search.screen import _MOST, Surrogate, _learnt, nearness


def test_points_near_failures_come_first() -> None:
    x = np.random.default_rng(0).random((400, 3))
    surrogate = Surrogate()
    surrogate.learn(x[:300], Outcomes.of(300, collision=x[:300, 0] > 0.8, max_drac=8.0 * x[:300, 0], clearance=[1.0] * 300))
    assert len(surrogate) == 300
    assert not len(surrogate.ranked(x[:0]))
    order = surrogate.ranked(x[300:])
    np.testing.assert_array_equal(np.sort(order), np.arange(100))
    assert x[300:][order[:10], 0].min() > 0.75
    assert x[300:][order[-10:], 0].max() < 0.25


def test_failures_that_depend_on_a_difference_come_first_even_beside_near_misses() -> None:
    x = np.random.default_rng(0).random((600, 6))
    faster = x[:, 0] - x[:, 1]
    surrogate = Surrogate()
    surrogate.learn(x[:300], Outcomes.of(300, collision=faster[:300] > 0.5, max_drac=8.0 * (x[:300, 2] > 0.5)))
    assert (faster[300:][surrogate.ranked(x[300:])[:20]] > 0.5).mean() >= 0.9


def test_a_point_is_like_the_nearest_run() -> None:
    surrogate = Surrogate()
    np.testing.assert_array_equal(surrogate.ranked(np.zeros((3, 2))), [0, 1, 2])
    assert not surrogate.alike(np.zeros((3, 2))).collision.any()
    surrogate.learn(np.array([[0.1, 0.1]]), Outcomes.of(1, collision=[True]))
    surrogate.learn(np.array([[0.9, 0.9]]), Outcomes.of(1, collision=[False]))
    np.testing.assert_array_equal(surrogate.alike(np.array([[0.2, 0.3], [0.8, 0.6]])).collision, [True, False])


def test_passing_in_another_lane_is_further_from_a_failure_than_braking_for_a_leader() -> None:
    beside, braking, error = nearness(
        Outcomes.of(3, clearance=[1.95, 6.0, 0.0], max_drac=[0.0, 3.0, 9.0], status=["completed", "completed", "error"])
    )
    assert error == 0.0 < beside < braking < 1.0


def test_a_forest_learns_from_a_bounded_number_of_runs_with_the_rare_failures_among_them() -> None:
    few, half = np.zeros(5 * _MOST, bool), np.arange(5 * _MOST) % 2 == 0
    few[::1000] = True
    for failing in (few, half):
        rows = _learnt(failing)
        assert len(rows) == len(np.unique(rows)) == _MOST
        assert failing[rows].sum() == min(failing.sum(), _MOST // 2)
    np.testing.assert_array_equal(_learnt(few[:100]), np.arange(100))
