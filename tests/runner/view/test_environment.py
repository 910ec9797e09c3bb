"""The ego as an environment: what is seen, what is done, what it is worth, and
that learners learn in it.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from runner.systems.outside.learner import EGO, PARTICIPANT, STATE, DrivingReward, EgoStep
from runner.view.gym import ENVIRONMENT, register
from runner.view.gym.environment import ACTIONS, EgoEnv
from schemas.common.errors import InvalidFile, UsageError
from tests.runner.files import distribution, place, scenario, speed_action, story
from xosc.listing import LIBRARY

LEAD_BRAKE = LIBRARY / "highway_lead_brake.xosc"


def named(values: np.ndarray, columns: tuple[str, ...]) -> dict[str, float]:
    return dict(zip(columns, values.tolist(), strict=True))


@pytest.mark.filterwarnings("ignore:.*observation space m")
@pytest.mark.parametrize("actions", ACTIONS)
@pytest.mark.parametrize("world", ["kinematic", "sumo"])
def test_gymnasium_finds_no_fault(tmp_path: Path, world: str, actions: str) -> None:
    env = EgoEnv(scenario(tmp_path, stop=1.0), world=world, actions=actions)
    check_env(env, skip_render_check=True)
    assert env.reset(seed=1)[0] in env.observation_space
    env.close()


@pytest.mark.parametrize(("lane", "away"), [(-1, 1.0), (1, -1.0)])
def test_participants_are_in_lane_coordinates_of_the_ego(
    tmp_path: Path, lane: int, away: float
) -> None:
    """Whichever way the ego faces, what is ahead and to the left of it is positive."""
    s = 300.0
    init = place("Ego", s, 20, lane) + place("Lead", s + away * 40.0, 12, 2 * lane)
    env = EgoEnv(scenario(tmp_path, init=init, stop=1.0), world="kinematic", participants=2)
    seen, _ = env.reset(seed=0)
    other = named(seen["participants"][0], PARTICIPANT)
    assert (other["present"], other["ahead"], other["lanes"]) == (1.0, pytest.approx(40.0), -1.0)
    assert other["left"] < -2.0
    assert (other["speed"], other["closing"], other["heading"]) == pytest.approx((12.0, 8.0, 0.0))
    assert not seen["participants"][1].any()
    ego = named(seen["ego"], EGO)
    assert (ego["speed"], ego["target_speed"], ego["offset"], ego["heading"]) == pytest.approx(
        (20.0, 20.0, 0.0, 0.0)
    )
    assert ego["left_edge"] > ego["right_edge"] > 0.0
    assert math.cos(named(seen["state"][0], STATE)["h"]) == pytest.approx(away)
    assert not seen["state"][2].any()


def test_who_faces_the_ego_comes_nearer(tmp_path: Path) -> None:
    init = place("Ego", 100, 20, -1) + place("Lead", 160, 10, 1)
    env = EgoEnv(scenario(tmp_path, init=init, stop=1.0), world="kinematic")
    other = named(env.reset(seed=0)[0]["participants"][0], PARTICIPANT)
    assert (other["speed"], other["closing"], abs(other["heading"])) == pytest.approx(
        (-10.0, 30.0, math.pi)
    )
    assert other["left"] > 2.0 and other["ahead"] == pytest.approx(60.0)


def test_actions_are_shares_of_what_the_ego_can_do(tmp_path: Path) -> None:
    file = scenario(tmp_path, stop=2.0)

    def after(actions: str, *action: float) -> dict[str, float]:
        env = EgoEnv(file, world="kinematic", actions=actions)
        env.reset(seed=0)
        for _ in range(10):
            seen, *_ = env.step(np.array(action, np.float32))
        return named(seen["ego"], EGO)

    assert after("acceleration", -1.0)["speed"] == pytest.approx(20.0 - 8.0 * 0.5)
    assert after("acceleration", 0.5)["speed"] == pytest.approx(20.0 + 4.0 * 0.5)
    assert after("acceleration_and_steering", 0.0, 0.02)["offset"] > 0.1
    assert 19.9 < after("target_speed", -0.2)["speed"] <= 20.0
    assert after("target_speed", 1.0)["speed"] > 24.0


def test_an_episode_that_tested_nothing_says_so_at_its_end(tmp_path: Path) -> None:
    late = story("Lead", [(50.0, speed_action(5))])
    for name, stories, causes in (("late", late, ("no-event",)), ("bare", "", ())):
        env = EgoEnv(
            scenario(tmp_path, name, stories=stories, stop=0.2),
            world="kinematic",
            actions="acceleration",
        )
        _, info = env.reset(seed=0)
        infos = [info]
        while True:
            *_, terminated, truncated, info = env.step(np.array([0.0], np.float32))
            infos.append(info)
            if terminated or truncated:
                break
        assert [each.get("inconclusive") for each in infos] == [*[None] * (len(infos) - 1), causes]


def test_a_variation_file_of_which_constraints_leave_nothing_is_refused(tmp_path: Path) -> None:
    path = scenario(tmp_path)
    group = '<ConstraintGroup><ValueConstraint rule="lessThan" value="10"/></ConstraintGroup>'
    path.write_text(
        path.read_text().replace('value="50.0"/>', f'value="5">{group}</ParameterDeclaration>', 1)
    )
    with pytest.raises(InvalidFile, match="no parameter set satisfies the constraints"):
        EgoEnv(distribution(tmp_path, "none", {"Gap": (12, 18, 2)}))


def test_an_episode_ends_by_contact_departure_or_the_scenario(tmp_path: Path) -> None:
    file = scenario(tmp_path, stop=12.0)

    def end(actions: str, *action: float) -> tuple[bool, bool, dict[str, Any], float]:
        env = EgoEnv(file, world="kinematic", actions=actions, timestep=0.1)
        env.reset(seed=0)
        terminated = truncated = False
        while not (terminated or truncated):
            _, reward, terminated, truncated, info = env.step(np.array(action, np.float32))
        with pytest.raises(UsageError, match=r"reset\(\) begins the next"):
            env.step(np.array(action, np.float32))
        assert env.result().end_time == info["time"]
        return terminated, truncated, info, reward

    terminated, truncated, info, reward = end("acceleration", 0.2)
    assert info["inconclusive"] == ()
    assert (terminated, truncated, info["touched"], reward < -19.0) == (
        True,
        False,
        ("Lead",),
        True,
    )
    terminated, truncated, info, reward = end("acceleration_and_steering", -0.1, 0.2)
    assert (terminated, truncated, info["touched"], info["departed"], reward < -19.0) == (
        True,
        False,
        (),
        True,
        True,
    )
    terminated, truncated, info, reward = end("acceleration", -0.5)
    assert (terminated, truncated, info["touched"]) == (False, True, ())


def test_each_episode_takes_a_parameter_set_by_its_seed(tmp_path: Path) -> None:
    scenario(tmp_path)
    env = EgoEnv(distribution(tmp_path, "gaps", {"Gap": (20, 80, 10)}), world="kinematic")
    starts = [env.reset(seed=seed)[0]["participants"][0][1] for seed in (*range(12), *range(12))]
    assert len(set(starts)) > 3 and starts[:12] == starts[12:]
    assert env.reset(options={"set": 6})[0]["participants"][0][1] == pytest.approx(80.0)


def test_reward_is_what_its_formula_says(tmp_path: Path) -> None:
    env = EgoEnv(scenario(tmp_path), world="kinematic")
    env.reset()
    ego = env.result().recording  # the run has begun
    assert ego.tracks.keys() == {"Ego", "Lead"}
    seen = env._seen
    assert seen is not None
    step = EgoStep(
        seen.ego._replace(speed=10.0, acceleration=-4.0), 20.0, 0.1, collided=False, departed=False
    )
    assert DrivingReward()(step) == pytest.approx(0.1 * (0.5 - 0.5 * 0.25))
    assert DrivingReward()(step._replace(collided=True)) == pytest.approx(0.0375 - 20.0)
    assert DrivingReward(progress=0.0, effort=0.0)(step._replace(departed=True)) == -20.0
    assert DrivingReward(effort=0.0)(step._replace(target_speed=0.0)) == 0.0


def test_wrong_calls_are_refused(tmp_path: Path) -> None:
    with pytest.raises(
        UsageError, match="one of acceleration_and_steering, acceleration, target_speed"
    ):
        EgoEnv(scenario(tmp_path), actions="brake")
    env = EgoEnv(LIBRARY / "highway_lead_brake.xosc", world="kinematic")
    for call in (lambda: env.step(np.zeros(2, np.float32)), env.result):
        with pytest.raises(UsageError, match="reset"):
            call()


# learners -----------------------------------------------------------------------------------


def driven(env: EgoEnv, decide: Any) -> tuple[float, bool]:
    """Sum of rewards of an episode, and whether the ego touched somebody."""
    seen, _ = env.reset(seed=0)
    total, ended = 0.0, False
    while not ended:
        seen, reward, terminated, truncated, info = env.step(decide(seen))
        total, ended = total + reward, terminated or truncated
    return total, bool(info["touched"])


def test_the_cross_entropy_method_learns_to_brake() -> None:
    """De Boer et al., A Tutorial on the Cross-Entropy Method, 2005: a linear
    policy of gap and closing speed.
    """
    env = EgoEnv(
        LEAD_BRAKE, world="kinematic", actions="acceleration", timestep=0.2, participants=1
    )

    def policy(weights: np.ndarray) -> Any:
        def decide(seen: dict[str, np.ndarray]) -> np.ndarray:
            other = seen["participants"][0]
            return np.tanh([weights @ [1.0, other[1] / 50.0, other[5] / 10.0]])

        return decide

    rng = np.random.default_rng(0)
    mean, spread = np.array([1.0, 0.0, 0.0]), np.ones(3)
    untrained, collides = driven(env, policy(mean))
    for _ in range(8):
        population = rng.normal(mean, spread, (16, 3))
        scores = [driven(env, policy(weights))[0] for weights in population]
        best = population[np.argsort(scores)[-4:]]
        mean, spread = best.mean(axis=0), best.std(axis=0) + 0.05
    trained, still_collides = driven(env, policy(mean))
    assert (collides, still_collides) == (True, False)
    assert trained > untrained + 20.0


@pytest.mark.slow
def test_a_stock_learner_learns_to_brake() -> None:
    """PPO of Stable-Baselines3."""
    learners = pytest.importorskip("stable_baselines3")

    def env() -> EgoEnv:
        return EgoEnv(
            LEAD_BRAKE, world="kinematic", actions="acceleration", timestep=0.2, participants=1
        )

    model = learners.PPO(
        "MultiInputPolicy", env(), n_steps=128, n_epochs=4, learning_rate=1e-3, seed=0, device="cpu"
    )

    def decide(seen: dict[str, np.ndarray]) -> np.ndarray:
        return model.predict(seen, deterministic=True)[0]

    untrained, collides = driven(env(), decide)
    for _ in range(4):
        model.learn(512, reset_num_timesteps=False)
        trained, still_collides = driven(env(), decide)
        if not still_collides:
            break
    assert (collides, still_collides) == (True, False)
    assert trained > untrained + 10.0


@pytest.mark.filterwarnings("ignore:.*observation space m")
def test_gymnasium_finds_no_fault_in_what_is_made_by_name_with_pictures(tmp_path: Path) -> None:
    register()
    env = gymnasium.make(
        ENVIRONMENT,
        scenario=scenario(tmp_path, stop=0.3),
        world="kinematic",
        render_mode="rgb_array",
    )
    check_env(env.unwrapped)
    env.reset(seed=1)
    assert env.render().shape[2] == 3
    env.close()


def test_the_name_with_its_module_needs_no_import(tmp_path: Path) -> None:
    gymnasium.registry.pop(ENVIRONMENT, None)
    sys.modules.pop("xosc_toolchain.gym", None)
    gymnasium.make(
        "xosc_toolchain.gym:xosc/Scenario-v0", scenario=LEAD_BRAKE, world="kinematic"
    ).close()
    assert ENVIRONMENT in gymnasium.registry


def test_gymnasium_makes_it_by_name_and_renders_it(tmp_path: Path) -> None:
    register()
    register()  # again changes nothing
    assert ENVIRONMENT == "xosc/Scenario-v0"
    env = gymnasium.make(
        ENVIRONMENT, scenario=LEAD_BRAKE, world="kinematic", render_mode="rgb_array"
    )
    env.reset(seed=1)
    first = env.render()
    for _ in range(20):
        env.step(np.zeros(2, np.float32))
    later = env.render()
    env.close()
    assert isinstance(first, np.ndarray) and isinstance(later, np.ndarray)
    assert first.dtype == np.uint8 and first.ndim == 3 and first.shape[2] == 3
    assert first.shape == later.shape and (first != later).any()


def test_without_a_render_mode_there_are_no_pictures_and_an_unknown_one_is_refused(
    tmp_path: Path,
) -> None:
    env = EgoEnv(LEAD_BRAKE, world="kinematic")
    env.reset(seed=1)
    assert env.render() is None
    env.close()
    with pytest.raises(UsageError, match="'human' is not one of rgb_array"):
        EgoEnv(LEAD_BRAKE, render_mode="human")


def test_the_entry_point_names_the_registration() -> None:
    import tomllib
    from importlib import import_module

    project = tomllib.loads((Path(__file__).parents[3] / "pyproject.toml").read_text())["project"]
    module, _, function = project["entry-points"]["gymnasium.envs"]["__root__"].partition(":")
    assert callable(getattr(import_module(module), function))
