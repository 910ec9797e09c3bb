"""RLTester: a deep Q-network that moves one parameter by one step at a time towards the least time
to collision.

V. Mnih et al., Human-level control through deep reinforcement learning, Nature 518, 2015.
"""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from generation.search.problem import Calls, History, SearchProblem
from recognition.trfe.training.windows import seeded
from schemas.common.array_types import FloatArray, IntArray
from studies.generation.strategies import perceptron

METHODS = {
    "rltester": {
        "title": "RLTester",
        "meaning": "deep Q-network, one step of one parameter at a time, least TTC",
        "realistic": False,
    }
}


@dataclass(frozen=True)
class DQNSettings:
    """Settings of the learning.

    Attributes:
        walkers: episodes side by side. length: steps, each a simulator call, of an episode.
        step: of a parameter, as a share of its range.
        horizon: time to collision that counts like none, s.
        discount, rate: of future rewards, and of Adam.
        exploring: share of the budget over which the share of random actions falls from 1 to
            `least`.
        updates, sample: after each step of the walkers, and transitions to an update.
        target: steps of the walkers after which the target network is renewed.
    """

    walkers: int = 25
    length: int = 10
    step: float = 0.1
    horizon: float = 10.0
    discount: float = 0.9
    rate: float = 1e-3
    exploring: float = 0.5
    least: float = 0.05
    updates: int = 20
    sample: int = 64
    target: int = 5


def rltester(
    problem: SearchProblem, budget: int, seed: int, settings: DQNSettings = DQNSettings()
) -> History:
    """Walks through the unit cube from uniform starts; the reward of a step is −min TTC of the
    scenario that it leads to."""
    calls, generator = Calls(problem, budget), np.random.default_rng(seed)
    d = len(problem.space.parameters)
    with seeded(seed):
        agent = _Agent(d, settings)
        rounds = 0
        while calls.left:
            if rounds % settings.length == 0:
                state = generator.random((settings.walkers, d))
            explored = 1.0 - (1.0 - settings.least) * min(
                (1.0 - calls.left / budget) / settings.exploring, 1.0
            )
            action = agent.act(state, explored, generator)
            moved = np.array(state)
            moved[np.arange(len(moved)), action // 2] += settings.step * (2 * (action % 2) - 1)
            moved = np.clip(moved, 0.0, 1.0)
            episodes = calls(problem.space.scaled(moved))
            n = len(episodes.theta)
            reward = -np.minimum(episodes.outcomes.min_ttc, settings.horizon) / settings.horizon
            agent.keep(state[:n], action[:n], reward, moved[:n])
            agent.learn(generator, renew=rounds % settings.target == 0)
            state, rounds = moved, rounds + 1
    return calls.history


class _Agent:
    """A Q-network over states (n, d) and the 2d steps, with its replay memory; episodes are cut
    off, they do not end."""

    def __init__(self, d: int, settings: DQNSettings) -> None:
        self._settings, self._actions = settings, 2 * d
        self._network = perceptron(d, self._actions)
        self._target = deepcopy(self._network)
        self._optimiser = torch.optim.Adam(self._network.parameters(), settings.rate)
        self._memory: list[tuple[FloatArray, IntArray, FloatArray, FloatArray]] = []

    def act(self, state: FloatArray, explored: float, generator: np.random.Generator) -> IntArray:
        """Actions (n,): 2j moves parameter j down, 2j + 1 up."""
        with torch.no_grad():
            best = self._network(torch.from_numpy(state).float()).argmax(dim=1).numpy()
        drawn = generator.integers(self._actions, size=len(state))
        return np.where(generator.random(len(state)) < explored, drawn, best)

    def keep(
        self, state: FloatArray, action: IntArray, reward: FloatArray, after: FloatArray
    ) -> None:
        """Remember transitions."""
        self._memory.append((state, action, reward, after))

    def learn(self, generator: np.random.Generator, renew: bool) -> None:
        """Update the network on remembered transitions."""
        if renew:
            self._target.load_state_dict(self._network.state_dict())
        state, action, reward, after = (
            torch.from_numpy(np.concatenate(part)) for part in zip(*self._memory, strict=True)
        )
        for _ in range(self._settings.updates):
            rows = torch.from_numpy(generator.integers(len(state), size=self._settings.sample))
            loss = self._loss(
                state[rows].float(), action[rows], reward[rows].float(), after[rows].float()
            )
            self._optimiser.zero_grad()
            loss.backward()
            self._optimiser.step()

    def _loss(self, state: Tensor, action: Tensor, reward: Tensor, after: Tensor) -> Tensor:
        with torch.no_grad():
            worth = reward + self._settings.discount * self._target(after).max(dim=1).values
        return functional.smooth_l1_loss(
            self._network(state).gather(1, action[:, None])[:, 0], worth
        )
