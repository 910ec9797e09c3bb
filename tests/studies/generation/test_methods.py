"""The methods beside MCSG: all keep to the contract, and each does what it is named after."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from generation.search.methods import offered
from generation.search.outcomes import Outcomes
from generation.search.problem import SearchProblem, method
from schemas.common.errors import UsageError
from studies.generation.ablations.mcsg import exclusive_reward
from studies.generation.methods import ABLATIONS, METHODS, TRAJECTORIES
from tests.generation.kinematic import Kinematic

QUICK = [name for name in METHODS if name not in ("cover", "draws", "level-sets", "subset")]
"""Without those that need a prior"""


@pytest.mark.parametrize("name", QUICK)
def test_every_method_spends_its_budget_exactly_and_repeats_by_its_seed(
    name: str, problem: SearchProblem
) -> None:
    one, two = (method(name, METHODS)(problem, 110, 5) for _ in range(2))
    assert one.theta.shape == (110, 7)
    assert len(one.outcomes) == len(one.rewards) == 110
    assert (one.theta >= problem.space.low).all() and (one.theta <= problem.space.high).all()
    assert np.array_equal(one.theta, two.theta)
    assert np.allclose(one.rewards, problem.reward(one.theta, one.outcomes))
    assert not np.array_equal(one.theta, method(name, METHODS)(problem, 110, 6).theta)


def test_bayesian_optimisation_begins_with_sobol_points_and_then_improves(
    problem: SearchProblem,
) -> None:
    found = method("ibo", METHODS)(problem, 200, 0)
    unit = problem.space.unit(found.theta[:32])
    assert (
        (unit < 0.5).sum(axis=0) == 16
    ).all()  # a Sobol sequence's first 32 points: half of them in each half
    critical = problem.reward.criticality(found.outcomes)
    assert critical[-100:].mean() > critical[:32].mean() + 0.2


def test_replaying_repeats_nothing_before_all_is_replayed(problem: SearchProblem) -> None:
    found = method("conscend", METHODS)(problem, 350, 0)
    first = {tuple(row) for row in found.theta[:300].tolist()}
    assert first == {tuple(row) for row in problem.real.tolist()}


@pytest.mark.parametrize(
    ("name", "least"), [("gacs", 0.2), ("no-rl", 0.0), ("cma-es", 0.0), ("rlbe", 0.0)]
)
def test_searches_end_better_than_they_begin(
    name: str, least: float, problem: SearchProblem
) -> None:
    found = method(name, METHODS)(problem, 900, 0)
    gain = found.rewards[-300:] if name != "gacs" else found.outcomes.collision[-300:]
    before = found.rewards[:100] if name != "gacs" else found.outcomes.collision[:100]
    assert gain.mean() > before.mean() + least


def test_the_tester_shortens_times_to_collision(problem: SearchProblem) -> None:
    times = np.minimum(method("rltester", METHODS)(problem, 1500, 0).outcomes.min_ttc, 10.0)
    assert times[-500:].mean() < times[:250].mean() - 0.5


def test_unknown_methods_and_missing_libraries_are_named() -> None:
    with pytest.raises(
        UsageError, match=r"no search method 'magic'; methods: cover, draws, mcsg, mcsg-published$"
    ):
        method("magic")


def test_the_exclusive_form_pays_a_collision_the_same_whatever_its_risk(
    problem: SearchProblem,
) -> None:
    rows = Kinematic()(problem.real[:4])
    found = Outcomes(
        **{**vars(rows), "collision": np.arange(4) > 1, "r_risk": np.array([0.0, 1.0, 0.0, 1.0])}
    )
    assert exclusive_reward(found).tolist() == pytest.approx([-0.1, 0.1, 0.25, 0.25])


def test_a_user_is_offered_the_default_first_and_none_of_the_studys_methods() -> None:
    names = list(offered())
    assert names[0] == "cover"
    assert set(names) == {"cover", "draws", "mcsg", "mcsg-published"}
    assert list(METHODS)[: len(names)] == names
    assert list(METHODS)[-len(ABLATIONS) :] == list(ABLATIONS)
    assert not set(names) & {"cma-es", "rlbe", *ABLATIONS}
    assert {"no-maneuver"} == TRAJECTORIES


def test_naming_the_methods_imports_no_learning() -> None:
    heavy = "numpy", "torch", "sklearn", "pymoo", "cma", "matplotlib", "libsumo"
    code = (
        f"import sys, generation.xosc_generate; print([name for name in {heavy} if name in "
        "sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
