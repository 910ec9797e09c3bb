"""ConScenD: concrete scenarios from recordings, as they are.

Tang et al., ConScenD: Concrete Scenarios from the highD Dataset According to ALKS Regulation UNECE R157 in OpenX, 2021.
"""

from __future__ import annotations

import numpy as np

from generation.search.problem import BATCH, Calls, History, Problem

METHOD = {"title": "ConScenD", "meaning": "replays recorded parameters, no search", "realistic": True}


def search(problem: Problem, budget: int, seed: int, batch: int = BATCH) -> History:
    """Every recorded row once, in a drawn order; then again in another, until the budget is spent."""
    calls, generator = Calls(problem, budget), np.random.default_rng(seed)
    while calls.left:
        order = generator.permutation(len(problem.real))
        for start in range(0, len(order), batch):
            if calls.left:
                calls(problem.real[order[start : start + batch]])
    return calls.history
