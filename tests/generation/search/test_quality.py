"""Quality-diversity: what is run is foreseeable, fails on the twin, can be prevented, and is like nothing run before."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from generation.density.prior import RecordedPrior
from generation.logical.library import SCENARIOS
from generation.outcomes.judges import survivors
from generation.recorded import of_recordings, of_samples
from generation.search.emitters import Frame
from generation.search.methods.quality import QualitySettings, quality
from generation.search.problem import History, Problem, Realism, Reward
from generation.search.screen import FEW
from generation.search.space import Space, distinctive
from generation.twin.episodes import Twin
from schemas.common.errors import UsageError

pytest.importorskip("ribs")
CUT_IN = SCENARIOS / "cut_in_highway.xosc"
SPACE = Space.of(CUT_IN)
QUICK = QualitySettings(batch=100, first=2000)


@pytest.fixture(scope="module")
def posed() -> Problem:
    recorded = of_samples(of_recordings(None, "cut_in"), SPACE)
    real = recorded.within(SPACE)
    twin = Twin(CUT_IN, SPACE)
    reward = Reward(Realism.fitted("gaussian", real.theta, real.recordings))
    return Problem(SPACE, twin, reward, real.theta, None, recorded.prior(SPACE, "gaussian"), twin)


@pytest.fixture(scope="module")
def found(posed: Problem) -> History:
    return quality(posed, 8, 1, QUICK)


def test_runs_are_distinct_foreseeable_and_preventable_failures(posed: Problem, found: History) -> None:
    assert posed.prior is not None
    assert posed.twin is not None
    assert 3 <= len(found.theta) <= 8
    assert found.outcomes.collision.all()
    assert posed.prior.foreseeable(found.theta).all()
    assert survivors(found.theta, posed.twin).all()
    unit = SPACE.unit(found.theta)[:, distinctive(SPACE)]
    distance = np.sqrt(np.square(unit[:, None] - unit[None]).mean(axis=2))
    assert distance[~np.eye(len(unit), dtype=bool)].min() >= QUICK.apart


def test_the_same_seed_gives_the_same_runs_and_nothing_is_found_twice(posed: Problem, found: History) -> None:
    again = quality(posed, 8, 1, QUICK)
    np.testing.assert_array_equal(found.theta, again.theta)
    other = quality(replace(posed, found=found.theta), 3, 1, QUICK)
    a, b = (SPACE.unit(each.theta)[:, distinctive(SPACE)] for each in (found, other))
    assert np.sqrt(np.square(a[:, None] - b[None]).mean(axis=2)).min(initial=1.0) >= QUICK.apart


def test_without_a_twin_the_budget_is_spent_on_foreseeable_points(posed: Problem) -> None:
    assert posed.prior is not None
    spent, again = (quality(replace(posed, twin=None), 60, 2, QUICK) for _ in range(2))
    assert len(spent.theta) == 60
    assert posed.prior.foreseeable(spent.theta).all()
    np.testing.assert_array_equal(spent.theta, again.theta)


def test_a_number_of_proposals_is_no_more_than_so_many_generations(posed: Problem) -> None:
    settings = QualitySettings(("line", "prior"), batch=100, first=2000)
    assert settings.generations_of(2650) == 3
    assert settings.generations_of(10) == 1
    ended = quality(replace(posed, twin=None), 1000, 2, replace(QUICK, generations=2, pace=25.0))
    assert len(ended.theta) == (2000 + 2 * 100) / 25


@pytest.mark.parametrize("seed", [1, 3])
def test_without_a_twin_failures_are_found_where_runs_so_far_make_them_likely(posed: Problem, seed: int) -> None:
    alone = quality(replace(posed, twin=None), 130, seed)
    assert alone.outcomes.collision[FEW:].mean() > 0.3


def test_a_problem_without_a_prior_is_refused(posed: Problem) -> None:
    with pytest.raises(UsageError, match="prior"):
        quality(replace(posed, prior=None), 10, 0, QUICK)


def test_coordinates_lead_back_to_points(posed: Problem) -> None:
    assert isinstance(posed.prior, RecordedPrior)
    frame = Frame.of(SPACE, posed.prior, np.random.default_rng(0))
    theta = posed.real[:20]
    told = distinctive(SPACE)
    np.testing.assert_allclose(frame.points(frame.coordinates(theta))[:, told], theta[:, told])
    assert frame.measures(theta).shape == (20, 4)
    draw = partial(frame.prior.sample, 5)
    assert frame.coordinates(draw(np.random.default_rng(1))).shape == (5, 6)
