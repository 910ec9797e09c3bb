"""MCSG: reinforcement learning of edits that make real scenarios critical and leave them plausible, from coarse to fine."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from generation.outcomes.outcomes import Episodes
from generation.search.policy import Learner, McsgSettings, Moves, coordinated, single, uniform_rows
from generation.search.problem import Calls, History, Problem
from generation.search.space import Space, diverse
from recognition.training.data import seeded
from schemas.common.array_types import FloatArray

__all__ = ["McsgSettings", "mcsg", "mcsg_published"]

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


class Starts(Protocol):
    """Draws what episodes start from."""

    def add(self, episodes: Episodes) -> None:
        """Take note of episodes."""

    def draw(self, n: int, spent: float, generator: np.random.Generator) -> FloatArray:
        """Starts (n, d), when that share of the budget is spent."""


class EliteStarts:
    """Real scenarios (or what was found before) at first, then the elite of all episodes so far.

    The elite is chosen by criticality − w·t·max((NLL − Q99)/IQR, 0), t the share of the budget that is spent. The reward's
    realism term is the same far from traffic as a little outside; this one goes on falling, so that what is critical is drawn
    back to where traffic is, and it grows with time, so that it is critical first.
    """

    def __init__(self, problem: Problem, settings: McsgSettings) -> None:
        self._problem, self._settings = problem, settings
        self._theta, self._critical, self._excess = np.empty((0, len(problem.space.parameters))), np.empty(0), np.empty(0)

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
        score = self._critical - self._problem.reward.weight * spent * self._excess
        count = max(int(self._settings.elite * len(score)), self._settings.batch // 2)
        ranked = self._theta[np.argsort(-score, kind="stable")]
        elite = ranked[diverse(self._problem.space.unit(ranked), self._settings.apart, count)]
        return uniform_rows(elite, n, generator)


class RealStarts:
    """Real scenarios, or what was found before; no episode is carried on."""

    def __init__(self, problem: Problem, settings: McsgSettings) -> None:
        self._starts = problem.starts

    def add(self, episodes: Episodes) -> None:
        """Episodes change nothing."""

    def draw(self, n: int, spent: float, generator: np.random.Generator) -> FloatArray:
        """Starts (n, d)."""
        return uniform_rows(self._starts, n, generator)


def mcsg(
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
    calls, generator, drawn = Calls(problem, budget), np.random.default_rng(seed), starts(problem, settings)
    with seeded(seed):
        learner = Learner(problem.space, edits(problem.space, problem.real), settings)
        for stage in range(3):
            if stage == 1 and calls.left < budget:
                learner.refine()
            until = budget * (stage + 1) // 3
            while (spent := budget - calls.left) < until:
                start = drawn.draw(min(settings.batch, until - spent), spent / budget, generator)
                episodes = calls(learner.propose(start, noise=stage == 2))
                drawn.add(episodes)
                learner.learn(episodes.rewards)
    return calls.history


def mcsg_published(problem: Problem, budget: int, seed: int, settings: McsgSettings = McsgSettings()) -> History:  # noqa: B008
    """MCSG as published: no elite, and edits of single parameters."""
    return mcsg(problem, budget, seed, settings, edits=single, starts=RealStarts)
