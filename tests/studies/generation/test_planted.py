"""Planted failures: regions have the probability that was asked for, and
searches are judged by what they find of them.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import cast

import numpy as np
import pytest

from generation.search.methods.cover import Frame, draws
from generation.search.outcomes import Evaluator, Outcomes
from generation.search.plays import ArrayPlays
from generation.search.problem import History, Realism, Reward, Search, SearchProblem
from generation.space.logical.library import SCENARIOS
from generation.space.recorded import of_recordings, of_samples
from generation.space.space import Space
from schemas.common.errors import UsageError
from schemas.common.storage import Records
from studies.generation.baselines.level_sets import level_sets
from studies.generation.baselines.subset import subset
from studies.generation.lockstep import together
from studies.generation.planted.designs import cells, maximin, sobol, stratified
from studies.generation.planted.sampling import METHODS, Sampler, estimates
from studies.generation.planted.sampling import table as sampled
from studies.generation.planted.shapes import DEVELOPMENT, REPORTED, SHAPES
from studies.generation.planted.study import (
    OURS,
    PLANS,
    Benchmark,
    Found,
    Result,
    Stated,
    interval,
    judged,
    row,
    stated,
    statements,
    summary,
    table,
)
from studies.generation.planted.systems import (
    CAREFUL,
    DECEPTIVE,
    GRADIENT,
    SILENT,
    UNDRIVEN,
    Plan,
    Pool,
    plant,
)
from studies.generation.problem import Posed

CUT_IN = SCENARIOS / "cut_in_highway.xosc"
SPACE = Space.of(CUT_IN)


@pytest.fixture(scope="module")
def posed() -> SearchProblem:
    recorded = of_samples(of_recordings(None, "cut_in"), SPACE)
    real = recorded.within(SPACE)
    plays = ArrayPlays(CUT_IN, SPACE)
    reward = Reward(Realism.fitted("gaussian", real.theta, real.recordings))
    return SearchProblem(
        SPACE, plays, reward, real.theta, None, recorded.prior(SPACE, "gaussian"), plays
    )


@pytest.fixture(scope="module")
def pool(posed: SearchProblem, tmp_path_factory: pytest.TempPathFactory) -> Pool:
    path = tmp_path_factory.mktemp("pool") / "pool.npz"
    assert posed.prior is not None and posed.plays is not None
    found = Pool.of(posed.prior, posed.plays, 3000, path)
    np.testing.assert_array_equal(Pool.of(posed.prior, posed.plays, 1, path).hits, found.hits)
    return found


def test_development_and_reported_shapes_are_apart() -> None:
    assert not DEVELOPMENT.keys() & REPORTED.keys()


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("margin", [GRADIENT, SILENT])
def test_regions_have_their_probability_and_nothing_fails_outside(
    shape: str, margin: str, posed: SearchProblem, pool: Pool
) -> None:
    assert posed.prior is not None and posed.plays is not None
    planted = plant(Plan(shape, (1, 1), 0.02, margin), SPACE, posed.prior, posed.plays, pool, 3)
    inside = planted.within(pool.theta, pool.undriven) & pool.undriven.collision
    failing = np.asarray(inside.any(axis=0), bool)
    assert (inside & pool.preventable).sum(axis=1) == pytest.approx([30, 30], abs=4)
    rows = np.concatenate(
        [
            np.flatnonzero(failing)[:20],
            pool.hits[~failing[pool.hits]][:200],
            np.flatnonzero(~failing)[:50],
        ]
    )
    found = planted(pool.theta[rows])
    np.testing.assert_array_equal(found.collision, failing[rows])
    passed = ~found.collision
    assert bool(np.any(found.max_drac[passed] > 4.0)) == (margin == GRADIENT), (
        "it gets worse only where there is a gradient"
    )


def test_a_search_is_judged_by_regions_and_recall(posed: SearchProblem, pool: Pool) -> None:
    assert posed.prior is not None and posed.plays is not None
    planted = plant(Plan("box", (1, 1), 0.04, SILENT), SPACE, posed.prior, posed.plays, pool, 3)
    own = replace(posed, evaluate=planted)
    nothing = draws(
        replace(
            posed,
            evaluate=lambda theta: replace(planted(theta), collision=np.zeros(len(theta), bool)),
        ),
        5,
        0,
    )
    assert judged(planted, own, pool, nothing) == Found(0.0, 0.0, 0.0, 6, 0.0, 0.0)
    held = planted.within(pool.theta, pool.undriven) & pool.undriven.collision & pool.preventable
    first = pool.theta[held[0]]
    one = judged(planted, own, pool, History(first, planted(first), np.zeros(len(first))))
    assert one.regions >= 0.5 and 0.4 <= one.near <= one.far <= 1.0 and one.first == 1
    every = pool.theta[held.any(axis=0)]
    whole = History(every, planted(every), np.zeros(len(every)))
    assert judged(planted, own, pool, whole)[:3] == (1.0, 1.0, 1.0)
    assert stated(planted, own, pool, nothing).missed == pytest.approx(
        len(every) / len(pool.theta)
    ), "nothing was found"
    assert stated(planted, own, pool, whole).missed < 0.2 * len(every) / len(pool.theta)


def test_a_driver_of_a_name_is_the_base_and_sleeps_in_the_regions(
    posed: SearchProblem, pool: Pool
) -> None:
    assert posed.prior is not None and posed.plays is not None
    planted = plant(
        Plan("box", (1,), 0.02, SILENT, "fsm"), SPACE, posed.prior, posed.plays, pool, 3
    )
    rows = pool.hits[:60]
    held = planted.within(pool.theta[rows], pool.undriven.take(rows))[0]
    found, base = planted(pool.theta[rows]), posed.plays(pool.theta[rows], "fsm")
    assert held.any() and found.collision[held].all()
    np.testing.assert_array_equal(found.clearance[~held], base.clearance[~held])


def test_margins_deceive_near_regions_and_near_others_that_never_fail(
    posed: SearchProblem, pool: Pool
) -> None:
    assert posed.prior is not None and posed.plays is not None
    plans = [Plan("box", (3, 1), 0.04, margin) for margin in (DECEPTIVE, SILENT)]
    planted, plain = (plant(each, SPACE, posed.prior, posed.plays, pool, 3) for each in plans)
    rows = pool.hits
    of = pool.theta[rows], pool.undriven.take(rows)
    found, usual = planted(of[0]), plain(of[0])
    np.testing.assert_array_equal(found.collision, usual.collision)
    real, decoy = (
        np.max([each.nearness(*of) for each in those], axis=0)
        for those in (planted.regions, planted.decoys)
    )
    better = (real > 0.5) & (decoy == 0.0) & ~found.collision
    worse = (decoy > 0.5) & (real == 0.0) & ~found.collision
    assert better.any() and (found.clearance[better] > usual.clearance[better]).all()
    assert worse.any() and (found.clearance[worse] < usual.clearance[worse]).all()
    sizes = [each.holds(*of).sum() for each in planted.regions]
    assert sizes[0] == pytest.approx(3 * sizes[1], abs=4), "regions are of unlike size"


def test_a_careful_base_fails_where_no_judge_survives(posed: SearchProblem, pool: Pool) -> None:
    assert posed.prior is not None and posed.plays is not None
    plan = Plan("box", (1,), 0.02, SILENT, CAREFUL)
    planted = plant(plan, SPACE, posed.prior, posed.plays, pool, 3)
    rows = np.flatnonzero(pool.undriven.collision)
    held = planted.within(pool.theta[rows], pool.undriven.take(rows))[0]
    lost = ~pool.preventable[rows]
    assert lost.any()
    np.testing.assert_array_equal(planted(pool.theta[rows]).collision, held | lost)
    found = judged(
        planted,
        posed,
        pool,
        History(pool.theta[rows[lost]], pool.undriven.take(rows[lost]), np.zeros(lost.sum())),
    )
    assert (found.regions, found.own) == (0.0, 1.0), "failures that nothing prevents are the base's"


def test_failures_of_the_base_are_counted_apart(posed: SearchProblem, pool: Pool) -> None:
    assert posed.prior is not None and posed.plays is not None
    planted = plant(
        Plan("box", (1,), 0.02, SILENT, UNDRIVEN), SPACE, posed.prior, posed.plays, pool, 3
    )
    theta = pool.theta[pool.hits[:60]]
    held = planted.within(theta, pool.undriven.take(pool.hits[:60]))[0]
    found = judged(planted, posed, pool, History(theta, planted(theta), np.zeros(60)))
    assert found.own == pytest.approx(1.0 - held.mean()) and 0.0 < found.own < 1.0
    own = theta[~held]
    nothing = judged(planted, posed, pool, History(own, planted(own), np.zeros(len(own))))
    assert (nothing.regions, nothing.far, nothing.own) == (0.0, 0.0, 1.0)


def test_systems_that_do_not_play_in_arrays_are_run(posed: SearchProblem) -> None:
    run = list[str | None]()

    def sumo(theta: np.ndarray, sut: str | None = None) -> Outcomes:
        run.append(sut)
        return Outcomes.of(len(theta))

    posing, theta = Posed(posed, cast(Evaluator, sumo)), posed.real[:2]
    assert len(posing.plays(theta, "sumo")) == len(posing.plays(theta, "cas")) == 2
    assert run == ["sumo"]
    posing._replace(problem=replace(posed, plays=None)).plays(theta, "cas")
    assert run == ["sumo", "cas"]


@pytest.mark.parametrize("method", [cells, sobol, maximin, subset, level_sets])
def test_rows_spend_their_budget_on_what_traffic_does(
    method: Search, posed: SearchProblem, pool: Pool
) -> None:
    assert posed.prior is not None and posed.plays is not None
    planted = plant(Plan("box", (1,), 0.04), SPACE, posed.prior, posed.plays, pool, 3)
    own = replace(posed, evaluate=planted, plays=None)
    one, other = method(own, 130, 4), method(own, 130, 4)
    np.testing.assert_array_equal(one.theta, other.theta)
    assert len(one.theta) == 130
    assert posed.prior.possible(one.theta).all()
    assert len(np.unique(one.theta[:, 0])) > 100


def test_searches_in_lockstep_find_what_each_finds_alone(posed: SearchProblem, pool: Pool) -> None:
    assert posed.prior is not None and posed.plays is not None
    plan, calls = Plan("box", (1,), 0.04), list[int]()

    def counting(theta: np.ndarray, sut: str | None = None) -> Outcomes:
        calls.append(len(theta))
        assert posed.plays is not None and sut == UNDRIVEN, "draws judge nothing"
        return posed.plays(theta, sut)

    planted = plant(plan, SPACE, posed.prior, posed.plays, pool, 3)
    found = together(
        [
            lambda plays, seed=seed: draws(
                replace(posed, evaluate=replace(planted, plays=plays)), 60, seed
            )
            for seed in (1, 2, 3)
        ],
        counting,
    )
    assert calls == [150, 30]
    for seed, history in zip((1, 2, 3), found, strict=True):
        np.testing.assert_array_equal(
            history.outcomes.collision,
            draws(replace(posed, evaluate=planted), 60, seed).outcomes.collision,
        )


def test_an_error_in_lockstep_is_the_callers(posed: SearchProblem) -> None:
    assert posed.plays is not None
    with pytest.raises(ZeroDivisionError):
        together(
            [lambda plays: len(plays(np.empty((0, len(SPACE.names))), UNDRIVEN)) / 0], posed.plays
        )


def test_results_are_kept_and_read_again(posed: SearchProblem, pool: Pool, tmp_path: Path) -> None:
    assert posed.plays is not None
    benchmark = Benchmark(posed, posed.plays, pool, [Plan("box", (1,), 0.04)], 3, ["draws"], 120)
    found = list(benchmark.results(1, Records(tmp_path / "a.jsonl")))
    assert [each.runs for each in found] == [100, 120]
    before = (tmp_path / "a.jsonl").read_bytes()
    assert list(benchmark.results(1, Records(tmp_path / "a.jsonl"))) == found
    assert (tmp_path / "a.jsonl").read_bytes() == before


def test_a_method_may_have_other_settings(posed: SearchProblem) -> None:
    found = row("cover:explored=0.5,first=20")
    assert isinstance(found, partial)
    settings = found.keywords["settings"]
    assert (settings.explored, settings.first) == (0.5, 20)
    assert row("draws") is draws
    for wrong in ("covr", "cover:explore=1", "draws:explored=1", "cover:first=1.5", "cover:first"):
        with pytest.raises(UsageError):
            row(wrong)


def test_a_pool_that_is_too_small_is_refused(posed: SearchProblem, pool: Pool) -> None:
    assert posed.prior is not None and posed.plays is not None
    with pytest.raises(ValueError, match="10 are needed"):
        plant(Plan("box", (1,), 1e-4, SILENT), SPACE, posed.prior, posed.plays, pool, 0)


def test_tables_have_a_row_for_each_method_and_compare_it_with_ours() -> None:
    nothing = Stated(1e-3, 2e-3, 0.25)
    found = [
        Result("a", "draws", 1, 10, Found(1.0, 0.5, 0.5, 3, 0.0, 0.0), 0.1, nothing),
        Result("b", "draws", 1, 10, Found(0.0, 0.0, 0.0, 11, 0.0, 0.0), 0.3, nothing),
        Result("a", OURS, 1, 10, Found(1.0, 0.5, 0.75, 3, 0.0, 0.0), 0.1, nothing),
        Result("b", OURS, 1, 10, Found(1.0, 0.5, 0.75, 3, 0.0, 0.0), 0.1, nothing),
    ]
    text = table(found)
    assert (
        "| a | 10 | draws | 1 | 1.00 (1.00 to 1.00) | 0.50 | 0.50 (0.50 to 0.50) | +0.25 "
        "(+0.25 to +0.25) | 3 | 0 |"
    ) in text
    assert (
        "| all | 10 | draws | 2 | 0.50 (0.00 to 1.00) | 0.25 | 0.25 (0.00 to 0.50) | +0.50 "
        "(+0.25 to +0.75) | 7 | 1 |"
    ) in text
    assert "| 10 | 1.00e-03 | 2.00e-03 | 0.250 |" in statements(found)
    assert summary([*found, *(each._replace(runs=30) for each in found)]).splitlines()[2:] == [
        "| draws | 0.25, 0.25 | +0.50 (+0.25 to +0.75) | 0.50, 0.50 | 1, 1 | 0.25 | 0.00 | 0.2 |",
        "| cover | 0.75, 0.75 | – | 1.00, 1.00 | 0, 0 | 0.50 | 0.00 | 0.1 |",
    ]
    low, high = interval(np.array([0.0, 1.0, 0.0, 1.0]))
    assert 0.0 <= low < 0.5 < high <= 1.0


def test_each_plan_of_a_generator_has_shapes_of_that_generator() -> None:
    assert {each.shape for each in PLANS["development"]} <= DEVELOPMENT.keys()
    assert {each.shape for each in PLANS["reported"]} == REPORTED.keys()


def test_a_design_has_one_draw_in_each_cell_of_equal_probability(posed: SearchProblem) -> None:
    assert posed.prior is not None
    generator = np.random.default_rng(2)
    frame = Frame.of(SPACE, posed.prior, generator)
    design = stratified(posed.prior, frame, 200, generator)
    assert len(design) == 256 and posed.prior.possible(design).all()
    many = frame.coordinates(posed.prior.sample(4000, generator))
    below = frame.coordinates(design) <= np.median(many, axis=0)
    np.testing.assert_allclose(below.mean(axis=0), 0.5, atol=0.08)


def test_draws_that_are_chosen_or_stratified_estimate_the_same_probability(
    posed: SearchProblem, pool: Pool
) -> None:
    assert posed.prior is not None and posed.plays is not None
    plans = [Plan("box", (1,), 0.03), Plan("corner", (1,), 0.02, SILENT)]
    systems = [plant(plan, SPACE, posed.prior, posed.plays, pool, 3) for plan in plans]
    truth = [
        (each.within(pool.theta, pool.undriven).any(axis=0) & pool.undriven.collision).mean()
        for each in systems
    ]
    frame = Frame.of(SPACE, posed.prior, np.random.default_rng(0))
    sampler = Sampler(posed.prior, frame, posed.plays, systems, 512)
    found, spent = estimates(sampler, 8, 1)
    for name in METHODS:
        assert found[name].mean(axis=0) == pytest.approx(truth, rel=0.4), name
    assert spent["chosen"] > spent["draws"]
    assert sampler.played == 8 * (2 * 512 + 128 + 2 * 384), (
        "chosen draws of each system, and shared ones"
    )
    again, _ = estimates(sampler, 2, 1)
    np.testing.assert_array_equal(again["chosen"], found["chosen"][:2])
    lines = sampled(plans, found, spent, 1.0).splitlines()
    assert [line.split(" | ")[0] for line in lines[-2:]] == ["| cells", "| chosen"]
