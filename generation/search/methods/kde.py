"""Draws from the density of recorded parameters: as plausible as traffic, critical by chance."""

from __future__ import annotations

import numpy as np

from generation.search.problem import BATCH, Calls, History, Problem

METHOD = {"title": "KDE sampling", "meaning": "draws from the density of recorded parameters", "realistic": True}


def search(problem: Problem, budget: int, seed: int, batch: int = BATCH) -> History:
    """Draws from the density, those outside brought to the box's limits."""
    calls, generator = Calls(problem, budget), np.random.default_rng(seed)
    while calls.left:
        calls(problem.reward.realism.density.sample(batch, generator))
    return calls.history
