"""MCSG: reinforcement learning of edits that make real scenarios critical and leave them plausible,
from coarse to fine."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from generation.search.outcomes import Episodes
from generation.search.problem import Calls, History, SearchProblem
from generation.space.density.base import Whitening
from generation.space.space import Space, diverse
from recognition.trfe.training.windows import seeded
from schemas.common.array_types import FloatArray

METHODS = {
    "mcsg": {
        "title": "**MCSG**",
        "meaning": "reinforcement learning of edits to real scenarios, coarse to fine",
        "realistic": True,
    },
    "mcsg-published": {
        "title": "MCSG as published",
        "meaning": "reinforcement learning of edits as published: no elite, no coordinated edits",
        "realistic": True,
    },
}


@dataclass(frozen=True)
class McsgSettings:
    """Settings of MCSG's learning; METHOD §3 unless stated.

    Attributes:
        batch: episodes to each step of REINFORCE.
        rate, clip: of Adam, and the norm that gradients are cut to.
        momentum: of the moving average of rewards that is the baseline.
        bins: of each parameter's edits, in the first stage and after it.
        span: share of the best episodes' edits that the second stage's ranges hold.
        reach: greatest edit of the first stage, in standard deviations of the real parameters.
        spread: standard deviation of the untrained policy's edits, the same way.
        elite: share of all episodes so far that the next ones start from.
        apart: least distance of two of the elite in the unit cube, root mean square over the
            parameters.
    """

    batch: int = 50
    rate: float = 1e-2
    clip: float = 1.0
    momentum: float = 0.9
    bins: tuple[int, int] = (5, 10)
    span: float = 0.9
    reach: float = 3.0
    spread: float = 1.0
    elite: float = 0.05
    apart: float = 0.05


class Moves(NamedTuple):
    """Effects of edits on θ.

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

    With LLᵀ the covariance of the real ones in the unit cube, an edit δ of parameter j adds δ times
    column j of L: the parameter moves by δ standard deviations given those before it, and those
    after it move as they do together in traffic.
    """
    # Rows of Lᵀ are columns of L. Row j has no entry before j, so an edit leaves earlier
    # parameters.
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
        """States (n, 2d): θ in the unit cube, and 1 at the place of the parameter that is edited
        next, if any."""
        n, d = self.theta.shape
        turn = np.zeros((n, d))
        turn[:, self.step : self.step + 1] = 1.0
        return np.hstack([self._space.unit(self.theta), turn]).astype(np.float32)

    def edit(self, change: FloatArray) -> None:
        """Edit the next parameter by the amounts (n,); nothing leaves the box."""
        unit = self._space.unit(self.theta) + change[:, None] * self._rows[self.step]
        # Only the columns that the edit moves: going to the unit cube and back would round the
        # others.
        changed = self._rows[self.step] != 0.0
        self.theta[:, changed] = self._space.scaled(np.clip(unit, 0.0, 1.0))[:, changed]
        self.step += 1


HIDDEN, LAYERS, DROPOUT = 32, 2, 0.2
State = tuple[Tensor, Tensor]


class Bins(NamedTuple):
    """Bins of edits, the same number for each parameter.

    Attributes:
        low, high: outer edges (d,). number: of bins.
    """

    low: Tensor
    high: Tensor
    number: int

    @property
    def width(self) -> Tensor:
        """Widths of the bins (d,)."""
        return (self.high - self.low) / self.number

    def centres(self, step: int) -> Tensor:
        """Centres of the bins (number,) of a parameter."""
        return self.low[step] + (torch.arange(self.number) + 0.5) * self.width[step]

    def holding(self, step: int, edits: Tensor) -> Tensor:
        """The bin that holds each edit (n,) of a parameter, or is nearest to it."""
        return (
            ((edits - self.low[step]) / self.width[step]).floor().long().clamp(0, self.number - 1)
        )


class Policy(nn.Module):
    """LSTM over the parameters, with a layer of its own for each parameter that weighs its bins.

    Untrained, it takes edits as a normal distribution around none would.

    Args:
        bins: of edits. spread: standard deviation (d,) of the untrained policy's edits.
    """

    def __init__(self, bins: Bins, spread: Tensor) -> None:
        super().__init__()
        d = len(spread)
        self.lstm = nn.LSTM(2 * d, HIDDEN, LAYERS, dropout=DROPOUT)
        self.bins = bins
        # Weights of zero: the first edits follow the bias, which is the log of a normal density,
        # alone.
        self.weight = nn.Parameter(torch.zeros(d, bins.number, HIDDEN))
        self.bias = nn.Parameter(
            torch.stack([-0.5 * (bins.centres(step) / spread[step]) ** 2 for step in range(d)])
        )

    def forward(self, step: int, observation: Tensor, state: State | None) -> tuple[Tensor, State]:
        """Logits (n, bins) of a parameter's edit, and the new state, given the
        observation (n, 2d).
        """
        features, state = self.lstm(observation[None], state)
        return features[0] @ self.weight[step].T + self.bias[step], state

    def rebin(self, bins: Bins) -> None:
        """Change to other bins; each is weighed as the old bin was that its centre lies in."""
        old, self.bins = self.bins, bins
        chosen = torch.stack(
            [old.holding(step, bins.centres(step)) for step in range(len(self.bias))]
        )
        with torch.no_grad():
            weight = self.weight.gather(1, chosen[..., None].expand(-1, -1, HIDDEN))
            bias = self.bias.gather(1, chosen)
        self.weight, self.bias = nn.Parameter(weight.clone()), nn.Parameter(bias.clone())


_NARROWEST = 0.02
"""Least range of edits in the second stage, as a share of that in the first."""
_TOP = 0.1
"""Share of the best episodes whose edits set the second stage's ranges"""


class Learner:
    """Proposes edited scenarios and learns from the rewards of the last ones; asked and answered in
    turns.

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
        self._policy = Policy(
            Bins(-reach, reach, settings.bins[0]),
            torch.from_numpy(settings.spread * moves.deviation).float(),
        )
        self._optimiser = torch.optim.Adam(self._policy.parameters(), settings.rate)
        self._log_probability = torch.zeros(0)

    def propose(self, starts: FloatArray, noise: bool) -> FloatArray:
        """The starts (n, d) with edits; `noise` as in `rollout`."""
        edits = Edits(self._space, starts, self._moves)
        self._log_probability, changes = rollout(self._policy, edits, noise)
        self._edits.append(changes)
        return edits.theta

    def learn(self, rewards: FloatArray) -> None:
        """Make one step of REINFORCE (R. J. Williams, Machine Learning 8, 1992) with standardised
        advantages, by the rewards (n,) of the last proposals."""
        self._rewards.append(rewards)
        advantage = torch.from_numpy(self._baseline.advantage(rewards)).float()
        # Gradient ascent on the expected reward: E[A ∇ log π], by automatic differentiation of this
        # loss.
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
        low, high = (
            torch.from_numpy(edge).float()
            for edge in np.quantile(edits[best], (outside, 1.0 - outside), axis=0)
        )
        old = self._policy.bins
        # If the best episodes agree exactly, the range would be a point with bins of no width.
        missing = (_NARROWEST * (old.high - old.low) - (high - low)).clamp(min=0.0) / 2
        self._policy.rebin(Bins(low - missing, high + missing, self._settings.bins[1]))
        # New parameters: the moments of the old ones are of another shape.
        self._optimiser = torch.optim.Adam(self._policy.parameters(), self._settings.rate)


def rollout(policy: Policy, edits: Edits, noise: bool) -> tuple[Tensor, FloatArray]:
    """Edit all parameters, each by a bin that the policy draws.

    Args:
        noise: whether an edit is normal around the bin's centre, half a bin its standard deviation,
            or uniform in the bin.

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
        # In units of the bin's width. It is noise to the policy: only the choice of the bin has a
        # log-probability to learn from.
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
        """Rewards (n,) above the average of those before, in units of their deviation from it; the
        average moves on."""
        mean = float(rewards.mean())
        # The first batch has none before it: it is compared with its own mean.
        before = mean if np.isnan(self._mean) else self._mean
        self._mean = self._momentum * before + (1.0 - self._momentum) * mean
        above = rewards - before
        # The constant bounds advantages in batches of nearly equal rewards.
        return above / (above.std() + 1e-3)


def uniform_rows(rows: FloatArray, n: int, generator: np.random.Generator) -> FloatArray:
    """Rows (n, d) drawn with replacement, each as likely as the others."""
    return rows[generator.integers(len(rows), size=n)]


class Starts(Protocol):
    """Draws what episodes start from."""

    def add(self, episodes: Episodes) -> None:
        """Take note of episodes."""

    def draw(self, n: int, spent: float, generator: np.random.Generator) -> FloatArray:
        """Starts (n, d), when that share of the budget is spent."""


class EliteStarts:
    """Starts from real scenarios (or earlier finds) at first, then from the elite of all episodes.

    The elite is chosen by criticality − w·t·max((NLL − Q99)/IQR, 0), t the share of the budget that
    is spent. The reward's realism term is the same far from traffic as a little outside; this one
    goes on falling, so that what is critical is drawn back to where traffic is, and it grows with
    time, so that it is critical first.
    """

    def __init__(self, problem: SearchProblem, settings: McsgSettings) -> None:
        self._problem, self._settings = problem, settings
        self._theta, self._critical, self._excess = (
            np.empty((0, len(problem.space.parameters))),
            np.empty(0),
            np.empty(0),
        )

    def add(self, episodes: Episodes) -> None:
        """Take note of episodes."""
        reward = self._problem.reward
        self._theta = np.concatenate([self._theta, episodes.theta])
        self._critical = np.concatenate([self._critical, reward.criticality(episodes.outcomes)])
        self._excess = np.concatenate([self._excess, reward.realism.excess(episodes.theta)])

    def draw(self, n: int, spent: float, generator: np.random.Generator) -> FloatArray:
        """Starts (n, d), when that share of the budget is spent."""
        if len(self._theta) < self._settings.batch:
            return uniform_rows(self._problem.starts, n, generator)
        # The share of the budget weighs realism: first critical, then plausible.
        score = self._critical - self._problem.reward.weight * spent * self._excess
        # At least half a batch, so that early rounds do not start from one or two points.
        count = max(int(self._settings.elite * len(score)), self._settings.batch // 2)
        ranked = self._theta[np.argsort(-score, kind="stable")]
        elite = ranked[diverse(self._problem.space.unit(ranked), self._settings.apart, count)]
        return uniform_rows(elite, n, generator)


class RealStarts:
    """Starts from real scenarios or earlier finds; episodes are not carried on."""

    def __init__(self, problem: SearchProblem, settings: McsgSettings) -> None:
        self._starts = problem.starts

    def add(self, episodes: Episodes) -> None:
        """Episodes change nothing."""

    def draw(self, n: int, spent: float, generator: np.random.Generator) -> FloatArray:
        """Starts (n, d)."""
        return uniform_rows(self._starts, n, generator)


def mcsg(
    problem: SearchProblem,
    budget: int,
    seed: int,
    settings: McsgSettings = McsgSettings(),
    edits: Callable[[Space, FloatArray], Moves] = coordinated,
    starts: Callable[[SearchProblem, McsgSettings], Starts] = EliteStarts,
) -> History:
    """Spend the budget in three equal stages: coarse bins, fine bins around the best edits, and
    these with Gaussian noise.

    The state is carried on: once there are as many episodes as in a batch, the next ones start from
    the elite of all, so that critical scenarios are edited further instead of being found anew.

    Args:
        problem: what is searched.
        budget: simulator calls.
        seed: of everything random.
        settings: how the policy learns.
        edits: gives the edits of a space, given real parameters (n, d).
        starts: gives what episodes start from.
    """
    calls, generator, drawn = (
        Calls(problem, budget),
        np.random.default_rng(seed),
        starts(problem, settings),
    )
    with seeded(seed):
        learner = Learner(problem.space, edits(problem.space, problem.real), settings)
        for stage in range(3):
            # Once, before the second stage; a first stage without calls has nothing to refine by.
            if stage == 1 and calls.left < budget:
                learner.refine()
            until = budget * (stage + 1) // 3
            while (spent := budget - calls.left) < until:
                start = drawn.draw(min(settings.batch, until - spent), spent / budget, generator)
                episodes = calls(learner.propose(start, noise=stage == 2))
                drawn.add(episodes)
                learner.learn(episodes.rewards)
    return calls.history


def mcsg_published(
    problem: SearchProblem, budget: int, seed: int, settings: McsgSettings = McsgSettings()
) -> History:
    """MCSG as published: no elite, and edits of single parameters."""
    return mcsg(problem, budget, seed, settings, edits=single, starts=RealStarts)
