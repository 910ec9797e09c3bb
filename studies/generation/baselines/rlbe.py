"""RLBE: proximal policy optimisation of edits to real scenarios, for risk and plausibility.

J. Schulman et al., Proximal policy optimization algorithms, 2017.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor, nn
from torch.distributions import Normal

from generation.search.methods.mcsg import Edits, single
from generation.search.problem import Calls, History, SearchProblem
from recognition.trfe.training.windows import seeded
from studies.generation.strategies import perceptron

METHODS = {
    "rlbe": {
        "title": "RLBE",
        "meaning": "proximal policy optimisation of edits, risk and plausibility",
        "realistic": True,
    }
}


@dataclass(frozen=True)
class PPOSettings:
    """Settings of the learning.

    Attributes:
        batch: episodes to an update.
        epochs, rate, clip: passes over a batch, of Adam, and how far probabilities may move.
        spread: standard deviation of the first edits, as a share of the ranges.
        entropy: weight of the edits' entropy.
    """

    batch: int = 50
    epochs: int = 10
    rate: float = 3e-3
    clip: float = 0.2
    spread: float = 0.15
    entropy: float = 1e-3


class _Steps(NamedTuple):
    """Steps of a batch, all flat: states (n, 2d), edits, their
    log-probabilities, and returns (n,).
    """

    states: Tensor
    edits: Tensor
    log_probabilities: Tensor
    returns: Tensor


def rlbe(
    problem: SearchProblem, budget: int, seed: int, settings: PPOSettings = PPOSettings()
) -> History:
    """Gaussian edits of one parameter after the other, rewarded at the end by
    the problem's reward.
    """
    calls, generator = Calls(problem, budget), np.random.default_rng(seed)
    with seeded(seed):
        agent = _ActorCritic(len(problem.space.parameters), settings.spread)
        optimiser = torch.optim.Adam(agent.parameters(), settings.rate)
        edits = single(problem.space, problem.real)
        while calls.left:
            n = min(settings.batch, calls.left)
            start = problem.real[generator.integers(len(problem.real), size=n)]
            steps = _play(agent, Edits(problem.space, start, edits), calls)
            for _ in range(settings.epochs):
                optimiser.zero_grad()
                agent.loss(steps, settings).backward()
                nn.utils.clip_grad_norm_(agent.parameters(), 0.5)
                optimiser.step()
    return calls.history


def _play(agent: _ActorCritic, edits: Edits, calls: Calls) -> _Steps:
    """One episode of each row; the return of all its steps is the reward at its end."""
    states, chosen, log_probabilities = [], [], []
    with torch.no_grad():
        while not edits.done:
            states.append(torch.from_numpy(edits.observe()))
            choice = agent.edits(states[-1])
            chosen.append(choice.sample())
            log_probabilities.append(choice.log_prob(chosen[-1]))
            edits.edit(chosen[-1].double().numpy())
    rewards = torch.from_numpy(calls(edits.theta).rewards).float()
    return _Steps(
        torch.cat(states),
        torch.cat(chosen),
        torch.cat(log_probabilities),
        rewards.repeat(len(states)),
    )


class _ActorCritic(nn.Module):
    """The mean of the next edit, one spread for each parameter, and the return to expect."""

    def __init__(self, d: int, spread: float) -> None:
        super().__init__()
        self.mean, self.value = perceptron(2 * d, 1), perceptron(2 * d, 1)
        self.log_spread = nn.Parameter(torch.full((d,), float(np.log(spread))))
        last = self.mean[-1]
        for parameter in last.parameters():
            nn.init.zeros_(parameter)

    def edits(self, states: Tensor) -> Normal:
        """Distribution (n,) of the next edit in states (n, 2d)."""
        spread = states[:, states.shape[1] // 2 :] @ self.log_spread.exp()
        return Normal(self.mean(states)[:, 0], spread)

    def loss(self, steps: _Steps, settings: PPOSettings) -> Tensor:
        """The clipped surrogate, the squared error of the value, and the entropy."""
        choice, value = self.edits(steps.states), self.value(steps.states)[:, 0]
        advantage = (steps.returns - value).detach()
        advantage = advantage / (advantage.std(unbiased=False) + 1e-6)
        ratio = (choice.log_prob(steps.edits) - steps.log_probabilities).exp()
        clipped = ratio.clamp(1.0 - settings.clip, 1.0 + settings.clip)
        surrogate = torch.minimum(ratio * advantage, clipped * advantage).mean()
        return (
            (value - steps.returns).square().mean()
            - surrogate
            - settings.entropy * choice.entropy().mean()
        )
