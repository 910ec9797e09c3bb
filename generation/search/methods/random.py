"""Random search: the row that has to be beaten first."""

from __future__ import annotations

import numpy as np

from generation.search.problem import BATCH, Calls, History, Problem

METHOD = {"title": "random", "meaning": "uniform in the box", "realistic": False}


def search(problem: Problem, budget: int, seed: int, batch: int = BATCH) -> History:
    """Uniform draws from the box."""
    calls, generator = Calls(problem, budget), np.random.default_rng(seed)
    while calls.left:
        calls(problem.space.draw(batch, generator))
    return calls.history
