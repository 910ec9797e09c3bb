"""Planted failures: regions have the probability that was asked for, and searches are judged by what they find of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from generation.logical.library import SCENARIOS
from generation.recorded import of_recordings, of_samples
from generation.search.emitters import Frame
from generation.search.problem import History, Problem, Realism, Reward
from generation.search.space import Space
from generation.twin.episodes import Twin
from studies.generation.planted.study import Found, draws, interval, judged, stratified, table
from studies.generation.planted.systems import DEVELOPMENT, REPORTED, SHAPES, Plan, Pool, plant

CUT_IN = SCENARIOS / "cut_in_highway.xosc"
SPACE = Space.of(CUT_IN)


@pytest.fixture(scope="module")
def posed() -> Problem:
    recorded = of_samples(of_recordings(None, "cut_in"), SPACE)
    real = recorded.within(SPACE)
    twin = Twin(CUT_IN, SPACE)
    reward = Reward(Realism.fitted("gaussian", real.theta, real.recordings))
    return Problem(SPACE, twin, reward, real.theta, None, recorded.prior(SPACE, "gaussian"), twin)


@pytest.fixture(scope="module")
def pool(posed: Problem, tmp_path_factory: pytest.TempPathFactory) -> Pool:
    path = tmp_path_factory.mktemp("pool") / "pool.npz"
    assert posed.prior is not None and posed.twin is not None
    found = Pool.of(posed.prior, posed.twin, 3000, path)
    np.testing.assert_array_equal(Pool.of(posed.prior, posed.twin, 1, path).theta, found.theta)
    return found


def test_development_and_reported_shapes_are_apart() -> None:
    assert not DEVELOPMENT.keys() & REPORTED.keys()


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("gradient", [False, True])
def test_regions_have_their_probability_and_nothing_fails_outside(shape: str, gradient: bool, posed: Problem, pool: Pool) -> None:
    assert posed.prior is not None and posed.twin is not None
    planted = plant(Plan(shape, 2, 0.02, gradient), SPACE, posed.prior, posed.twin, pool, 3)
    inside = planted.within(pool.theta) & pool.collides
    failing = np.asarray(inside.any(axis=0), bool)
    assert inside.sum(axis=1) == pytest.approx([30, 30], abs=2)
    rows = np.concatenate([np.flatnonzero(failing)[:20], np.flatnonzero(~failing)[:200]])
    found = planted(pool.theta[rows])
    np.testing.assert_array_equal(found.collision, failing[rows])
    passed = ~found.collision
    assert bool(np.any(found.max_drac[passed] > 4.0)) == gradient, "it gets worse only where there is a gradient"


def test_a_search_is_judged_by_regions_and_recall(posed: Problem, pool: Pool) -> None:
    assert posed.prior is not None and posed.twin is not None
    planted = plant(Plan("box", 2, 0.04, False), SPACE, posed.prior, posed.twin, pool, 3)
    own = replace(posed, evaluate=planted)
    nothing = draws(replace(posed, evaluate=lambda theta: replace(planted(theta), collision=np.zeros(len(theta), bool))), 5, 0)
    assert judged(planted, own, pool, nothing) == Found(0.0, 0.0, 0.0, 6, 0.0)
    first = pool.theta[np.asarray(planted.within(pool.theta))[0] & pool.collides]
    one = judged(planted, own, pool, History(first, planted(first), np.zeros(len(first))))
    assert one.regions >= 0.5 and 0.4 <= one.near <= one.far <= 1.0 and one.first == 1
    every = pool.theta[planted.within(pool.theta).any(axis=0) & pool.collides]
    assert judged(planted, own, pool, History(every, planted(every), np.zeros(len(every))))[:3] == (1.0, 1.0, 1.0)


def test_a_pool_that_is_too_small_is_refused(posed: Problem, pool: Pool) -> None:
    assert posed.prior is not None and posed.twin is not None
    with pytest.raises(ValueError, match="10 are needed"):
        plant(Plan("box", 1, 1e-4, False), SPACE, posed.prior, posed.twin, pool, 0)


def test_tables_have_a_row_for_each_method_and_one_for_all(tmp_path: Path) -> None:
    found = [("a", "draws", 1, Found(1.0, 0.5, 0.5, 3, 0.0)), ("b", "draws", 1, Found(0.0, 0.0, 0.0, 9, 0.0))]
    text = table(found)
    assert "| a | draws | 1.00 | 0.50 | 0.50 (0.50 to 0.50) | 0 of 1 | 0.00 |" in text
    assert "| all | draws | 0.50 | 0.25 | 0.25" in text and "1 of 2 |" in text
    low, high = interval(np.array([0.0, 1.0, 0.0, 1.0]))
    assert 0.0 <= low < 0.5 < high <= 1.0


def test_a_design_has_one_draw_in_each_cell_of_equal_probability(posed: Problem) -> None:
    assert posed.prior is not None
    generator = np.random.default_rng(2)
    frame = Frame.of(SPACE, posed.prior, generator)
    design = stratified(posed.prior, frame, 200, generator)
    assert len(design) == 256 and posed.prior.possible(design).all()
    many = frame.coordinates(posed.prior.sample(4000, generator))
    below = frame.coordinates(design) <= np.median(many, axis=0)
    np.testing.assert_allclose(below.mean(axis=0), 0.5, atol=0.08)
