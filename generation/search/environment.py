"""The Markov decision process of MCSG as a Gymnasium environment, for agents of other libraries."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from generation.search.methods.mcsg import Edits, single
from generation.search.problem import SearchProblem


class ScenarioEnv(gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]):
    """One episode at a time: d edits, one for each parameter, then a run of the scenario and the
    problem's reward.

    An action is one number: the share of its range, −1 … 1, that the parameter moves by.
    Observations are those of `Edits`. The last step's `info` holds `theta` and the fields of the
    outcome.

    Args:
        problem: space, evaluator and reward; episodes start from its real parameters, or from
            `options["theta"]` of `reset`.
    """

    def __init__(self, problem: SearchProblem) -> None:
        d = len(problem.space.parameters)
        self.observation_space = spaces.Box(0.0, 1.0, (2 * d,), np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (1,), np.float32)
        self._problem = problem
        self._moves = single(problem.space, problem.real)
        self._edits = Edits(problem.space, problem.real[:1], self._moves)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin with a real scenario, drawn, or the one that is given."""
        super().reset(seed=seed)
        real = self._problem.real
        # By the environment's own generator, so that `seed` decides it.
        start = (options or {}).get("theta", real[self.np_random.integers(len(real))])
        theta = self._problem.space.clip(np.asarray(start, dtype=np.float64))[None]
        self._edits = Edits(self._problem.space, theta, self._moves)
        return self._edits.observe()[0], {}

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Edit the next parameter; after the last, run the scenario."""
        self._edits.edit(np.asarray(action, dtype=np.float64).reshape(1))
        reward, info = 0.0, dict[str, Any]()
        if self._edits.done:
            theta = self._edits.theta
            outcomes = self._problem.evaluate(theta)
            reward = float(self._problem.reward(theta, outcomes)[0])
            info = {
                "theta": theta[0].copy(),
                **{name: values[0].item() for name, values in vars(outcomes).items()},
            }
        return self._edits.observe()[0], reward, self._edits.done, False, info
