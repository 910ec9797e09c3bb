"""What MCSG learns with: the policy, its edits so far, and REINFORCE."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from generation.mcsg.edits import Edits, Moves
from generation.mcsg.policy import Bins, Policy, State
from generation.mcsg.settings import McsgSettings
from generation.search.space import Space
from xodr.array_types import FloatArray

_NARROWEST = 0.02
"""Least range of edits in the second stage, as a share of that in the first."""
_TOP = 0.1
"""Share of the best episodes whose edits set the second stage's ranges"""


class Learner:
    """Proposes edited scenarios and learns from the rewards of the last ones; asked and answered in turns.

    Args:
        space: the box of θ.
        moves: how edits move θ.
        settings: how it learns.
    """

    def __init__(self, space: Space, moves: Moves, settings: McsgSettings) -> None:
        self._space, self._moves, self._settings = space, moves, settings
        self._baseline = _Baseline(settings.momentum)
        self._edits, self._rewards = list[FloatArray](), list[FloatArray]()
        reach = torch.from_numpy(settings.reach * moves.deviation).float()
        self._policy = Policy(Bins(-reach, reach, settings.bins[0]), torch.from_numpy(settings.spread * moves.deviation).float())
        self._optimiser = torch.optim.Adam(self._policy.parameters(), settings.rate)
        self._log_probability = torch.zeros(0)

    def propose(self, starts: FloatArray, noise: bool) -> FloatArray:
        """The starts (n, d) with edits; `noise` as in `rollout`."""
        edits = Edits(self._space, starts, self._moves)
        self._log_probability, changes = rollout(self._policy, edits, noise)
        self._edits.append(changes)
        return edits.theta

    def learn(self, rewards: FloatArray) -> None:
        """One step of REINFORCE (R. J. Williams, Machine Learning 8, 1992) with standardised advantages, by the rewards (n,) of
        what was proposed last."""
        self._rewards.append(rewards)
        advantage = torch.from_numpy(self._baseline.advantage(rewards)).float()
        loss = -(advantage * self._log_probability).mean()
        self._optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self._policy.parameters(), self._settings.clip)
        self._optimiser.step()

    def refine(self) -> None:
        """Go from the coarse bins to finer ones where the best episodes' edits were."""
        edits, rewards = np.concatenate(self._edits), np.concatenate(self._rewards)
        best = np.argsort(-rewards, kind="stable")[: max(int(_TOP * len(rewards)), 1)]
        outside = (1.0 - self._settings.span) / 2
        low, high = (torch.from_numpy(edge).float() for edge in np.quantile(edits[best], (outside, 1.0 - outside), axis=0))
        old = self._policy.bins
        missing = (_NARROWEST * (old.high - old.low) - (high - low)).clamp(min=0.0) / 2
        self._policy.rebin(Bins(low - missing, high + missing, self._settings.bins[1]))
        self._optimiser = torch.optim.Adam(self._policy.parameters(), self._settings.rate)


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
