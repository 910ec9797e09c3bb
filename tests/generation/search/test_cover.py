"""Coverage search: draws and guided runs, each finding covered, nothing outside the foreseeable."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from generation.search.methods.cover import CoverSettings, _Field, cover
from generation.search.methods.judging import Judging
from generation.search.methods.models import Forest, GaussianProcess
from generation.search.outcomes import Outcomes
from generation.search.problem import Guidance, Realism, Reward, SearchProblem
from generation.space.logical.library import SCENARIOS
from generation.space.recorded import of_recordings, of_samples
from generation.space.space import Space
from schemas.common.array_types import BoolArray, FloatArray
from schemas.common.errors import UsageError

SPACE = Space.of(SCENARIOS / "cut_in_highway.xosc")
GAP, EGO = (SPACE.names.index(name) for name in ("CutIn_Gap_m", "Ego_Speed_mps"))


def near(theta: FloatArray) -> BoolArray:
    return np.asarray(theta[:, GAP] < 8.0)


def fast(theta: FloatArray) -> BoolArray:
    return np.asarray((theta[:, EGO] > 34.0) & (theta[:, GAP] > 40.0))


def fails(theta: FloatArray) -> Outcomes:
    """Two regions: small gaps, and great speeds at great gaps."""
    failing = near(theta) | fast(theta)
    drac = np.where(failing, 8.0, 4.0 * np.exp(-theta[:, GAP] / 20.0))
    return Outcomes.of(
        len(theta), collision=failing, max_drac=drac, clearance=np.where(failing, 0.0, 2.0)
    )


@pytest.fixture(scope="module")
def posed() -> SearchProblem:
    recorded = of_samples(of_recordings(None, "cut_in"), SPACE)
    real = recorded.within(SPACE)
    reward = Reward(Realism.fitted("gaussian", real.theta, real.recordings))
    return SearchProblem(SPACE, fails, reward, real.theta, None, recorded.prior(SPACE, "gaussian"))


@pytest.mark.slow
def test_the_budget_is_spent_on_possible_points_and_a_seed_repeats_itself(
    posed: SearchProblem,
) -> None:
    found, again = (cover(posed, 150, 1) for _ in range(2))
    assert len(found.theta) == 150
    assert posed.prior is not None and posed.prior.possible(found.theta).all()
    np.testing.assert_array_equal(found.theta, again.theta)


@pytest.mark.slow
def test_each_finding_is_covered_though_another_fails_more_often(posed: SearchProblem) -> None:
    assert posed.prior is not None
    drawn = posed.prior.sample(300, np.random.default_rng(1))
    found = cover(posed, 300, 1)
    for region in (near, fast):
        assert region(found.theta).sum() > 1.2 * region(drawn).sum() > 0.0


@pytest.mark.slow
def test_more_runs_have_more_candidates_and_the_search_ends_where_nothing_new_fails(
    posed: SearchProblem,
) -> None:
    settings = CoverSettings(batch=(300, 0.0, 300), patience=(450, 0.0), traffic=500)
    posed = replace(posed, guidance=Guidance())
    found = cover(posed, 6000, 1, settings)
    assert posed.guidance.saturated and len(found.theta) < 6000
    assert posed.guidance.guided + posed.guidance.drawn == len(found.theta)
    assert posed.guidance.guided > 0.6 * len(found.theta), "1,600 candidates led to a tenth"
    nothing = replace(posed, guidance=Guidance(), evaluate=lambda theta: Outcomes.of(len(theta)))
    assert len(cover(nothing, 900, 1, settings).theta) == 900
    assert not nothing.guidance.saturated, "without a failure there is no end"


@pytest.mark.parametrize("blind", [Forest, GaussianProcess])
def test_what_one_model_cannot_see_the_other_one_finds(
    blind: type, posed: SearchProblem, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert posed.prior is not None
    monkeypatch.setattr(blind, "failing", lambda self, x: np.zeros(len(x)))
    assert fast(cover(posed, 160, 2).theta).sum() > 6, "two of 160 draws"


def test_a_guided_run_counts_no_more_where_another_one_is() -> None:
    """Many sure candidates in the region of most failures, and one unsure one in
    another: the second run goes there.
    """
    crowd, alone = np.full((1, 6), 0.2), np.full((1, 6), 0.8)
    candidates = np.concatenate([crowd + np.linspace(0.0, 0.06, 5)[:, None], alone])
    traffic = np.concatenate([np.repeat(crowd, 3, axis=0), alone])
    field = _Field.of(candidates, traffic, CoverSettings())
    field.choose(np.array([1.0, 1.0, 1.0, 1.0, 1.0, 0.6]), np.ones(4), 2)
    assert field.chosen[1] == 5


def test_each_region_has_its_share_of_the_guided_runs() -> None:
    """Nine tenths of traffic fail in one region: the other one, and what is near
    none, have runs all the same.
    """
    great, small, none = (np.full((20, 6), each) for each in (0.1, 0.5, 0.9))
    aside = np.linspace(0.0, 0.09, 20)[:, None]
    candidates = np.concatenate([great + aside, small + aside, none + aside])
    of, traffic = np.repeat([0, 1, 2], 20), np.repeat(great + aside, 5, axis=0)
    field = _Field.of(candidates, traffic, replace(CoverSettings(), least=0.0))
    field.choose(np.ones(60), np.ones(100), 9, of, np.array([3, 3, 3]))
    assert np.bincount(of[field.chosen]).tolist() == [3, 3, 3]
    left = _Field.of(candidates[:40], traffic, replace(CoverSettings(), least=0.0))
    left.choose(np.ones(40), np.ones(100), 9, of[:40], np.array([3, 3, 3]))
    assert len(left.chosen) == 9, "what nobody takes goes to the others"


def test_failures_that_no_judge_prevents_are_set_aside_and_judging_is_charged(
    posed: SearchProblem,
) -> None:
    """Judges collide at small gaps as the system does: the search learns from
    failures at great speeds alone.
    """
    ran = list[int]()

    def drivers(theta: FloatArray, sut: str) -> Outcomes:
        ran.append(len(theta))
        return Outcomes.of(len(theta), collision=near(theta))

    judging = Judging(SPACE, drivers)
    found = cover(replace(posed, judging=judging), 200, 2)
    assert len(found.theta) + sum(ran) == 200 and judging.runs == sum(ran)
    assert judging.counts.unprevented == pytest.approx(near(found.theta).sum(), abs=2)
    assert judging.counts.judged + judging.counts.assumed == found.outcomes.collision.sum()
    share, drawn = (
        near(each).mean()
        for each in (found.theta[60:], posed.prior.sample(500, np.random.default_rng(0)))
    )  # type: ignore[union-attr]
    assert share < 0.8 * drawn, "what nobody prevents attracts no runs"
    assert fast(found.theta).sum() > 5


def test_without_a_failure_every_run_is_still_spent(posed: SearchProblem) -> None:
    found = cover(replace(posed, evaluate=lambda theta: Outcomes.of(len(theta))), 90, 1)
    assert len(found.theta) == 90 and not found.outcomes.collision.any()


def test_plays_guides_by_its_verdicts_and_unprevented_failures_count_less(
    posed: SearchProblem,
) -> None:
    def own(theta: FloatArray, sut: str | None = None) -> Outcomes:
        """Careful drivers survive at great gaps alone."""
        found = fails(theta)
        return found if sut is None else replace(found, collision=found.collision & near(theta))

    found = cover(replace(posed, plays=own), 200, 1)
    guided = found.theta[np.arange(200) % 40 >= 10]
    assert (near(guided) | fast(guided)).all(), "verdicts of plays are those of the runs"
    assert fast(guided).sum() > 2 * fast(posed.prior.sample(150, np.random.default_rng(1))).sum()  # type: ignore[union-attr]


def test_a_problem_without_a_prior_is_refused(posed: SearchProblem) -> None:
    with pytest.raises(UsageError, match="needs a prior"):
        cover(replace(posed, prior=None), 10, 0)
