"""TD3: a deterministic policy with two critics.

S. Fujimoto, H. van Hoof, D. Meger, Addressing Function Approximation Error in Actor-Critic Methods,
ICML 2018.
"""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from schemas.common.array_types import FloatArray


@dataclass(frozen=True)
class TD3Settings:
    """Size and training, those of the publication where it has them.

    Attributes:
        hidden: units of both layers of each network.
        discount, rate, averaging: γ, of Adam, and τ of the target networks.
        noise, target_noise, clipped: standard deviations of explored and of smoothed actions, and
            the most of the latter.
        delay: updates of critics for one of the policy.
        batch: transitions of an update. remembered: most transitions.
    """

    hidden: int = 64
    discount: float = 0.98
    rate: float = 1e-3
    averaging: float = 0.005
    noise: float = 0.3
    target_noise: float = 0.2
    clipped: float = 0.5
    delay: int = 2
    batch: int = 256
    remembered: int = 200_000


class Batch(NamedTuple):
    """Transitions: what was seen, done, got, seen then, and whether that was the end."""

    seen: Tensor
    done: Tensor
    reward: Tensor
    then: Tensor
    over: Tensor


class TD3:
    """A policy that learns from transitions.

    Args:
        observed, actions: sizes of what it sees and does; actions are −1 to 1.
        generator: of all that is drawn. Weights are drawn by torch: seed it before.
    """

    def __init__(
        self, observed: int, actions: int, generator: np.random.Generator, settings: TD3Settings
    ) -> None:
        self._size, self._generator, self._actions = settings, generator, actions
        self._policy = nn.Sequential(_network(observed, actions, settings.hidden), nn.Tanh())
        self._critics = nn.ModuleList(
            _network(observed + actions, 1, settings.hidden) for _ in range(2)
        )
        self._policy_target, self._critics_target = deepcopy(self._policy), deepcopy(self._critics)
        self._policy_optimiser = torch.optim.Adam(self._policy.parameters(), lr=settings.rate)
        self._critic_optimiser = torch.optim.Adam(self._critics.parameters(), lr=settings.rate)
        self._memory: list[Tensor] = [torch.empty(0) for _ in Batch._fields]
        self._updates = 0

    def __call__(self, seen: FloatArray) -> FloatArray:
        """Actions (n, k) with the noise of exploration."""
        noise = self._generator.normal(0.0, self._size.noise, (len(seen), self._actions))
        return np.clip(self.best(seen) + noise, -1.0, 1.0)

    def best(self, seen: FloatArray) -> FloatArray:
        """Actions (n, k) without noise."""
        with torch.no_grad():
            actions: FloatArray = self._policy(_tensor(seen)).numpy().astype(np.float64)
        return actions

    def remember(self, columns: tuple[FloatArray, ...]) -> None:
        """Take transitions into memory; the oldest go."""
        kept = self._size.remembered
        fresh = [_tensor(column) for column in columns]
        self._memory = [
            torch.cat([old, new])[-kept:] if len(old) else new
            for old, new in zip(self._memory, fresh, strict=True)
        ]

    def learn(self, updates: int) -> None:
        """Learn from what is remembered."""
        for _ in range(updates):
            rows = torch.from_numpy(
                self._generator.integers(len(self._memory[0]), size=self._size.batch)
            )
            self._update(Batch(*(column[rows] for column in self._memory)))

    def _update(self, batch: Batch) -> None:
        size, both = self._size, torch.cat([batch.seen, batch.done], dim=1)
        with torch.no_grad():
            drawn = self._generator.normal(0.0, size.target_noise, batch.done.shape)
            noise = _tensor(drawn).clamp(-size.clipped, size.clipped)
            following = torch.cat(
                [batch.then, (self._policy_target(batch.then) + noise).clamp(-1.0, 1.0)], dim=1
            )
            least = torch.minimum(*(critic(following)[:, 0] for critic in self._critics_target))
            target = batch.reward + size.discount * (1.0 - batch.over) * least
        error = sum(((critic(both)[:, 0] - target) ** 2).mean() for critic in self._critics)
        _step(self._critic_optimiser, error)
        self._updates += 1
        if self._updates % size.delay == 0:
            value = self._critics[0](
                torch.cat([batch.seen, self._policy(batch.seen)], dim=1)
            ).mean()
            _step(self._policy_optimiser, -value)
            for target_network, network in (
                (self._policy_target, self._policy),
                (self._critics_target, self._critics),
            ):
                for slow, fast in zip(
                    target_network.parameters(), network.parameters(), strict=True
                ):
                    slow.data.lerp_(fast.data, size.averaging)


def _step(optimiser: torch.optim.Optimizer, loss: Tensor) -> None:
    optimiser.zero_grad()
    loss.backward()
    optimiser.step()


def _tensor(values: FloatArray) -> Tensor:
    return torch.from_numpy(np.asarray(values, np.float32))


def _network(inputs: int, outputs: int, hidden: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Linear(inputs, hidden), nn.ReLU(), nn.Linear(hidden, hidden), nn.ReLU(),
        nn.Linear(hidden, outputs)
    )  # fmt: skip
