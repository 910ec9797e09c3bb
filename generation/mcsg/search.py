"""MCSG: reinforcement learning of edits that make real scenarios critical and leave them plausible, from coarse to fine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from generation.mcsg.environment import Edits, coordinated, single
from generation.mcsg.policy import Bins, Policy, State
from generation.outcomes.cases import Choice, diverse
from generation.search.problem import Calls, Episodes, History, Problem
from generation.search.reward import criticality
from recognition.training.seeding import seeded
from recognition.trfe.samples import Floats

_NARROWEST = 0.02
"""Least range of edits in the second stage, as a share of that in the first."""
_TOP, _SPAN = 0.1, (0.05, 0.95)
"""The second stage's ranges are these quantiles of the edits in the best tenth of the first."""


@dataclass(frozen=True)
class Settings:
    """How MCSG learns; METHOD §3 where nothing else is said.

    Attributes:
        batch: episodes to each step of REINFORCE.
        rate, clip: of Adam, and the norm that gradients are cut to.
        momentum: of the moving average of rewards that is the baseline.
        bins: of each parameter's edits, in the first stage and after it.
        coordinated: whether edits are those of `generation.mcsg.environment.coordinated`, or change single parameters.
        reach: greatest edit of the first stage, in standard deviations of the real parameters.
        spread: standard deviation of the untrained policy's edits, the same way.
        elite: share of all episodes so far that the next ones start from; 0 has all start from real scenarios.
        apart: least distance of two of the elite in the unit cube, root mean square over the parameters.
    """

    batch: int = 50
    rate: float = 1e-2
    clip: float = 1.0
    momentum: float = 0.9
    bins: tuple[int, int] = (5, 10)
    coordinated: bool = True
    reach: float = 3.0
    spread: float = 1.0
    elite: float = 0.05
    apart: float = 0.05


def search(problem: Problem, budget: int, seed: int, settings: Settings = Settings()) -> History:
    """Spend the budget in three equal stages: coarse bins, fine bins around the best edits, and these with Gaussian noise.

    The state is carried on: once there are as many episodes as in a batch, the next ones start from the elite of all, so that
    critical scenarios are edited further instead of being found anew (`Settings.elite`).
    """
    with seeded(seed):
        learner = _Learner(problem, budget, seed, settings)
        for stage in range(3):
            if stage == 1 and learner.edits:
                learner.refine()
            learner.spend(budget * (stage + 1) // 3, noise=stage == 2)
    return learner.calls.history


class _Learner:
    """A search under way."""

    def __init__(self, problem: Problem, budget: int, seed: int, settings: Settings) -> None:
        self.calls = Calls(problem, budget)
        self._problem, self._budget, self._settings = problem, budget, settings
        self._generator = np.random.default_rng(seed)
        self._moves, deviation = _moves(problem, settings.coordinated)
        self._starts, self._baseline = _Starts(problem, settings), _Baseline(settings.momentum)
        self.edits: list[Floats] = []
        reach = torch.from_numpy(settings.reach * deviation).float()
        self._policy = Policy(Bins(-reach, reach, settings.bins[0]), torch.from_numpy(settings.spread * deviation).float())
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

    def _learn(self, log_probability: Tensor, rewards: Floats) -> None:
        """One step of REINFORCE (R. J. Williams, Machine Learning 8, 1992) with standardised advantages."""
        advantage = torch.from_numpy(self._baseline.advantage(rewards)).float()
        loss = -(advantage * log_probability).mean()
        self._optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self._policy.parameters(), self._settings.clip)
        self._optimiser.step()


def rollout(policy: Policy, edits: Edits, noise: bool) -> tuple[Tensor, Floats]:
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

    def advantage(self, rewards: Floats) -> Floats:
        """Rewards (n,) above the average of those before, in units of their deviation from it; the average moves on."""
        mean = float(rewards.mean())
        before = mean if np.isnan(self._mean) else self._mean
        self._mean = self._momentum * before + (1.0 - self._momentum) * mean
        above = rewards - before
        return above / (above.std() + 1e-3)


class _Starts:
    """What episodes start from: real scenarios (or what was found before) at first, then the elite of all episodes so far.

    The elite is chosen by criticality − w·t·max((NLL − Q99)/IQR, 0), t the share of the budget that is spent. The reward's
    realism term is the same far from traffic as a little outside; this one goes on falling, so that what is critical is drawn
    back to where traffic is, and it grows with time, so that it is critical first.
    """

    def __init__(self, problem: Problem, settings: Settings) -> None:
        self._problem, self._settings = problem, settings
        self._theta, self._critical, self._excess = np.empty((0, len(problem.space.parameters))), np.empty(0), np.empty(0)

    def add(self, episodes: Episodes) -> None:
        """Take note of episodes."""
        reward = self._problem.reward
        self._theta = np.concatenate([self._theta, episodes.theta])
        self._critical = np.concatenate([self._critical, criticality(episodes.outcomes, reward.form)])
        self._excess = np.concatenate([self._excess, reward.realism.excess(episodes.theta)])

    def draw(self, n: int, spent: float, generator: np.random.Generator) -> Floats:
        """Starts (n, d), when that share of the budget is spent."""
        if not self._settings.elite or len(self._theta) < self._settings.batch:
            starts = self._problem.starts
            return starts[generator.integers(len(starts), size=n)]
        score = self._critical - self._problem.reward.weight * spent * self._excess
        count = max(int(self._settings.elite * len(score)), self._settings.batch // 2)
        ranked = self._theta[np.argsort(-score, kind="stable")]
        elite = ranked[diverse(self._problem.space.unit(ranked), Choice(count, self._settings.apart))]
        return elite[generator.integers(len(elite), size=n)]


def _moves(problem: Problem, together: bool) -> tuple[Floats, Floats]:
    """Moves (d, d) of edits, and the edits (d,) that are one standard deviation of the real parameters."""
    if together:
        return coordinated(problem.space, problem.real), np.ones(len(problem.space.parameters))
    return single(len(problem.space.parameters)), problem.space.unit(problem.real).std(axis=0)
