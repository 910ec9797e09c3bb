"""GACS: a genetic algorithm for critical scenarios, without regard to how plausible they are."""

from __future__ import annotations

import numpy as np

from generation.search.problem import History, Problem
from generation.search.reward import criticality
from generation.study.strategies.genetic import POPULATION, evolve


def search(problem: Problem, budget: int, seed: int) -> History:
    """From a uniform population, by criticality alone.

    Raises:
        UsageError: pymoo is not installed.
    """
    start = np.random.default_rng(seed).random((POPULATION, len(problem.space.parameters)))
    return evolve(problem, budget, seed, start, lambda episodes: criticality(episodes.outcomes, problem.reward.form))
