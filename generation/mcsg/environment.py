"""The Markov decision process of MCSG: a real scenario's parameters are edited one after the other, then the scenario is run."""

from __future__ import annotations

from typing import Any, NamedTuple

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from generation.density.base import Whitening
from generation.parameters import Space
from generation.search.problem import Problem
from xodr.array_types import FloatArray


class Moves(NamedTuple):
    """How edits move θ.

    Attributes:
        rows: (d, d), row j the move of θ in the unit cube that an edit 1 of parameter j is.
        deviation: the edits (d,) that are one standard deviation of the real parameters.
    """

    rows: FloatArray
    deviation: FloatArray


def single(space: Space, real: FloatArray) -> Moves:
    """Edits that change one parameter each, by shares of its range."""
    return Moves(np.eye(len(space.parameters)), space.unit(real).std(axis=0))


def coordinated(space: Space, real: FloatArray) -> Moves:
    """Edits in standard deviations of real parameters (n, d), which the later parameters follow.

    With LLᵀ the covariance of the real ones in the unit cube, an edit δ of parameter j adds δ times column j of L: the parameter
    moves by δ standard deviations given those before it, and those after it move as they do together in traffic.
    """
    rows = np.ascontiguousarray(Whitening.of(space.unit(real)).factor.T)
    return Moves(rows, np.ones(len(rows)))


class Edits:
    """Episodes side by side, each in the state of having its first `step` parameters edited.

    Args:
        space: the box of θ.
        theta: the points (n, d) that the episodes start from, within the box.
        moves: how an edit moves them.

    Attributes:
        theta: the points with the edits so far.
        step: number of the parameter that is edited next; d at the end.
    """

    def __init__(self, space: Space, theta: FloatArray, moves: Moves) -> None:
        self.theta, self.step = np.array(theta, dtype=np.float64), 0
        self._space, self._rows = space, moves.rows

    @property
    def done(self) -> bool:
        """Whether all parameters have been edited."""
        return self.step == self.theta.shape[1]

    def observe(self) -> NDArray[np.float32]:
        """States (n, 2d): θ in the unit cube, and 1 at the place of the parameter that is edited next, if any."""
        n, d = self.theta.shape
        turn = np.zeros((n, d))
        turn[:, self.step : self.step + 1] = 1.0
        return np.hstack([self._space.unit(self.theta), turn]).astype(np.float32)

    def edit(self, change: FloatArray) -> None:
        """Edit the next parameter by the amounts (n,); nothing leaves the box."""
        unit = self._space.unit(self.theta) + change[:, None] * self._rows[self.step]
        changed = self._rows[self.step] != 0.0
        self.theta[:, changed] = self._space.scaled(np.clip(unit, 0.0, 1.0))[:, changed]
        self.step += 1


class ScenarioEnv(gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]):
    """One episode at a time, for agents of other libraries: d edits, then a run of the scenario and the problem's reward.

    An action is one number: the share of its range, −1 … 1, that the parameter moves by. Observations are those of `Edits`.
    The last step's `info` holds `theta` and the fields of the outcome.

    Args:
        problem: space, evaluator and reward; episodes start from its real parameters, or from `options["theta"]` of `reset`.
    """

    def __init__(self, problem: Problem) -> None:
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
        start = (options or {}).get("theta", real[self.np_random.integers(len(real))])
        theta = self._problem.space.clip(np.asarray(start, dtype=np.float64))[None]
        self._edits = Edits(self._problem.space, theta, self._moves)
        return self._edits.observe()[0], {}

    def step(self, action: NDArray[np.float32]) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Edit the next parameter; after the last, run the scenario."""
        self._edits.edit(np.asarray(action, dtype=np.float64).reshape(1))
        reward, info = 0.0, dict[str, Any]()
        if self._edits.done:
            theta = self._edits.theta
            outcomes = self._problem.evaluate(theta)
            reward = float(self._problem.reward(theta, outcomes)[0])
            info = {"theta": theta[0].copy(), **{name: values[0].item() for name, values in vars(outcomes).items()}}
        return self._edits.observe()[0], reward, self._edits.done, False, info
