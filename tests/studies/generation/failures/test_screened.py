"""Methods with the extras of quality-diversity search, and with settings of their own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from generation.logical.library import SCENARIOS
from generation.outcomes.judges import survivors
from generation.recorded import of_recordings, of_samples
from generation.search.problem import Calls, History, Problem, Realism, Reward
from generation.search.screen import nearness
from generation.search.space import Space, distinctive
from generation.twin.episodes import Twin
from schemas.common.errors import UsageError
from studies.generation.failures.problem import LEAST, screened
from studies.generation.failures.study import BOUNDS, EMITTERS, TRIALS, sets, with_settings
from studies.generation.methods import METHODS

CUT_IN = SCENARIOS / "cut_in_highway.xosc"
SPACE = Space.of(CUT_IN)


@pytest.fixture(scope="module")
def posed() -> Problem:
    recorded = of_samples(of_recordings(None, "cut_in"), SPACE)
    real = recorded.within(SPACE)
    twin = Twin(CUT_IN, SPACE)
    reward = Reward(Realism.fitted("gaussian", real.theta, real.recordings))
    return Problem(SPACE, twin, reward, real.theta, None, recorded.prior(SPACE, "gaussian"), twin)


def traffic(problem: Problem, budget: int, seed: int) -> History:
    """Draws of the prior."""
    assert problem.prior is not None
    calls, generator = Calls(problem, budget), np.random.default_rng(seed)
    while calls.left:
        calls(problem.prior.sample(3000, generator))
    return calls.history


def test_a_screened_method_runs_only_new_failures_that_are_foreseeable_and_preventable(posed: Problem) -> None:
    assert posed.prior is not None
    assert posed.twin is not None
    found = screened(traffic, 9000)(posed, 1000, 1)
    assert 1 <= len(found.theta) < 1000
    assert found.outcomes.collision.all()
    assert posed.prior.foreseeable(found.theta).all()
    assert survivors(found.theta, posed.twin).all()
    unit = SPACE.unit(found.theta)[:, distinctive(SPACE)]
    distance = np.sqrt(np.square(unit[:, None] - unit[None]).mean(axis=2))
    assert distance[~np.eye(len(unit), dtype=bool)].min(initial=1.0) >= LEAST


def test_a_screened_method_ends_with_its_runs(posed: Problem) -> None:
    assert len(screened(traffic, 30000)(posed, 1, 1).theta) == 1
    assert len(screened(with_settings("random", {"batch": 500}), 1000)(replace(posed, twin=None), 5, 1).theta) <= 5


def test_without_a_twin_the_runs_last_for_all_proposals_and_the_most_promising_are_run(posed: Problem) -> None:
    alone = screened(traffic, 9000)(replace(posed, twin=None), 90, 1)
    assert len(alone.theta) == 90
    assert posed.prior is not None
    assert posed.prior.foreseeable(alone.theta).all()
    drawn = posed.evaluate(posed.prior.sample(1000, np.random.default_rng(1)))
    assert nearness(alone.outcomes).mean() > 2.0 * nearness(drawn).mean()


def test_every_trial_is_of_settings_that_its_method_has() -> None:
    assert TRIALS.keys() <= METHODS.keys()
    assert len({len(each) for each in TRIALS.values()}) == 1, "as many trials for each method"
    for name, tried in TRIALS.items():
        for settings in tried:
            with_settings(name, settings)


@pytest.mark.parametrize(("name", "unknown"), [("cma-es", "walkers"), ("random", "sigma")])
def test_settings_that_a_method_does_not_have_are_refused(name: str, unknown: str) -> None:
    with pytest.raises(UsageError, match=unknown):
        with_settings(name, {unknown: 1})


def test_ablations_leave_out_each_emitter_once_and_repeat_no_set() -> None:
    tried = sets()
    assert {(name,) for name in EMITTERS} <= set(tried)
    assert {frozenset(EMITTERS) - {name} for name in EMITTERS} <= {frozenset(each) for each in tried}
    assert len({frozenset(each) for each in tried}) == len(tried)
    for settings in BOUNDS.values():
        with_settings("mcsg", settings)
