"""Trajectories by knots: what manoeuvres become, and what becomes of them on the way back."""

from __future__ import annotations

import numpy as np
import pytest

from studies.generation.knots.motion import (
    CAR,
    NUMBER,
    Setting,
    box,
    knots_of,
    maneuvers_of,
    weights,
)
from tests.generation.kinematic import SPACE, driven

SETTING = Setting(30.0, 3.5)
MANEUVER = np.array([20.0, 25.0, 4.0, 23.0, 5.0, 27.0, 6.0])


def test_knots_are_where_the_manoeuvre_is() -> None:
    (knots,) = knots_of(MANEUVER, SETTING)
    assert len(knots) == 1 + NUMBER + NUMBER - 2
    assert knots[0] == 15.0
    assert knots[1] == pytest.approx(
        20.0 + CAR + 4.0 * (30.0 - 25.0)
    )  # 4 s before the gap is reached, ego faster by 5 m/s
    final = 24.5 + (25.0 + 23.0) / 2 * 5 + (23.0 + 27.0) / 2 * 6 - 30.0 * 11
    assert knots[NUMBER] == pytest.approx(final)
    assert knots[1 + NUMBER :] == pytest.approx(
        [3.5, 3.5 * (0.5 + 0.5 * np.cos(np.pi * 0.4)), 0.0, 0.0]
    )  # at 3, 6, 9, 12 s


def test_trajectories_go_through_their_knots_and_keep_even_motion() -> None:
    shares = np.linspace(0.0, 1.0, NUMBER)
    np.testing.assert_allclose(weights(shares), np.eye(NUMBER), atol=1e-12)
    between = np.linspace(0.0, 1.0, 50)
    np.testing.assert_allclose(
        weights(between) @ (3.0 - 7.0 * shares), 3.0 - 7.0 * between, atol=1e-12
    )


def test_every_manoeuvre_of_the_box_has_its_knots_in_the_box() -> None:
    low, high = box(SPACE, SETTING)
    knots = knots_of(SPACE.draw(500, np.random.default_rng(3)), SETTING)
    assert (knots >= low - 0.01).all()
    assert (knots <= high + 0.01).all()
    assert low[1 + NUMBER :].tolist() == [0.0] * (NUMBER - 2)
    assert high[1 + NUMBER :].tolist() == [3.5] * (NUMBER - 2)


def test_the_nearest_manoeuvre_of_a_manoeuvres_knots_is_that_manoeuvre() -> None:
    theta = driven(80)
    found = maneuvers_of(knots_of(theta, SETTING), SETTING)
    assert found.lateral.max() < 0.5
    assert np.median(found.longitudinal) < 0.5
    assert (
        np.median(np.abs(found.theta - theta), axis=0) < [3.0, 0.2, 0.6, 0.4, 1.0, 0.5, 0.6]
    ).all()
    np.testing.assert_allclose(
        found.theta[:, (2, 4, 6)].sum(axis=1), theta[:, (2, 4, 6)].sum(axis=1), atol=0.2 + 1e-6
    )


def test_what_is_no_manoeuvre_is_far_from_the_nearest_one() -> None:
    (knots,) = knots_of(MANEUVER, SETTING)
    weaving = knots.copy()
    weaving[1 + NUMBER :] = [0.0, 3.5, 0.0, 3.5]
    jumping = knots.copy()
    jumping[3] += 60.0
    found = maneuvers_of(np.array([knots, weaving, jumping]), SETTING)
    assert found.lateral[1] > 1.0 > 5 * found.lateral[0]
    assert found.longitudinal[2] > 10.0 > 10 * found.longitudinal[0]
