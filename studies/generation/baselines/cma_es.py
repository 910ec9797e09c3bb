"""CMA-ES: covariance matrix adaptation on MCSG's reward.

N. Hansen, The CMA Evolution Strategy: A Tutorial, 2016.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from generation.search.problem import Calls, History, SearchProblem
from schemas.common.packages import optional

METHODS = {
    "cma-es": {
        "title": "CMA-ES",
        "meaning": "evolution strategy on MCSG's reward, with restarts",
        "realistic": True,
    }
}


@dataclass(frozen=True)
class CmaSettings:
    """Settings of the search.

    Attributes:
        population: points to a generation.
        sigma: first step size, as a share of the ranges.
    """

    population: int = 20
    sigma: float = 0.2


def cma_es(
    problem: SearchProblem, budget: int, seed: int, settings: CmaSettings = CmaSettings()
) -> History:
    """From a real scenario; anew from another one whenever it has converged.

    Raises:
        UsageError: cma is not installed.
    """
    cma = optional("cma")
    calls, generator = Calls(problem, budget), np.random.default_rng(seed)
    while calls.left:
        start = problem.space.unit(problem.real[generator.integers(len(problem.real))])
        options = {
            "bounds": [0, 1],
            "popsize": settings.population,
            "seed": int(generator.integers(1, 2**31)),
            "verbose": -9,
        }
        strategy = cma.CMAEvolutionStrategy(start, settings.sigma, options)
        while calls.left and not strategy.stop():
            points = strategy.ask()
            episodes = calls(problem.space.scaled(np.array(points)))
            if calls.left:
                strategy.tell(points, (-episodes.rewards).tolist())
    return calls.history
