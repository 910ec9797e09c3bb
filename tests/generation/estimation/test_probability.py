"""Probabilities of weighted draws, and what a control takes out of them."""

from __future__ import annotations

import numpy as np
import pytest

from generation.estimation.probability import (
    ControlVariate,
    Probability,
    Rate,
    density_spread,
    probability,
)


def draws(n: int, seed: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """Uniform draws of 0 to 1, and weights that are 1."""
    return np.random.default_rng(seed).uniform(size=n), np.ones(n)


def test_draws_of_the_prior_count_as_they_are() -> None:
    u, weights = draws(2000)
    found = probability(u < 0.1, weights, 1.0)
    assert found.value == pytest.approx((u < 0.1).mean())
    assert found.deviation == pytest.approx(
        np.sqrt(found.value * (1 - found.value) / 2000), rel=0.01
    )
    assert found.effective == pytest.approx((u < 0.1).sum())
    assert found.stable


def test_where_nothing_fails_the_bound_counts_the_greatest_weight() -> None:
    found = probability(np.zeros(300, bool), np.ones(300), 5.0)
    assert found.interval == (0.0, pytest.approx(5.0 * (1.0 - 0.05 ** (1 / 300))))
    assert "no draw fails" in str(found)


def test_a_part_of_an_event_is_no_likelier_than_the_event_where_that_is_well_known() -> None:
    u, weights = draws(2000)
    none = probability(np.zeros(50, bool), np.ones(50), 5.0)
    whole = probability(u < 0.1, weights, 1.0)
    assert none.within(whole).interval == (0.0, whole.interval[1])
    assert none.within(probability(u < 0.01, weights, 1.0)) == none, "few failures bound nothing"


def test_few_failures_are_called_unstable() -> None:
    u, weights = draws(300)
    assert "unstable" in str(probability(u < 0.02, weights, 1.0))


def test_plays_that_is_right_leaves_its_own_uncertainty_only() -> None:
    u, weights = draws(300)
    more, heavy = draws(40_000, 4)
    plain = probability(u < 0.1, weights, 1.0)
    controlled = probability(u < 0.1, weights, 1.0, ControlVariate(u < 0.1, more < 0.1, heavy))
    assert controlled.value == pytest.approx((more < 0.1).mean())
    assert controlled.deviation < 0.12 * plain.deviation


def test_plays_that_is_wrong_does_no_harm() -> None:
    u, weights = draws(4000)
    more, heavy = draws(40_000, 4)
    plain = probability(u < 0.1, weights, 1.0)
    controlled = probability(u < 0.1, weights, 1.0, ControlVariate(u > 0.7, more > 0.7, heavy))
    assert controlled.value == pytest.approx(plain.value, abs=3 * plain.deviation)
    assert controlled.deviation < 1.05 * plain.deviation


def test_an_unsure_density_widens_the_interval() -> None:
    u, weights = draws(2000)
    sure = probability(u < 0.1, weights, 1.0)
    unsure = sure._replace(density=0.3)
    assert (
        unsure.interval[0] < 0.7 * sure.interval[0] and unsure.interval[1] > 1.4 * sure.interval[1]
    )
    assert unsure.value == sure.value and unsure.stable


def test_estimates_tell_no_more_digits_than_they_know() -> None:
    assert str(Probability(1.234e-3, 1e-5, 90.0, 1.0)) == "1.2e-03 [1.2e-03, 1.3e-03]"
    assert str(Rate(0.01234, (0.01, 0.0156))) == "1.2e-02 [1.0e-02, 1.6e-02]"


def test_densities_that_give_failures_no_probability_widen_the_interval_to_all() -> None:
    spread = density_spread(np.array([[-5000.0], [0.0]]), np.array([0.01]))
    assert 400.0 < spread < 1000.0
    low, high = Probability(0.01, 0.001, 60.0, 0.02, spread).interval
    assert (low, high) == (pytest.approx(0.0, abs=1e-300), 1.0)


def test_a_single_draw_that_fails_leaves_its_probability_open() -> None:
    found = probability(np.array([True]), np.array([0.5]), 5.0)
    assert (found.value, found.interval, found.stable) == (0.5, (0.0, 1.0), False)


def test_few_draws_of_great_weights_bound_nothing() -> None:
    found = probability(np.array([False, False]), np.array([0.5, 0.2]), 5.0)
    assert found.interval == (0.0, 1.0)


def test_failing_draws_that_plays_take_away_still_bound_it() -> None:
    found = Probability(0.0, 0.01, 1.0, 0.02, counted_alone=(0.001, 0.05))
    assert found.interval == (0.0, 0.05)
    assert str(found) == "below 5.0e-02", "a draw does fail"
