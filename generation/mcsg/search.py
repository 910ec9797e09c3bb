"""MCSG: reinforcement learning of edits that make real scenarios critical and leave them plausible, from coarse to fine."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor

from generation.mcsg.edits import Edits, Moves, coordinated
from generation.mcsg.policy import Bins, Policy, State
from generation.mcsg.settings import McsgSettings
from generation.mcsg.starts import EliteStarts, Starts
from generation.search.problem import Calls, History, Problem
from generation.search.space import Space
from recognition.training.seeding import seeded
from xodr.array_types import FloatArray

_NARROWEST = 0.02
"""Least range of edits in the second stage, as a share of that in the first."""
_TOP, _SPAN = 0.1, (0.05, 0.95)
"""The second stage's ranges are these quantiles of the edits in the best tenth of the first."""


def search(
    problem: Problem,
    budget: int,
    seed: int,
    settings: McsgSettings = McsgSettings(),  # noqa: B008 - frozen
    edits: Callable[[Space, FloatArray], Moves] = coordinated,
    starts: Callable[[Problem, McsgSettings], Starts] = EliteStarts,
) -> History:
    """Spend the budget in three equal stages: coarse bins, fine bins around the best edits, and these with Gaussian noise.

    The state is carried on: once there are as many episodes as in a batch, the next ones start from the elite of all, so that
    critical scenarios are edited further instead of being found anew.

    Args:
        problem: what is searched.
        budget: simulator calls.
        seed: of everything random.
        settings: how the policy learns.
        edits: gives the edits of a space, given real parameters (n, d).
        starts: gives what episodes start from.
    """
    with seeded(seed):
        learner = _Learner(problem, budget, seed, settings, edits(problem.space, problem.real), starts(problem, settings))
        for stage in range(3):
            if stage == 1 and learner.edits:
                learner.refine()
            learner.spend(budget * (stage + 1) // 3, noise=stage == 2)
    return learner.calls.history


class _Learner:
    """A search under way."""

    def __init__(self, problem: Problem, budget: int, seed: int, settings: McsgSettings, moves: Moves, starts: Starts) -> None:
        self.calls = Calls(problem, budget)
        self._problem, self._budget, self._settings = problem, budget, settings
        self._generator = np.random.default_rng(seed)
        self._moves, self._starts, self._baseline = moves, starts, _Baseline(settings.momentum)
        self.edits: list[FloatArray] = []
        reach = torch.from_numpy(settings.reach * moves.deviation).float()
        self._policy = Policy(Bins(-reach, reach, settings.bins[0]), torch.from_numpy(settings.spread * moves.deviation).float())
        self._optimiser = torch.optim.Adam(self._policy.parameters(), settings.rate)

    def spend(self, until: int, noise: bool) -> None:
        """Learn in batches until so many calls are spent."""
        while (spent := self._budget - self.calls.left) < until:
            n = min(self._settings.batch, until - spent)
            edits = Edits(self._problem.space, self._starts.draw(n, spent / self._budget, self._generator), self._moves)
            log_probability, changes = rollout(self._policy, edits, noise)
            episodes = self.calls(edits.theta)
            self.edits.append(changes)
            self._starts.add(episodes)
            self._learn(log_probability, episodes.rewards)

    def refine(self) -> None:
        """Go from the coarse bins to finer ones where the best episodes' edits were."""
        edits, rewards = np.concatenate(self.edits), self.calls.history.rewards
        best = np.argsort(-rewards, kind="stable")[: max(int(_TOP * len(rewards)), 1)]
        low, high = (torch.from_numpy(edge).float() for edge in np.quantile(edits[best], _SPAN, axis=0))
        old = self._policy.bins
        missing = (_NARROWEST * (old.high - old.low) - (high - low)).clamp(min=0.0) / 2
        self._policy.rebin(Bins(low - missing, high + missing, self._settings.bins[1]))
        self._optimiser = torch.optim.Adam(self._policy.parameters(), self._settings.rate)

    def _learn(self, log_probability: Tensor, rewards: FloatArray) -> None:
        """One step of REINFORCE (R. J. Williams, Machine Learning 8, 1992) with standardised advantages."""
        advantage = torch.from_numpy(self._baseline.advantage(rewards)).float()
        loss = -(advantage * log_probability).mean()
        self._optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self._policy.parameters(), self._settings.clip)
        self._optimiser.step()


def rollout(policy: Policy, edits: Edits, noise: bool) -> tuple[Tensor, FloatArray]:
    """Edit all parameters, each by a bin that the policy draws.

    Args:
        noise: whether an edit is normal around the bin's centre, half a bin its standard deviation, or uniform in the bin.

    Returns:
        log-probability (n,) of the bins, and the edits (n, d).
    """
    state: State | None = None
    total, changes = torch.zeros(len(edits.theta)), []
    while not edits.done:
        step, bins = edits.step, policy.bins
        logits, state = policy(step, torch.from_numpy(edits.observe()), state)
        choice = torch.distributions.Categorical(logits=logits)
        chosen = choice.sample()
        within = 0.5 * torch.randn(len(chosen)) if noise else torch.rand(len(chosen)) - 0.5
        change = (bins.centres(step)[chosen] + bins.width[step] * within).double().numpy()
        edits.edit(change)
        changes.append(change)
        total = total + choice.log_prob(chosen)
    return total, np.stack(changes, axis=1)


class _Baseline:
    """Exponential moving average of the batches' mean rewards."""

    def __init__(self, momentum: float) -> None:
        self._momentum, self._mean = momentum, np.nan

    def advantage(self, rewards: FloatArray) -> FloatArray:
        """Rewards (n,) above the average of those before, in units of their deviation from it; the average moves on."""
        mean = float(rewards.mean())
        before = mean if np.isnan(self._mean) else self._mean
        self._mean = self._momentum * before + (1.0 - self._momentum) * mean
        above = rewards - before
        return above / (above.std() + 1e-3)
