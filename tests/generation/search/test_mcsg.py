"""MCSG and its environment: what an edit does, what is learnt, and that a search
is the same however it is run.
"""

from __future__ import annotations

import tracemalloc
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from gymnasium.utils.env_checker import check_env
from hypothesis import given
from hypothesis import strategies as st

from generation.search.environment import ScenarioEnv
from generation.search.methods.mcsg import (
    Bins,
    Edits,
    McsgSettings,
    Policy,
    coordinated,
    mcsg,
    single,
)
from generation.search.outcomes import Outcomes
from generation.search.problem import (
    Calls,
    History,
    Memory,
    Realism,
    Reward,
    SearchProblem,
    additive,
)
from generation.space.density.models.mixtures import Gaussian
from generation.space.space import Space
from recognition.labels.maneuvers.parameters import Parameter
from schemas.common.array_types import FloatArray
from schemas.common.errors import InvalidFile, UsageError
from schemas.common.storage import Records
from tests.generation.kinematic import SPACE, Kinematic, driven


def outcomes(collision: list[bool], r_risk: list[float]) -> Outcomes:
    n = len(collision)
    return Outcomes.of(n, collision=collision, r_risk=r_risk)


def test_a_collision_counts_on_top_of_risk() -> None:
    found = outcomes([False, False, True, True], [0.0, 1.0, 0.0, 1.0])
    assert additive(found).tolist() == pytest.approx([-0.1, 0.1, 0.15, 0.35])


def test_realism_costs_nothing_where_traffic_is_and_all_of_its_weight_far_away(
    realism: Realism,
) -> None:
    likely, odd = driven(50, seed=7), np.tile([80.0, 40.0, 0.0, 10.0, 1.0, 40.0, 10.0], (3, 1))
    assert np.mean(realism.penalty(likely) == 0.0) > 0.9
    assert realism.penalty(odd).tolist() == [1.0] * 3
    assert (realism.excess(odd) > 1.0).all()
    for rows in (odd, driven(200, seed=3)):
        log_density, plausible = realism.judged(rows)
        assert np.array_equal(log_density, realism.density.log_density(rows))
        assert np.array_equal(plausible, realism.excess(rows) == 0.0)
    assert 0.9 < plausible.mean() < 1.0
    nothing = outcomes([False] * 3, [0.0] * 3)
    assert Reward(realism, 0.2)(odd, nothing).tolist() == pytest.approx([-0.3] * 3)
    assert Reward(realism, 0.0)(odd, nothing).tolist() == pytest.approx([-0.1] * 3)
    with pytest.raises(UsageError, match="no scale"):
        Realism.of(realism.density, np.zeros(9))


def test_the_environment_passes_gymnasiums_checker(problem: SearchProblem) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env := ScenarioEnv(problem), skip_render_check=True)
    assert (
        env.reset(seed=1)[0] in env.observation_space
        and env.action_space.sample() in env.action_space
    )


def test_an_episode_is_an_edit_of_each_parameter_and_one_call(problem: SearchProblem) -> None:
    env = ScenarioEnv(problem)
    start = problem.real[3]
    observation, _ = env.reset(options={"theta": start})
    assert np.allclose(observation, [*SPACE.unit(start), 1, 0, 0, 0, 0, 0, 0])
    rewards = [env.step(np.array([0.1], np.float32)) for _ in range(7)]
    assert [ended for _, _, ended, _, _ in rewards] == [False] * 6 + [True]
    assert [reward for _, reward, _, _, _ in rewards[:6]] == [0.0] * 6
    info = rewards[-1][4]
    assert np.allclose(info["theta"], SPACE.clip(start + 0.1 * (SPACE.high - SPACE.low)))
    assert isinstance(problem.evaluate, Kinematic)
    assert problem.evaluate.calls == 1
    assert rewards[-1][1] == pytest.approx(
        float(problem.reward(info["theta"][None], problem.evaluate(info["theta"][None]))[0])
    )


@given(st.integers(0, 100), st.floats(-3.0, 3.0), st.integers(0, 6), st.booleans())
def test_edits_stay_in_the_box_and_leave_earlier_parameters_alone(
    seed: int, change: float, at: int, together: bool
) -> None:
    start = driven(4, seed)
    edits = Edits(
        SPACE, start, coordinated(SPACE, driven(200)) if together else single(SPACE, driven(200))
    )
    for step in range(7):
        edits.edit(np.full(4, change if step == at else 0.0))
    assert edits.done
    assert (edits.theta >= SPACE.low - 1e-9).all() and (edits.theta <= SPACE.high + 1e-9).all()
    assert np.allclose(edits.theta[:, :at], start[:, :at])


def test_coordinated_edits_of_noise_spread_like_real_parameters() -> None:
    real = 0.2 * (driven(3000) - driven(3000).mean(axis=0)) + 0.5 * (SPACE.low + SPACE.high)
    edits = Edits(
        SPACE, np.tile(0.5 * (SPACE.low + SPACE.high), (3000, 1)), coordinated(SPACE, real)
    )
    generator = np.random.default_rng(0)
    while not edits.done:
        edits.edit(generator.standard_normal(3000))
    assert np.allclose(np.corrcoef(edits.theta.T), np.corrcoef(real.T), atol=0.08)
    assert np.allclose(edits.theta.std(axis=0), real.std(axis=0), rtol=0.08)


def test_new_bins_are_weighed_as_the_old_ones_they_lie_in() -> None:
    torch.manual_seed(0)
    edge = torch.tensor([1.0, 2.0])
    policy = Policy(Bins(-edge, edge, 5), edge / 3).eval()
    with torch.no_grad():
        policy.weight += torch.randn_like(policy.weight)
        before = policy(1, torch.rand(3, 4), None)[0]
        torch.manual_seed(0)
        policy.rebin(Bins(-edge, edge, 10))
        observation = torch.rand(3, 4)
        after = policy(1, observation, None)[0]
        policy.rebin(Bins(-edge, edge, 5))
        assert torch.allclose(after[:, ::2], policy(1, observation, None)[0])
    assert before.shape == (3, 5)
    assert policy.bins.holding(1, torch.tensor([-9.0, -1.9, 0.0, 1.9, 9.0])).tolist() == [
        0,
        0,
        2,
        4,
        4,
    ]


@pytest.mark.slow
def test_mcsg_finds_plausible_collisions_where_traffic_has_hardly_any(
    problem: SearchProblem,
) -> None:
    found = mcsg(problem, 1500, 2)
    last = slice(-500, None)
    drawn = Kinematic()(driven(2000, seed=5)).collision.mean()
    assert drawn < 0.01
    assert found.outcomes.collision[last].mean() > 0.5
    assert found.rewards[last].mean() > found.rewards[:500].mean() + 0.1
    assert problem.reward.realism.penalty(found.theta[last]).mean() < 0.7


@pytest.mark.parametrize("budget", [1, 49, 160])
def test_the_budget_is_spent_exactly_and_a_seed_decides_everything(
    problem: SearchProblem, budget: int
) -> None:
    one, two = mcsg(problem, budget, 3), mcsg(problem, budget, 3)
    assert len(one.theta) == len(one.rewards) == len(one.outcomes) == budget
    assert np.array_equal(one.theta, two.theta)
    assert budget == 1 or not np.array_equal(one.theta, mcsg(problem, budget, 4).theta)


@pytest.mark.parametrize("d", [1, 2, 9])
def test_any_number_of_parameters_can_be_searched(d: int) -> None:
    space = Space(tuple(Parameter(f"Other_P{number}", 0.0, 10.0) for number in range(d)))
    real = space.draw(60, np.random.default_rng(0))

    def evaluate(theta: FloatArray) -> Outcomes:
        near = np.abs(theta - 7.0).max(axis=1)
        return outcomes((near < 1.0).tolist(), np.clip(1.0 - near / 10.0, 0.0, 1.0).tolist())

    density = Gaussian().fit(real)
    reward = Reward(Realism.of(density, density.log_density(real)))
    found = mcsg(SearchProblem(space, evaluate, reward, real), 300, 0, McsgSettings(batch=20))
    assert found.theta.shape == (300, d)
    assert found.rewards[-100:].mean() > found.rewards[:100].mean()


def test_an_interrupted_search_goes_on_to_the_same_end(
    problem: SearchProblem, tmp_path: Path
) -> None:
    whole = mcsg(problem, 240, 1)

    class Interrupted(Kinematic):
        def __call__(self, theta: FloatArray) -> Outcomes:
            if self.calls >= 100:
                raise KeyboardInterrupt
            return super().__call__(theta)

    with pytest.raises(KeyboardInterrupt):
        mcsg(replace(problem, evaluate=Memory(Interrupted(), tmp_path / "calls.jsonl")), 240, 1)
    with (tmp_path / "calls.jsonl").open("a") as file:
        file.write('{"theta": [1.0, 2')  # the line that was being written
    fresh = Kinematic()
    resumed = mcsg(replace(problem, evaluate=Memory(fresh, tmp_path / "calls.jsonl")), 240, 1)
    assert np.array_equal(resumed.theta, whole.theta)
    assert np.array_equal(resumed.rewards, whole.rewards)
    assert np.array_equal(resumed.outcomes.min_ttc, whole.outcomes.min_ttc)
    assert fresh.calls == 240 - 130  # three batches, of 50, 30 and 50, were remembered


def test_a_search_with_another_budget_or_seed_reuses_what_is_the_same(
    problem: SearchProblem, tmp_path: Path
) -> None:
    path, simulator = tmp_path / "calls.jsonl", Kinematic()
    mcsg(replace(problem, evaluate=Memory(simulator, path)), 20, 1)
    memory = Memory(simulator, path)
    again = memory(problem.real[:5])
    assert (memory.reused, simulator.calls) == (0, 25)
    np.testing.assert_array_equal(memory(problem.real[:5]).collision, again.collision)
    assert (memory.reused, simulator.calls) == (5, 25)
    theta, outcomes = Memory(simulator, path).everything
    assert len(theta) == len(outcomes) == 25
    np.testing.assert_array_equal(theta[-5:], problem.real[:5])


@pytest.mark.slow
def test_memory_answers_known_and_new_points_in_their_order_in_little_space(
    problem: SearchProblem, tmp_path: Path
) -> None:
    def nothing(theta: FloatArray) -> Outcomes:
        return Outcomes.of(len(theta), min_ttc=theta[:, 0])

    memory, theta = (
        Memory(nothing, tmp_path / "calls.jsonl"),
        problem.space.draw(6000, np.random.default_rng(0)),
    )
    memory(theta[:100])
    mixed = np.concatenate([theta[50:150], theta[:20], theta[149:150]])
    np.testing.assert_array_equal(memory(mixed).min_ttc, mixed[:, 0])
    assert memory.reused == 71 and len(memory.everything[0]) == 150
    tracemalloc.start()
    for start in range(150, 6000, 50):
        memory(theta[start : start + 50])
    taken = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert taken / 5850 < 800.0, "bytes a run"


@pytest.mark.parametrize("harm", ["edited", "removed", "cut", "appended"])
def test_damaged_answers_are_asked_again(problem: SearchProblem, tmp_path: Path, harm: str) -> None:
    path, simulator = tmp_path / "calls.jsonl", Kinematic()
    asked = problem.real[:5]
    first = Memory(simulator, path)(asked)
    lines = path.read_bytes().splitlines(keepends=True)
    if harm == "edited":
        assert b'"status": "completed"' in lines[2]
        lines[2] = lines[2].replace(b'"status": "completed"', b'"status": "error"')
    elif harm == "removed":
        del lines[2]
    elif harm == "cut":
        lines[-1] = lines[-1][:40]
    else:
        lines.append(b"[]\n")
    path.write_bytes(b"".join(lines))
    memory = Memory(simulator, path)
    again = memory(asked)
    assert (memory.damaged, memory.reused) == (int(harm != "removed"), 4 + (harm == "appended"))
    assert simulator.calls == 10 - memory.reused
    np.testing.assert_array_equal(again.min_ttc, first.min_ttc)
    np.testing.assert_array_equal(again.status, first.status)
    assert Memory(simulator, path).damaged == 0


def test_memory_refuses_what_is_not_its_own(tmp_path: Path) -> None:
    path = tmp_path / "calls.jsonl"
    Records(path).add([{"name": "a run of a batch"}])
    with pytest.raises(InvalidFile, match="no simulator call"):
        Memory(Kinematic(), path)


def test_histories_are_read_as_they_were_written(problem: SearchProblem, tmp_path: Path) -> None:
    found = mcsg(problem, 30, 0)
    found.save(tmp_path / "history.npz")
    again = History.load(tmp_path / "history.npz")
    assert np.array_equal(again.theta, found.theta)
    assert np.array_equal(again.rewards, found.rewards)
    assert vars(again.outcomes).keys() == vars(found.outcomes).keys()
    (tmp_path / "history.npz").write_bytes(b"PK\x03\x04")
    with pytest.raises(InvalidFile, match="no search's history"):
        History.load(tmp_path / "history.npz")


def test_calls_keep_to_the_box_and_the_budget(problem: SearchProblem) -> None:
    calls = Calls(problem, 5)
    first = calls(np.full((3, 7), 1e9))
    assert np.allclose(first.theta, SPACE.high)
    assert len(calls(np.zeros((9, 7))).theta) == 2
    assert calls.left == 0
    assert len(calls.history.theta) == 5
