"""Coverage search: cells of equal probability, findings refined apart, nothing outside the foreseeable."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from generation.logical.library import SCENARIOS
from generation.outcomes.outcomes import Outcomes
from generation.recorded import of_recordings, of_samples
from generation.search.emitters import Frame
from generation.search.methods.cover import cover, grouped, stratified
from generation.search.problem import Problem, Realism, Reward
from generation.search.space import Space
from schemas.errors import UsageError
from xodr.array_types import BoolArray, FloatArray

SPACE = Space.of(SCENARIOS / "cut_in_highway.xosc")
GAP, EGO = (SPACE.names.index(name) for name in ("CutIn_Gap_m", "Ego_Speed_mps"))


def near(theta: FloatArray) -> BoolArray:
    return np.asarray(theta[:, GAP] < 15.0)


def fast(theta: FloatArray) -> BoolArray:
    return np.asarray((theta[:, EGO] > 34.0) & (theta[:, GAP] > 40.0))


def fails(theta: FloatArray) -> Outcomes:
    """Two regions: small gaps, and great speeds at great gaps."""
    failing = near(theta) | fast(theta)
    drac = np.where(failing, 8.0, 4.0 * np.exp(-theta[:, GAP] / 20.0))
    return Outcomes.of(len(theta), collision=failing, max_drac=drac, clearance=np.where(failing, 0.0, 2.0))


@pytest.fixture(scope="module")
def posed() -> Problem:
    recorded = of_samples(of_recordings(None, "cut_in"), SPACE)
    real = recorded.within(SPACE)
    reward = Reward(Realism.fitted("gaussian", real.theta, real.recordings))
    return Problem(SPACE, fails, reward, real.theta, None, recorded.prior(SPACE, "gaussian"))


def test_the_budget_is_spent_on_possible_points_and_a_seed_repeats_itself(posed: Problem) -> None:
    found, again = (cover(posed, 150, 1) for _ in range(2))
    assert len(found.theta) == 150
    assert posed.prior is not None and posed.prior.possible(found.theta).all()
    np.testing.assert_array_equal(found.theta, again.theta)


def test_each_finding_is_refined_though_another_fails_more_often(posed: Problem) -> None:
    assert posed.prior is not None
    drawn = posed.prior.sample(300, np.random.default_rng(1))
    found = cover(posed, 300, 1)
    for region in (near, fast):
        assert region(found.theta).sum() > 1.5 * region(drawn).sum() > 0.0


def test_without_a_failure_every_run_is_still_spent(posed: Problem) -> None:
    found = cover(replace(posed, evaluate=lambda theta: Outcomes.of(len(theta))), 90, 1)
    assert len(found.theta) == 90 and not found.outcomes.collision.any()


def test_a_design_has_one_draw_in_each_cell_of_equal_probability(posed: Problem) -> None:
    assert posed.prior is not None
    generator = np.random.default_rng(2)
    frame = Frame.of(SPACE, posed.prior, generator)
    design = stratified(posed.prior, frame, 200, generator)
    assert len(design) == 256 and posed.prior.possible(design).all()
    many = frame.coordinates(posed.prior.sample(4000, generator))
    below = frame.coordinates(design) <= np.median(many, axis=0)
    np.testing.assert_allclose(below.mean(axis=0), 0.5, atol=0.08)


def test_groups_are_linked_by_single_steps() -> None:
    rows = np.array([[0.0, 0.0], [0.1, 0.0], [0.2, 0.0], [0.9, 0.9]])
    labels = grouped(rows, 0.1)
    assert len(set(labels[:3])) == 1 and labels[3] != labels[0]
    assert len(grouped(rows[:1], 0.1)) == 1


def test_a_problem_without_a_prior_is_refused(posed: Problem) -> None:
    with pytest.raises(UsageError, match="needs a prior"):
        cover(replace(posed, prior=None), 10, 0)
