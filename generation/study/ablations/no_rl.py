"""Ablation No-RL: a genetic algorithm in the place of the policy, with MCSG's reward, from real scenarios."""

from __future__ import annotations

import numpy as np

from generation.search.problem import History, Problem
from generation.study.strategies.genetic import GeneticSettings, evolve

METHOD = {"title": "No-RL", "meaning": "MCSG's reward and starts, a genetic algorithm in place of the policy", "realistic": True}


def search(problem: Problem, budget: int, seed: int) -> History:
    """From a population of real scenarios.

    Raises:
        UsageError: pymoo is not installed.
    """
    chosen = np.random.default_rng(seed).integers(len(problem.real), size=GeneticSettings.population)
    return evolve(problem, budget, seed, problem.space.unit(problem.real[chosen]), lambda episodes: episodes.rewards)
