"""Methods without training and without other libraries.

`random` shows the content of the whole box, `kde` failures of traffic like the recorded one,
`conscend` those of exactly the recorded manoeuvres.
"""

from __future__ import annotations

import numpy as np

from generation.search.problem import BATCH, Calls, History, SearchProblem

METHODS = {
    "conscend": {
        "title": "ConScenD",
        "meaning": "replays recorded parameters, no search",
        "realistic": True,
    },
    "kde": {
        "title": "KDE sampling",
        "meaning": "draws from the density of recorded parameters",
        "realistic": True,
    },
    "random": {"title": "random", "meaning": "uniform in the box", "realistic": False},
}


def random(problem: SearchProblem, budget: int, seed: int, batch: int = BATCH) -> History:
    """Uniform draws from the box."""
    calls, generator = Calls(problem, budget), np.random.default_rng(seed)
    while calls.left:
        calls(problem.space.draw(batch, generator))
    return calls.history


def kde(problem: SearchProblem, budget: int, seed: int, batch: int = BATCH) -> History:
    """Draws from the density, those outside brought to the box's limits."""
    calls, generator = Calls(problem, budget), np.random.default_rng(seed)
    while calls.left:
        calls(problem.reward.realism.density.sample(batch, generator))
    return calls.history


def conscend(problem: SearchProblem, budget: int, seed: int, batch: int = BATCH) -> History:
    """Every recorded row once, in a drawn order; then again in another, until the budget is spent.

    Tang et al., ConScenD: Concrete Scenarios from the highD Dataset According to ALKS Regulation
    UNECE R157 in OpenX, 2021.
    """
    calls, generator = Calls(problem, budget), np.random.default_rng(seed)
    while calls.left:
        order = generator.permutation(len(problem.real))
        for start in range(0, len(order), batch):
            if calls.left:
                calls(problem.real[order[start : start + batch]])
    return calls.history
