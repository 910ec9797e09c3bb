"""TD3 learns what is worth most."""

from __future__ import annotations

import numpy as np

from recognition.trfe.training.windows import seeded
from studies.generation.adversary.td3 import TD3, TD3Settings


def taught(seed: int) -> np.ndarray:
    """Actions of a policy that is paid for the action −seen / 2, and then it is over."""
    generator = np.random.default_rng(seed)
    seen, done = generator.uniform(-1.0, 1.0, (2000, 1)), generator.uniform(-1.0, 1.0, (2000, 1))
    reward = -np.square(done + 0.5 * seen)[:, 0]
    with seeded(seed):
        policy = TD3(1, 1, generator, TD3Settings(hidden=16, rate=5e-3, batch=128))
        policy.remember((seen, done, reward, seen, np.ones(2000)))
        policy.learn(300)
        return policy.best(np.linspace(-1.0, 1.0, 9)[:, None])[:, 0]


def test_the_best_action_is_learnt() -> None:
    np.testing.assert_allclose(taught(0), -0.5 * np.linspace(-1.0, 1.0, 9), atol=0.15)


def test_a_seed_decides_all() -> None:
    np.testing.assert_array_equal(taught(3), taught(3))


def test_explored_actions_stay_in_range() -> None:
    policy = TD3(2, 2, np.random.default_rng(0), TD3Settings(noise=3.0))
    assert np.abs(policy(np.zeros((50, 2)))).max() == 1.0


def test_memory_forgets_the_oldest() -> None:
    policy = TD3(1, 1, np.random.default_rng(0), TD3Settings(remembered=5))
    for value in range(3):
        policy.remember(
            tuple(
                np.full((3, 1) if number < 2 or number == 3 else 3, float(value))
                for number in range(5)
            )
        )
    assert policy._memory[2].tolist() == [1.0, 1.0, 2.0, 2.0, 2.0]
