"""MCSG: reinforcement learning of edits that make real scenarios critical and leave them plausible, from coarse to fine."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from generation.mcsg.edits import Moves, coordinated
from generation.mcsg.learner import Learner
from generation.mcsg.settings import McsgSettings
from generation.mcsg.starts import EliteStarts, Starts
from generation.search.problem import Calls, History, Problem
from generation.search.space import Space
from recognition.training.seeding import seeded
from xodr.array_types import FloatArray


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
